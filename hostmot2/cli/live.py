"""hm2 live: the card in Foxglove, while it runs."""

from __future__ import annotations

import ipaddress
from pathlib import Path
from types import ModuleType

import click

from hostmot2.cli.run import start_remotes, until, watch
from hostmot2.cli.session import Session, reports


def _live() -> ModuleType:
    """The package, which needs an extra."""
    try:
        from hostmot2 import live
    except ModuleNotFoundError as problem:
        raise ImportError(f"the live view needs {problem.name}: pip install 'hostmot2[live]'") from problem
    return live


@click.command()
@click.option("--host", default="127.0.0.1", show_default=True, help="The address to listen at.")
@click.option("--port", type=click.IntRange(0, 65535), default=8765, show_default=True, help="0: a free one.")
@click.option("--rate", type=click.FloatRange(0.1, 20000), default=1000.0, show_default=True, metavar="HZ")
@click.option("--json-rate", type=click.FloatRange(min=0), default=100.0, show_default=True, metavar="HZ")
@click.option("--seconds", type=click.FloatRange(min=0), help="How long; until SIGINT or SIGTERM otherwise.")
@click.option(
    "--layout", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE", help="Write a layout for it."
)
@click.option("--real-time", is_flag=True, help="SCHED_FIFO and memory locked, where permitted.")
@reports
def live(
    session: Session,
    host: str,
    port: int,
    rate: float,
    json_rate: float,
    seconds: float | None,
    layout: Path | None,
    real_time: bool,
) -> None:
    """Stream what the card reports to Foxglove, as it runs.

    Cycles run at --rate; each topic gets messages at --json-rate.
    Remotes that answer are started with their outputs at zero; nothing is switched on, and viewers cannot
    write. Prints `ready ws://HOST:PORT` when viewers can connect: in Foxglove "Open connection", "Foxglove
    WebSocket"; --layout writes what "Import from file" of its layouts takes. A card that another program
    drives is left alone (exit status 7).

    Only programs on this computer can look, unless --host says otherwise: then everybody who reaches that
    address can, without a password.

    \b
    Examples:
      hm2 live --seconds 1 --port 0
      hm2 --board udp://10.10.10.10 live --layout layout.json
    """
    package = _live()
    with session.board() as board:
        start_remotes(board)
        engine = board.engine(rate, real_time=real_time)
        with package.serve(engine, host=host, port=port, json_rate=json_rate) as view:
            if layout is not None:
                layout.write_bytes(view.layout)
            click.echo(f"ready {view.url}", err=session.as_json)
            click.echo(f"hm2: {_audience(host)} can look; nobody can write", err=True)
            with engine, until(board, seconds) as over:
                watch(board, engine, view, over)
        counters = view.counters
    document = {"url": view.url, "cycles": counters.records, "dropped": counters.dropped, "rate": rate}
    dropped = f", {counters.dropped} dropped" if counters.dropped else ""
    session.report(document, f"{view.url}: {counters.records} cycles{dropped}")


def _audience(host: str) -> str:
    try:
        only_here = ipaddress.ip_address(host).is_loopback
    except ValueError:
        only_here = host == "localhost"
    return "only programs on this computer" if only_here else f"everybody who reaches {host}"
