"""When the end of a DOIT is seen: in virtual time, beside the moment at which COMMAND cleared."""

from __future__ import annotations

import random
from dataclasses import dataclass
from statistics import mean, median
from typing import TYPE_CHECKING

import hostmot2
from hostmot2.bench.split import words_of
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.sserial_port import LineByte
from hostmot2.registers import Sserial, SslbpCommand

if TYPE_CHECKING:
    from hostmot2.bench.doit import Mix

STEP_US = 0.05
LEARNING = 100

TITLE = "the same in virtual time, us: exact, accesses take none"
COLUMNS = ("busy, min", "busy, max", "seen p50", "seen max", "looks", "line", "turnaround", "firmware")
NOTE = (
    "busy: how long COMMAND is not 0; seen: how long after it cleared the driver knows; looks: reads of "
    "COMMAND; line: the longest channel's characters; turnaround: of its remote; firmware: the rest of busy"
)


@dataclass(frozen=True, slots=True)
class Completions:
    """Of many DOITs, us: how long COMMAND was busy, how much later the driver knew, looks it took."""

    busy: list[float]
    seen: list[float]
    looks: float
    line: float
    turnaround: float

    @property
    def latest(self) -> float:
        """The longest that an end was not seen."""
        return max(self.seen)

    def cells(self) -> list[float | None]:
        """In the order of COLUMNS."""
        firmware = median(self.busy) - self.line - self.turnaround
        spread = [min(self.busy), max(self.busy), median(self.seen), self.latest]
        return [*spread, self.looks, self.line, self.turnaround, firmware]


def completions(mix: Mix, count: int, seed: int = 1) -> Completions:
    """Two cards alike: on one the driver exchanges, on the other COMMAND is looked at all the time.

    Both get the same commands at the same times, so they do the same; DOITs come at random times, because
    the firmware's loop makes their duration depend on when they come.
    """
    chance = random.Random(seed)
    card, twin = mix.emulated("virtual"), mix.emulated("virtual")
    busy, seen, reads = [], [], []
    with hostmot2.open(card) as board, hostmot2.open(twin) as other:
        for each in (board, other):
            mix.start(each)
        command = board.sserial.register_address(Sserial.command.number)
        for number in range(LEARNING + count):
            _advance_to(max(card.now_us, twin.now_us) + chance.uniform(1, 50), card, twin)
            began, before = card.now_us, board.counters["words_read"]
            card.sserial[0].take_line_bytes()
            board.sserial.doit(mix.mask)
            cleared = _watch(twin, command, SslbpCommand.DOIT | mix.mask) - began
            if number >= LEARNING:
                busy.append(cleared)
                seen.append(card.now_us - began - cleared)
                reads.append(board.counters["words_read"] - before)
        line, turnaround = _line(card.sserial[0].take_line_bytes())
        others = words_of(board.sserial[0], mix.mask)[0] - 1
    return Completions(busy, seen, mean(reads) - others, line, turnaround)


def _advance_to(at_us: float, *cards: EmulatedBoard) -> None:
    for card in cards:
        card.advance(at_us - card.now_us)


def _watch(card: EmulatedBoard, command: int, word: int) -> float:
    """When COMMAND, now written, clears: looked at in steps of STEP_US."""
    card.write(command, word)
    while card.read(command):
        card.advance(STEP_US)
    return card.now_us


def _line(heard: list[LineByte]) -> tuple[float, float]:
    """Of the channel that was heard last: its characters' time, and the gap between command and answer."""
    if not heard:
        return 0.0, 0.0
    last = max(heard, key=lambda byte: byte.start_us).channel
    out, back = ([b for b in heard if b.channel == last and b.to_remote is way] for way in (True, False))
    times = [part[-1].start_us + 10 * part[-1].bit_us - part[0].start_us for part in (out, back)]
    return sum(times), back[0].start_us - out[0].start_us - times[0]
