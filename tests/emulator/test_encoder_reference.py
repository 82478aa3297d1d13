"""Encoder counters against a plain reference that knows no shortcuts: it walks every ClockLow edge.

Rules: fact sheet registers.md 2.4, card observed 4 and 5. One register on each line, an integrator that
moves with each filter tick, the filtered level follows where the integrator stood before the tick, two
registers, then the count. Lines are drawn at random, also faster than the filter lets through.
"""

from __future__ import annotations

import random

import pytest

from hostmot2.emulator import CardDescription, EmulatedBoard
from hostmot2.emulator.cards import GPIO, IOPORT, QCOUNT, WATCHDOG, ModuleWords, pin

CARD = CardDescription(
    name="plain encoders",
    board_name="MESATEST",
    modules=(
        ModuleWords(WATCHDOG, 0x0C00, 3),
        ModuleWords(IOPORT, 0x1000, 5, instances=1, multiple=0x1F),
        ModuleWords(QCOUNT, 0x3000, 5, instances=1, version=2, multiple=3),
    ),
    pins=(*(pin(QCOUNT, number) for number in (1, 2, 3, 4)), *(GPIO,) * 13),
)
UP = {(0, 1), (1, 3), (3, 2), (2, 0)}  # A is bit 0, B bit 1


class Reference:
    """One counter, an edge at a time."""

    def __init__(self, limit: int, index_polarity: int) -> None:
        self.limit, self.index_polarity = limit, index_polarity
        self.registered = self.filtered = self.one = self.two = 0
        self.integrators = [0, 0, 0]
        self.count = self.latch = self.error = self.clock = 0
        self.stamp = 0

    def edge(self, lines: int, tick: bool, stamp: int) -> None:
        self.clock += 1
        old, new = self.two & 3, self.one & 3
        if self.one & 4 and not self.two & 4:
            self.latch = self.count
        if old ^ new == 3:
            self.error = 1
        elif old != new:
            self.count = self.count + (1 if (old, new) in UP else -1) & 0xFFFF
            self.stamp = stamp
        self.two, self.one = self.one, self.filtered
        if tick:
            seen = self.registered if self.index_polarity else self.registered ^ 4
            for bit in range(3):
                level = self.integrators[bit]
                if level == self.limit:
                    self.filtered |= 1 << bit
                elif level == 0:
                    self.filtered &= ~(1 << bit)
                wanted = level + (1 if seen >> bit & 1 else -1)
                self.integrators[bit] = min(max(wanted, 0), self.limit)
        self.registered = lines


@pytest.mark.parametrize("seed", range(12))
def test_counter_follows_the_plain_reference(seed: int) -> None:
    rng = random.Random(seed)
    limit, polarity, rate = rng.choice([3, 15]), rng.randrange(2), rng.choice([0, 1, 0xFFF])
    board = EmulatedBoard(CARD, clock="virtual", strict=True)
    for number in range(3):
        board.pin(number).drive(0)
    board.write(0x3400, rate)
    reference = Reference(limit, polarity)
    period = 1 if rate == 0xFFF else rate + 2
    control = 0x10 | (0x800 if limit == 15 else 0) | polarity << 3
    board.write(0x3100, control)
    lines = 0
    for _ in range(400):
        if rng.random() < 0.8:
            lines ^= 1 << rng.randrange(3)
        for number in range(3):
            board.pin(number).drive(lines >> number & 1)
        for _ in range(rng.choice([1, 2, 3, 5, limit * period, 3 * limit * period])):
            edge = reference.clock + 1
            tick = edge >= 2 and (edge - 2) % period == 0
            reference.edge(lines, tick, (edge - 1) // 2 & 0xFFFF)
        board.advance_clocks(reference.clock - board.clocks)
        assert board.read(0x3000) == reference.stamp << 16 | reference.count
        control_read = board.read(0x3100)
        assert control_read == reference.latch << 16 | reference.error << 15 | control | (reference.one & 7)
    assert reference.error or limit == 15 or reference.count
