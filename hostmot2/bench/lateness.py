"""The engine's schedule beside a bare loop with the same policy, and beside an interpreter that computes."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median

import hostmot2
from hostmot2._core import lib
from hostmot2.bench import host
from hostmot2.bench.report import Goal, Report
from hostmot2.emulator import EmulatedBoard
from hostmot2.engine import Engine
from hostmot2.histogram import Histogram

RATE = 1000
BUSY_RATE = 4000
SETTLE_SECONDS = 0.1
WATCHDOG_SECONDS = 20.0
"""Rounds without an exchange and stalls are to be measured, not to be punished."""
AWAKE, ASLEEP = "awake 60 us before", "asleep until due"
EARLY = {AWAKE: 60e-6, ASLEEP: 0.0}

WAKE_LIMIT, AWAKE_US, BUSY_LIMIT = 1.2, 1.0, 1.2
WHY = "both tails are the machine's: what else it runs, and where; a round in which it stalls decides"


def wake(report: Report, rounds: int, seconds: float = 1.0) -> None:
    """Engine and bare loop in turns, each woken early and not."""
    found: dict[str, list[Histogram]] = {}
    with _started() as board:
        engines = {name: _engine(board, RATE, early) for name, early in EARLY.items()}
        for _ in range(rounds):
            for name, early in EARLY.items():
                found.setdefault(f"bare loop, {name}", []).append(bare(RATE, early, seconds))
                wakes = run_engine(engines[name], seconds)["wake"]
                found.setdefault(f"engine, {name}", []).append(wakes)
    report.histograms |= {f"start late: {name}": _merged(each) for name, each in found.items()}
    for name in EARLY:
        ratio = _ratio(found[f"engine, {name}"], found[f"bare loop, {ASLEEP}"], 99)
        text = f"start lateness p99, {name}, times a bare clock_nanosleep loop's"
        report.goals.append(Goal(text, ratio, WAKE_LIMIT, at_least=False, why=WHY))
    p50 = _merged(found[f"engine, {AWAKE}"]).percentile(50) / 1000
    report.goals.append(Goal(f"start lateness p50, us, {AWAKE}", p50, AWAKE_US, at_least=False))


def busy(report: Report, rounds: int, seconds: float = 1.0) -> None:
    """Whole cycles while the interpreter sleeps and while it computes."""
    idle, computing = [], []
    with _started() as board:
        engine = _engine(board, BUSY_RATE)
        for _ in range(rounds):
            idle.append(run_engine(engine, seconds)["cycle"])
            with _interpreter_computes():
                computing.append(run_engine(engine, seconds)["cycle"])
    report.histograms["cycle, Python idle"] = _merged(idle)
    report.histograms["cycle, Python computing"] = _merged(computing)
    ratio = _ratio(computing, idle, 99.9)
    text = f"cycle p99.9 at {BUSY_RATE} Hz with a computing Python thread, times that without"
    report.goals.append(Goal(text, ratio, BUSY_LIMIT, at_least=False, why=WHY))


def bare(rate: float, early: float, seconds: float) -> Histogram:
    """Lateness of clock_nanosleep and nothing else, in a thread scheduled as the engine's."""
    histogram = Histogram()

    def loop() -> None:
        host.pin(host.measuring(), host.engine_priority())
        lib.hm2_floor_wake(round(1e9 / rate), round(early * 1e9), round(seconds * rate), histogram.core)

    thread = threading.Thread(target=loop)
    thread.start()
    thread.join()
    return histogram


def run_engine(engine: Engine, seconds: float) -> dict[str, Histogram]:
    """The trace of so many seconds, without the first moments."""
    with engine:
        time.sleep(SETTLE_SECONDS)
        engine.reset_trace()
        time.sleep(seconds)
        return engine.trace()


@contextmanager
def _started() -> Iterator[hostmot2.Board]:
    with hostmot2.open(EmulatedBoard("5i25+7i77")) as board:
        board.watchdog.timeout = WATCHDOG_SECONDS
        board.card("7i77").start()
        yield board


def _engine(board: hostmot2.Board, rate: float, early: float = 60e-6) -> Engine:
    return Engine(
        board, rate, early=early, dead_man=0, real_time=host.engine_priority(), cpu=host.measuring()
    )


@contextmanager
def _interpreter_computes() -> Iterator[None]:
    """A thread of Python that never waits, on another processor than the engine if there is one."""
    over = threading.Event()

    def compute() -> None:
        host.pin(host.other(), 0)
        number = 0
        while not over.is_set():
            number = (number * 1103515245 + 12345) % (1 << 31)

    thread = threading.Thread(target=compute)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _merged(histograms: list[Histogram]) -> Histogram:
    whole = Histogram()
    for each in histograms:
        whole.merge(each)
    return whole


def _ratio(ours: list[Histogram], theirs: list[Histogram], percent: float) -> float:
    """Median over the rounds."""
    pairs = zip(ours, theirs, strict=True)
    return median(max(a.percentile(percent), 1) / max(b.percentile(percent), 1) for a, b in pairs)
