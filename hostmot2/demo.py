"""make demo: a card found, described, started, cycled and timed, with nothing plugged in.

python -m hostmot2.demo [--board URL] [--count N] [-o PICTURE.png]
"""

from __future__ import annotations

import gc
import time
from pathlib import Path

import click

import hostmot2
from hostmot2.board import Board
from hostmot2.default import EMULATED
from hostmot2.histogram import Histogram

COUNT = 10_000
PICTURE = Path("demo_latency.png")
NAMES = ("min", "p50", "p99", "p99.9", "max")
PERCENTILES = (0.0, 50.0, 99.0, 99.9, 100.0)


@click.command()
@click.option("--board", "url", default=EMULATED, show_default=True, metavar="URL", help="Which card.")
@click.option("--count", type=click.IntRange(1), default=COUNT, show_default=True, help="Cycles to run.")
@click.option("-o", "picture", type=click.Path(path_type=Path), default=PICTURE, show_default=True)
def demo(url: str, count: int, picture: Path) -> None:
    """Find the remotes of a card, start them, run cycles and show how long these took."""
    measured: dict[str, Histogram] = {}
    with hostmot2.open(url) as board:
        show_card(board)
        measured["with the wire"] = run(board, count, show=True)
    if url == EMULATED:  # the same without the bytes' time on the line, to see what the driver itself takes
        with hostmot2.open(f"{url}?wire=off") as board:
            measured["driver alone"] = run(board, count, show=False)
    show_latency(measured, count)
    if draw(measured, picture):
        click.echo(f"histogram: {picture}")


def show_card(board: Board) -> None:
    """The IDROM in words."""
    idrom = board.idrom
    click.echo(f"{board.name} at {board.url}: {idrom.config_name}, IDROM type {idrom.type}")
    click.echo(
        f"  {idrom.io_width} pins on {idrom.io_ports} ports, ClockLow {idrom.clock_low / 1e6:g} MHz, "
        f"ClockHigh {idrom.clock_high / 1e6:g} MHz"
    )
    for module in board.modules:
        click.echo(
            f"  {module.instances:3} x {module.name} (version {module.version}) at 0x{module.base:04X}"
        )


def run(board: Board, count: int, *, show: bool) -> Histogram:
    """Scan, start everything that answers, and time `count` DOITs. The remotes' outputs stay zero."""
    port = board.sserial
    found = port.scan()
    if show:
        click.echo(f"\nsmart serial, SSLBP {port.revision}:\n{found}")
    mask = sum(1 << row.channel for row in found if row.found)
    if not mask:
        raise click.ClickException("no remote answers, so there is nothing to time")
    port.start(mask).raise_for_failed()
    port.doit(mask)  # the first one waits for an exchange that is under way
    histogram = Histogram()
    failed = 0
    gc.collect()
    gc.disable()
    try:
        for _ in range(count):
            begin = time.perf_counter_ns()
            failed += bool(port.doit(mask).failed)
            histogram.record(time.perf_counter_ns() - begin)
    finally:
        gc.enable()
    if show:
        click.echo(f"\nafter {count} cycles, {failed} of them failed:\n{port!r}")
    return histogram


def show_latency(measured: dict[str, Histogram], count: int) -> None:
    """The table of latencies."""
    click.echo(f"\none DOIT cycle, {count} times (us):\n")
    click.echo(f"{'':<16}" + "".join(f"{name:>10}" for name in NAMES))
    for title, histogram in measured.items():
        cells = (f"{histogram.percentile(percent) / 1000:10.2f}" for percent in PERCENTILES)
        click.echo(f"{title:<16}" + "".join(cells))
    click.echo("")


def draw(measured: dict[str, Histogram], picture: Path) -> bool:
    """Writes the histogram; without matplotlib says so and writes nothing."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        click.echo('no picture: matplotlib is not installed (pip install "hostmot2[plot]")', err=True)
        return False
    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.add_subplot(xlabel="one DOIT cycle / us", ylabel="cycles", xscale="log", yscale="log")
    for title, histogram in measured.items():
        start, width, count = histogram.buckets()
        axes.bar(start / 1000, count, width=width / 1000, align="edge", label=title, alpha=0.7)
    axes.legend()
    axes.set_title("Latency of smart serial cycles")
    figure.savefig(picture, dpi=120)
    return True


if __name__ == "__main__":
    demo(prog_name="python -m hostmot2.demo")
