"""hm2 sserial: scan, start, stop, status, counters of a smart-serial port."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from hostmot2.cli import failure
from hostmot2.cli.session import MASK, Session, reports, rows, text_width
from hostmot2.modules.driven import raise_if_driven
from hostmot2.sserial.checklist import advise
from hostmot2.sserial.results import HEADER as RESULT_HEADER

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.sserial import ChannelEvidence, SserialPort

PERIOD_S = 0.005
"""Of the exchanges of `start --run`: well within the remotes' watchdogs, 40 ms and more."""

port_option = click.option(
    "--port", "number", type=click.IntRange(0, 3), default=0, show_default=True, help="SSERIAL instance."
)


@click.group()
def sserial() -> None:
    """Smart serial: remotes on the card's RS-422 channels.

    Whatever was started is stopped again, its outputs off, when the command ends.
    """


@contextmanager
def port_of(session: Session, number: int) -> Iterator[tuple[Board, SserialPort]]:
    """The card and its smart-serial port of that number. Raises CardBusy if another program drives it."""
    with session.board() as board:
        raise_if_driven(board)
        ports = board.sserial
        if number >= len(ports):
            raise click.UsageError(f"there is no port {number}: the card has {len(ports)}")
        yield board, ports[number]


def _evidence(row: ChannelEvidence) -> dict[str, Any]:
    return {
        "channel": row.channel,
        "name": row.name,
        "unit_number": row.unit_number,
        "place": {
            "connector": row.place.connector or None,
            "card": row.place.card.name if row.place.card else None,
            "remote": row.place.remote.what if row.place.remote else None,
        },
        "found": row.found,
        "started": row.started,
        "result": row.reason,
        "cs": row.status.word,
        "counters": asdict(row.counters) if row.counters else None,
    }


@sserial.command()
@port_option
@reports
def scan(session: Session, number: int) -> None:
    """Look at every channel: who answers, and why one cannot be used.

    Where a remote should have answered, what to check follows, in the order in which it is likely: that
    depends on which of a card's remotes did answer. A remote whose set-up jumper is in place is found, too.

    \b
    Examples:
      hm2 sserial scan
      hm2 --board "emu://5i25+7i77?silent=0" sserial scan
      hm2 --json sserial scan
    """
    with port_of(session, number) as (_, port):
        found = port.scan(setup_rate=True)
    document = [
        _evidence(row)
        | {"elements": row.elements, "parameters": row.parameters}
        | {"checks": list(advise([row], found).checks) if row in found.wrong else []}
        for row in found
    ]
    table = rows(RESULT_HEADER, [row.row() for row in found])
    session.report(document, table, *found.advice.lines(text_width()))


@sserial.command()
@click.argument("mask", type=MASK)
@click.option("--setup", is_flag=True, help="Setup mode: access to the remotes' memory, no process data.")
@click.option(
    "--run", "seconds", type=click.FloatRange(min=0), default=0.0, help="Exchange data for SECONDS."
)
@port_option
@reports
@click.pass_context
def start(
    context: click.Context, session: Session, mask: int, setup: bool, seconds: float, number: int
) -> None:
    """Start the channels in MASK (bit n: channel n); 6 if one did not.

    Outputs stay zero. With --run the inputs are shown as they were at the end.

    \b
    Examples:
      hm2 sserial start 0x03
      hm2 sserial start 0x01 --run 2
      hm2 sserial start 0x02 --setup
    """
    with port_of(session, number) as (board, port):
        result = port.start(mask, "setup" if setup else "normal")
        failed = 0
        if seconds and result.started and not setup:
            failed = _run(board, port, result.started, seconds)
        document = {
            "started": result.started,
            "failed": result.failed,
            "failed_exchanges": failed,
            "channels": [_evidence(row) for row in result.channels],
            "inputs": _inputs(port, result.started) if seconds and not setup else {},
        }
        session.report(document, str(result), *([repr(port)] if seconds else []))
    if result.failed:
        context.exit(failure.DEVICE)


def _run(board: Board, port: SserialPort, mask: int, seconds: float) -> int:
    """Exchanges for a while; how many failed."""
    failed = 0
    for _ in range(max(1, round(seconds / PERIOD_S))):
        failed += bool(port.doit(mask).failed)
        board.pause(PERIOD_S)
    return failed


def _inputs(port: SserialPort, mask: int) -> dict[int, dict[str, Any]]:
    started = (channel for channel in port.channels if mask >> channel.number & 1 and channel.description)
    return {channel.number: dict(channel.inputs) for channel in started}


@sserial.command()
@click.argument("mask", type=MASK, required=False)
@port_option
@reports
def stop(session: Session, mask: int | None, number: int) -> None:
    """Stop what a program that was killed has left running.

    Always all channels, whatever MASK says: beginning with a port resets it, which stops the others, too.

    \b
    Examples:
      hm2 sserial stop
    """
    with port_of(session, number) as (_, port):
        port.stop(mask)
    session.report({"stopped": 0xFF}, "stopped")


@sserial.command()
@port_option
@reports
def status(session: Session, number: int) -> None:
    """The CS register of every channel, in words.

    As the last program left it: one that ended in order has stopped all channels. Nothing is changed.

    \b
    Examples:
      hm2 sserial status
      hm2 --json sserial status --port 0
    """
    lines, document = [], []
    with port_of(session, number) as (_, port), port.untouched():
        for channel in port.channels:
            found = channel.status
            lines.append((channel.number, f"0x{found.word:08X}", found.state, ", ".join(found.live)))
            document.append(
                {"channel": channel.number, "cs": found.word, "state": found.state}
                | {"live": found.live, "sticky": found.sticky}
            )
        firmware = f"SSLBP {port.revision}, {port.clock_hz / 1e6:g} MHz, {len(port.channels)} channels"
        facts = {"port": number, "revision": port.revision, "clock_hz": port.clock_hz, "channels": document}
    session.report(facts, firmware, rows(("channel", "CS", "state", "live"), lines))


@sserial.command()
@port_option
@reports
def counters(session: Session, number: int) -> None:
    """The firmware's error counters of every channel.

    They count from the channel's last stop, up to 20 of each kind. A program that ended in order has stopped
    its channels: what is shown is left from one that was killed. Of a program that runs they are shown by
    itself (SserialPort.counters), by `hm2 monitor --start`, and of a start by `hm2 sserial scan`.

    \b
    Examples:
      hm2 sserial counters
      hm2 --json sserial counters
    """
    with port_of(session, number) as (_, port), port.untouched():
        counted = [asdict(row) for row in port.counters()]
    header = [name.replace("_", " ") for name in counted[0]] if counted else []
    session.report(counted, rows(header, [tuple(row.values()) for row in counted]))
