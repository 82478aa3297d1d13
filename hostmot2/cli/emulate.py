"""hm2 emulate, hm2 emu: an emulated Ethernet card on the network, and a hand into it."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from hostmot2 import dump
from hostmot2.cli.session import Session, reports
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.control import Controls, ControlServer, ask
from hostmot2.emulator.ethernet import EthernetDescription, EthernetServer, Fault, description
from hostmot2.lbp16 import PORT


def _fault(_context: click.Context, _parameter: click.Parameter, text: str | None) -> Fault:
    try:
        return Fault.parse(text or "")
    except ValueError as error:
        raise click.BadParameter(str(error)) from None


def _address(_context: click.Context, _parameter: click.Parameter, text: str) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    if not colon:
        return text, PORT
    if not port.isdigit() or int(port) > 65535:
        raise click.BadParameter(f"{text}: HOST or HOST:PORT")
    return host, int(port)


def _described(words: list[int]) -> EthernetDescription:
    """By the IDROM's board name, unless told otherwise: MESA7I92 is a 7I92."""
    letters = b"".join(word.to_bytes(4, "little") for word in words[3:5]).rstrip(b"\0 ")
    return EthernetDescription(letters.decode("ascii", "replace").removeprefix("MESA"))


@contextlib.contextmanager
def _above_ordinary_programs() -> Iterator[None]:
    """The least real-time priority for the threads started meanwhile.

    Who steers the card holds it, and its packets with it: an ordinary program that held him up would hold
    them up as well.
    """
    with contextlib.suppress(PermissionError):  # the server's own thread is refused as well, and says so
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@click.command()
@click.argument("spec")
@click.option("--listen", default="127.0.0.1", show_default=True, callback=_address, metavar="HOST[:PORT]")
@click.option("--fault", callback=_fault, metavar="FAULTS", help="loss=1%,delay=200us,dup=1%,reorder=1%,...")
@click.option("--control", type=click.Path(path_type=Path), help="Unix socket for `hm2 emu`.")
@click.option("--name", help="The board's name, as clients decide by it; needed for a dump of another card.")
@click.option("--mac", help="The card's MAC address, such as 00:60:1b:10:12:34.")
@click.option("--ip", help="The address in the card's EEPROM.")
@click.option("--firmware", type=click.Choice(["a", "b"]), help="Register generation.")
@click.option("--priority", type=click.IntRange(0, 98), default=0, help="SCHED_FIFO priority; 0: none.")
@click.option("--cpu", type=click.IntRange(0), help="The processor to run on, of those this process may use.")
@click.option("--spin-us", type=click.IntRange(0, 1_000_000), default=30, help="Wait awake between packets.")
def emulate(
    spec: str,
    listen: tuple[str, int],
    fault: Fault,
    control: Path | None,
    name: str | None,
    mac: str | None,
    ip: str | None,
    firmware: str | None,
    priority: int,
    cpu: int | None,
    spin_us: int,
) -> None:
    """Serve an emulated Ethernet card until SIGINT or SIGTERM.

    SPEC may be a register dump (FILE.hm2dump, see `hm2 dump`): the modules and pins of the card it is of.

    Prints one line when it is ready. It listens on loopback unless told otherwise. FAULTS act on datagrams:
    loss, dup and reorder in percent, delay and jitter with us or ms, direction=requests|replies|both,
    seed=N.

    \b
    Examples:
      hm2 emulate 7i92+7i77
      hm2 emulate 7i92+7i77 --listen 127.0.0.1:0 --control /tmp/card
      hm2 emulate 7i92+7i77 --fault loss=1%,delay=200us
    """
    given = {"name": name, "mac": mac, "ip": ip}
    changes: dict[str, Any] = {key: value for key, value in given.items() if value}
    words = dump.load(spec).idrom_words() if spec.endswith(".hm2dump") else None
    facts = replace(_described(words) if words else description(spec), **changes)
    with contextlib.ExitStack() as stack:
        until_told = stack.enter_context(_told_to_end())
        board = EmulatedBoard(words or spec, clock="real", firmware=firmware)
        server = EthernetServer(
            board,
            *listen,
            description=facts,
            spin_us=spin_us,
            fifo_priority=priority,
            cpu=-1 if cpu is None else cpu,
        )
        stack.callback(board.close)
        stack.callback(server.close)
        server.set_fault(fault)
        if priority:
            stack.enter_context(_above_ordinary_programs())
        if control is not None:
            stack.enter_context(ControlServer(control, Controls(board, server, fault)))
        server.start()
        if not server.is_loopback:
            click.echo(f"hm2: whoever reaches {listen[0]} can drive this card", err=True)
        click.echo(f"ready udp://{server.host}:{server.port} {spec}")
        until_told()


@contextlib.contextmanager
def _told_to_end() -> Iterator[Callable[[], None]]:
    """What waits for SIGINT or SIGTERM. They count from here on, whichever thread they reach.

    Threads of libraries take signals, too; only the handler in C, which writes to the socket, runs there.
    """
    hear, tell = socket.socketpair()
    tell.setblocking(False)
    handlers = {number: signal.signal(number, lambda *_: None) for number in (signal.SIGINT, signal.SIGTERM)}
    before = signal.set_wakeup_fd(tell.fileno(), warn_on_full_buffer=False)

    def wait() -> None:
        while hear.recv(1)[0] not in handlers:
            pass

    try:
        yield wait
    finally:
        signal.set_wakeup_fd(before)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        hear.close()
        tell.close()


@click.group()
@click.option("--control", type=click.Path(path_type=Path), help="As given to `hm2 emulate`.")
@click.pass_context
def emu(context: click.Context, control: Path | None) -> None:
    """Look into and steer a running `hm2 emulate`.

    Keys: output, input, analogout0..5, analogena, spinena, encoder0_rate.., encoder0_position.., led0..,
    requests, replies, fault.loss, fault.dup, fault.reorder, fault.delay, fault.jitter (us), fault.requests,
    fault.replies, fault.seed. A second daughter card's have its number before: 1.output.
    """
    context.meta["control"] = control


def _control(context: click.Context) -> Path:
    control: Path | None = context.meta["control"]
    if control is None:
        raise click.UsageError("which card? hm2 emu --control PATH, as given to `hm2 emulate`")
    return control


@emu.command()
@click.argument("key")
@reports
@click.pass_context
def get(context: click.Context, session: Session, key: str) -> None:
    """Print a key's value, a plain number.

    \b
    Examples:
      hm2 emu --control /tmp/card get analogout0
      hm2 emu --control /tmp/card get 1.output
    """
    value = ask(_control(context), "get", key)
    session.report({key: float(value)}, value)


@emu.command("set", context_settings={"ignore_unknown_options": True})
@click.argument("key")
@click.argument("value", type=float)
@reports
@click.pass_context
def set_(context: click.Context, session: Session, key: str, value: float) -> None:
    """Set a key to a number.

    \b
    Examples:
      hm2 emu --control /tmp/card set encoder0_rate 1000
      hm2 emu --control /tmp/card set fault.loss 0.01
    """
    ask(_control(context), "set", key, f"{value:.17g}")
    session.report({key: value})
