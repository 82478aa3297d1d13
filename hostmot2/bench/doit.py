"""DOIT: where an exchange's time goes, beside the least that the same channels can take."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import hostmot2
from hostmot2.bench import completion, split
from hostmot2.bench.report import Goal, Report, Section, Table
from hostmot2.bench.rounds import ROUNDS, Candidate, Timing, measure
from hostmot2.board import Board
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.catalog import remote
from hostmot2.histogram import Histogram

CYCLES = 1000
GOAL_NS = 500  # per channel, with no time on the wire
SEEN_US = 2.0

# card, channels to start
CARDS = (("5i25+7i77", 0x01), ("5i25+7i77", 0x03), ("5i25+7i77x2", 0x1B))


@dataclass(frozen=True, slots=True)
class Mix:
    """What hangs on an emulated card, and which of it is exchanged."""

    name: str
    mask: int
    card: str = "5i25+7i77"
    mode: int = 0  # of the 7I77's field I/O
    eight: bool = False

    def emulated(self, clock: str) -> EmulatedBoard:
        """The card, made anew."""
        channels = 8 if self.eight else None
        emulated = EmulatedBoard(self.card, clock=clock, sserial_channels=channels)  # type: ignore[arg-type]
        for channel in range(2, 8 if self.eight else 2):
            emulated.sserial[0].attach(channel, remote("7i77-io"))
        return emulated

    def start(self, board: Board) -> None:
        """Looks at all channels and starts those of the mix."""
        board.sserial.scan()
        if self.mode:
            board.sserial.channels[0].mode = self.mode
        board.sserial.start(self.mask).raise_for_failed()
        board.sserial.doit(self.mask)  # waits for the chatter


MIXES = (
    Mix("field I/O", 0x01),
    Mix("field I/O, mode 2", 0x01, mode=2),
    Mix("analog outputs", 0x02),
    Mix("7I77, both", 0x03),
    Mix("7I77, mode 2", 0x03, mode=2),
    Mix("two 7I77", 0x1B, "5i25+7i77x2"),
    Mix("8 channels", 0xFF, eight=True),
)


def run(count: int | None = None, url: str | None = None) -> Report:
    """Exchanges of each mix: `count`, or 1000. url: a card; all its remotes that answer are exchanged."""
    report = Report("doit")
    if url is not None:
        _on_card(report, url, count or CYCLES)
        return report
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
            why="of a call's 1.1 us the emulated firmware takes 45 %, the interpreter 35 %, the clock 6 %; "
            "two channels share what four share elsewhere",
        )
        for card, mask in CARDS
        if mask != 0x01  # a single channel bears the whole call
    ]
    _with_wire(report, count or CYCLES)
    report.notes.append(
        "emulated card and driver run in the same thread; the emulator's work is in the figures"
    )
    return report


def _name(card: str, mask: int, method: str = "doit") -> str:
    return f"{method}, {card.removeprefix('5i25+')}, {mask.bit_count()} channels"


def _without_wire(card: str, mask: int) -> dict[str, Timing]:
    with hostmot2.open(f"emu://{card}?wire=off") as board:
        board.sserial.scan()
        board.sserial.start(mask).raise_for_failed()
        port, channels = board.sserial, mask.bit_count()
        calls: dict[str, Callable[[int], object]] = {"doit": port.doit, "doit_pipelined": port.doit_pipelined}
        candidates = [Candidate(_name(card, mask, m), partial(c, mask), channels) for m, c in calls.items()]
        # one after the other: a DOIT of the pipeline that is under way would be the other's to wait for
        return {name: timing for each in candidates for name, timing in measure([each], ROUNDS).items()}


def _with_wire(report: Report, count: int) -> None:
    parts: dict[str, list[float | None]] = {}
    exact: dict[str, list[float | None]] = {}
    for mix in MIXES:
        with mix.emulated("real") as emulated, hostmot2.open(emulated) as board:
            mix.start(board)
            histogram, inside = _exchanges(board, mix.mask, count)
            report.histograms[mix.name] = histogram
            parts[mix.name] = split.parts(board, mix.mask, histogram, inside).cells()
        found = completion.completions(mix, min(count, 200))
        exact[mix.name] = found.cells()
        report.goals.append(
            Goal(f"{mix.name}: end of a DOIT seen, us after COMMAND cleared", found.latest, SEEN_US, False)
        )
    report.tables.append(Table(split.TITLE, split.COLUMNS, parts))
    report.tables.append(Table(completion.TITLE, completion.COLUMNS, exact))
    report.notes += [split.NOTE, completion.NOTE]


def _exchanges(board: Board, mask: int, count: int) -> tuple[Histogram, Histogram]:
    """Whole calls, and of each the time from DOIT's write to the look that saw its end."""
    whole, inside = Histogram(), Histogram()
    doit, now, port = board.sserial.doit, time.perf_counter_ns, board.sserial
    for _ in range(20):
        doit(mask)  # learns how long to wait
    for _ in range(count):
        start = now()
        doit(mask)
        whole.record(now() - start)
        inside.record(round(port.transfers["last_doit_us"] * 1000))
    return whole, inside


def _on_card(report: Report, url: str, count: int) -> None:
    with hostmot2.open(url) as board:
        mask = sum(1 << row.channel for row in board.sserial.scan() if row.found)
        if not mask:
            report.left_out.append(f"DOIT on {url}: no remote answers")
            return
        board.sserial.start(mask).raise_for_failed()
        histogram, inside = _exchanges(board, mask, count)
        name = f"{board.name}, channels 0x{mask:02X}"
        report.histograms[name] = histogram
        cells = split.parts(board, mask, histogram, inside).cells()
        report.tables.append(Table(split.TITLE, split.COLUMNS, {name: cells}))
        report.notes.append(split.NOTE)
