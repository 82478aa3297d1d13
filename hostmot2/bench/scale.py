"""What a cycle costs with more channels, more cards and at higher rates, on emulated cards in memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from time import sleep

import hostmot2
from hostmot2.bench import host
from hostmot2.bench.lateness import SETTLE_SECONDS, WATCHDOG_SECONDS, run_engine
from hostmot2.bench.report import Curves, Report
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.catalog import remote
from hostmot2.engine import Engine
from hostmot2.histogram import Histogram

SECONDS = 1
RATE = 1000
CHANNELS = (1, 2, 3, 4, 6, 8)
CARDS = (1, 2, 3, 4)
RATES = (500, 1000, 2000, 4000, 8000)
NOTE = (
    "the cards are emulated in the engine's thread, which is most of a cycle: the longer since the last, the "
    "more; all engines share a processor"
)


def run(count: int | None = None) -> Report:
    """Seconds for each point: `count`, or 1."""
    seconds, report = float(count or SECONDS), Report("scale")
    report.notes.append(host.placement())
    report.notes.append(NOTE)
    try:
        channels = {n: _one(n, RATE, seconds) for n in CHANNELS}
        cards = {n: _several(n, seconds) for n in CARDS}
        rates = {rate: _one(2, rate, seconds) for rate in RATES}
    finally:
        host.unlock_memory()
    report.curves += [
        _curves(f"channels, {RATE} Hz", "channels exchanged", channels),
        _curves(f"cards, {RATE} Hz each", "cards, 7I77 each", cards),
        _curves("rate, a 7I77", "cycles per second", rates),
    ]
    return report


def _one(channels: int, rate: float, seconds: float) -> dict[str, Histogram]:
    with _engine(channels, rate) as engine:
        return run_engine(engine, seconds)


def _several(cards: int, seconds: float) -> dict[str, Histogram]:
    """Everything that all cards' engines saw."""
    with ExitStack() as stack:
        engines = [stack.enter_context(_engine(2, RATE)) for _ in range(cards)]
        for engine in engines:
            stack.enter_context(engine)
        sleep(SETTLE_SECONDS)
        for engine in engines:
            engine.reset_trace()
        sleep(seconds)
        whole = {name: Histogram() for name in ("wake", "cycle")}
        for trace in [engine.trace() for engine in engines]:
            for name, histogram in whole.items():
                histogram.merge(trace[name])
    return whole


@contextmanager
def _engine(channels: int, rate: float) -> Iterator[Engine]:
    """Of a card with so many channels started: those of a 7I77, then field I/O alone."""
    priority, cpu = host.engine_priority(), host.measuring()
    with EmulatedBoard("5i25+7i77", sserial_channels=8) as card, hostmot2.open(card) as board:
        for channel in range(2, channels):
            card.sserial[0].attach(channel, remote("7i77-io"))
        board.watchdog.timeout = WATCHDOG_SECONDS
        board.sserial.start((1 << channels) - 1).raise_for_failed()
        yield Engine(board, rate, dead_man=0, real_time=priority, cpu=cpu)


def _curves(title: str, what: str, found: Mapping[int, dict[str, Histogram]]) -> Curves:
    lines = {
        "cycle p50, without its lateness": [
            (trace["cycle"].percentile(50) - trace["wake"].percentile(50)) / 1000 for trace in found.values()
        ],
        "start late p99": [trace["wake"].percentile(99) / 1000 for trace in found.values()],
        "end p99, from when it was due": [trace["cycle"].percentile(99) / 1000 for trace in found.values()],
    }
    return Curves(f"cost with {title}", what, "us", list(found), lines)
