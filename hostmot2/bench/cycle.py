"""The cycle engine: how late it starts, what a busy interpreter and recording cost it, words it moves."""

from __future__ import annotations

import hostmot2
from hostmot2.bench import host, lateness, recorded
from hostmot2.bench.report import Goal, Report
from hostmot2.emulator import EmulatedBoard
from hostmot2.engine.options import Style

ROUNDS = 6
TAIL_ROUNDS = 18
"""Where tails are compared: a second has few cycles in its tail."""
SERVER_US = 2000
READS, WRITES = 7, 5


def run(count: int | None = None) -> Report:
    """Rounds of a second per candidate: `count`, or 6, and 18 where tails are compared.

    The recording with a stalled disk runs for a minute, with a count for as many seconds, at least 6.
    """
    rounds = count or ROUNDS
    report = Report("cycle")
    report.notes.append(host.placement())
    try:
        lateness.wake(report, count or TAIL_ROUNDS)
        lateness.busy(report, count or TAIL_ROUNDS)
        recorded.cost(report, rounds)
        recorded.pushes(report)
        recorded.stalled_disk(report, recorded.stalled_seconds(count))
    finally:
        host.unlock_memory()
    for style in ("pipelined", "read-modify-write"):
        _words(report, style)
    return report


def _words(report: Report, style: Style) -> None:
    """Registers of a 7I77's smart serial in a cycle: with it less without it, counted by the driver."""
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        card = board.card("7i77")
        card.mode = 2  # inputs, analog inputs, field voltage: the most registers
        card.start()
        with_it = _moved(board.engine(style=style), board)
        card.stop()
        without = _moved(board.engine(style=style), board)
    reads, writes = (a - b for a, b in zip(with_it, without, strict=True))
    text = f"registers {{}} for a 7I77's smart serial in a cycle, {style}"
    report.goals.append(Goal(text.format("read"), reads, READS, at_least=False))
    report.goals.append(Goal(text.format("written"), writes, WRITES, at_least=False))


def _moved(engine: hostmot2.engine.Engine, board: hostmot2.Board) -> tuple[float, float]:
    """Words read and written in one of ten cycles."""
    with engine:
        for _ in range(5):
            engine.step()
        before = board.counters
        for _ in range(10):
            engine.step()
        after = board.counters
    return tuple((after[key] - before[key]) / 10 for key in ("words_read", "words_written"))  # type: ignore
