"""hm2 monitor: the card in a terminal, while it runs."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Sequence
from types import ModuleType

import click

from hostmot2.cli.explain import explain
from hostmot2.cli.session import MASK, Session, reports
from hostmot2.monitor.source import Source

ALL = "all"


def _app() -> ModuleType:
    """The view, which needs an extra."""
    try:
        from hostmot2.monitor import app
    except ModuleNotFoundError as problem:
        raise ImportError(f"the monitor needs {problem.name}: pip install 'hostmot2[monitor]'") from problem
    return app


@click.command()
@click.option(
    "--start",
    "masks",
    multiple=True,
    metavar="all|[PORT:]MASK",
    help="Start these channels, all outputs off; all: every remote that answers.",
)
@click.option(
    "--mode",
    "modes",
    multiple=True,
    metavar="[PORT.]CHANNEL=MODE",
    help="Software mode of a remote, for --start.",
)
@click.option("--rate", type=click.FloatRange(1, 20000), default=200.0, show_default=True, metavar="HZ")
@click.option(
    "--allow-write", is_flag=True, help="Outputs can be armed and set; starts all unless told which."
)
@reports
@click.pass_context
def monitor(
    context: click.Context,
    session: Session,
    masks: tuple[str, ...],
    modes: tuple[str, ...],
    rate: float,
    allow_write: bool,
) -> None:
    """Show the card in the terminal while it runs.

    Channels and their faults, encoders, analog values, field I/O, latency. ? in it lists the keys.

    Without options it only looks: nothing is written to the card, which another program may be driving.
    Remotes' process data is then not known; --start takes the card over and starts remotes with all outputs
    off. With --allow-write outputs can be armed, after a question; they go off when the monitor ends, however
    it ends.

    \b
    Examples:
      hm2 --board udp://10.10.10.10 monitor
      hm2 monitor --start all --mode 0=2
      hm2 monitor --allow-write
    """
    start = _start(masks, allow_write)
    chosen = dict(_mode(each) for each in modes)
    if chosen and start is None:
        raise click.UsageError("--mode is for --start: a remote takes its mode when it is started")
    if session.as_json or not _is_terminal():
        raise click.UsageError(
            "hm2 monitor needs a terminal to draw in. For scripts: `hm2 --json sserial scan`, `hm2 record`"
        )
    app = _app()
    with session.board(read_only=start is None) as board:
        source = Source(board, start=start, rate=rate, allow_write=allow_write, modes=chosen)
        try:
            source.start()
            status = app.run(source, explanation)
        finally:
            source.close()
    context.exit(status)


def _is_terminal() -> bool:
    return sys.stdin.isatty() and sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def _start(masks: Sequence[str], allow_write: bool) -> dict[int, int] | None:
    """Ports and their masks; {}: all that answer; None: only look."""
    if not masks:
        return {} if allow_write else None
    if ALL in masks:
        if len(masks) > 1:
            raise click.BadParameter("`all` goes alone", param_hint="--start")
        return {}
    start: dict[int, int] = {}
    for text in masks:
        port, colon, mask = text.rpartition(":")
        number = _number(port, "--start") if colon else 0
        start[number] = start.get(number, 0) | MASK(mask)
    return start


def _mode(text: str) -> tuple[tuple[int, int], int]:
    place, equals, mode = text.partition("=")
    if not equals:
        raise click.BadParameter(f"{text!r} is not CHANNEL=MODE", param_hint="--mode")
    port, _, channel = place.rpartition(".")
    return (_number(port or "0", "--mode"), _number(channel, "--mode")), MASK(mode)


def _number(text: str, option: str) -> int:
    if not text.isdecimal():
        raise click.BadParameter(f"{text!r} is not a number", param_hint=option)
    return int(text)


def explanation(what: str) -> str:
    """What `hm2 explain` prints."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        explain.main([what], standalone_mode=False, obj=Session())
    return printed.getvalue()
