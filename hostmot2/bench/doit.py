"""DOIT from Python on the emulated card: what the driver takes, and a whole cycle with the bytes' time."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import hostmot2
from hostmot2.bench.report import Goal, Report, Section
from hostmot2.bench.rounds import ROUNDS, Candidate, Timing, measure
from hostmot2.board import Board
from hostmot2.histogram import Histogram

CYCLES = 2000
GOAL_NS = 500  # per channel, with no time on the wire

# card, channels to start
CARDS = (("5i25+7i77", 0x01), ("5i25+7i77", 0x03), ("5i25+7i77x2", 0x1B))


def run(count: int | None = None) -> Report:
    """Cycles with the wire: `count`, or 2000."""
    report = Report("doit")
    timings: dict[str, Timing] = {}
    for card, mask in CARDS:
        timings |= _without_wire(card, mask)
    title = "one call without time on the wire, ns per channel"
    report.sections.append(Section(title, timings, _name(*CARDS[-1])))
    report.goals += [
        Goal(
            f"DOIT, {_name(card, mask)}, ns per channel",
            timings[_name(card, mask)].ns,
            GOAL_NS,
            at_least=False,
        )
        for card, mask in CARDS
        if mask != 0x01  # a single channel bears the whole call
    ]
    report.histograms["cycle of a 7I77, its two channels, real time"] = _with_wire(count or CYCLES)
    report.notes.append(
        "emulated card and driver run in the same thread; the emulator's work is in the figures"
    )
    return report


def _name(card: str, mask: int, method: str = "doit") -> str:
    return f"{method}, {card.removeprefix('5i25+')}, {mask.bit_count()} channels"


def _started(board: Board, mask: int) -> None:
    board.sserial.scan()
    result = board.sserial.start(mask)
    if result.failed:
        raise RuntimeError(f"emulated remotes did not start: {result}")


def _without_wire(card: str, mask: int) -> dict[str, Timing]:
    with hostmot2.open(f"emu://{card}?wire=off") as board:
        _started(board, mask)
        port, channels = board.sserial, mask.bit_count()
        calls: dict[str, Callable[[int], object]] = {"doit": port.doit, "doit_pipelined": port.doit_pipelined}
        candidates = [Candidate(_name(card, mask, m), partial(c, mask), channels) for m, c in calls.items()]
        # one after the other: a DOIT of the pipeline that is under way would be the other's to wait for
        return {name: timing for each in candidates for name, timing in measure([each], ROUNDS).items()}


def _with_wire(count: int) -> Histogram:
    histogram = Histogram()
    with hostmot2.open("emu://5i25+7i77") as board:
        _started(board, 0x03)
        doit, record, now = board.sserial.doit, histogram.record, time.perf_counter_ns
        doit(0x03)  # waits for the chatter
        for _ in range(count):
            start = now()
            doit(0x03)
            record(now() - start)
    return histogram
