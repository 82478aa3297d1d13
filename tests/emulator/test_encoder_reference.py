"""Encoder counters against a plain reference that knows no shortcuts: it walks every ClockLow edge.

Rules: fact sheet registers.md 2.4, card observed 4 and 5. One register on each line, an integrator that
moves with each filter tick, the filtered level follows where the integrator stood before the tick, two
registers, then the count. Lines are drawn at random, also faster than the filter lets through.
"""

from __future__ import annotations

import random

import pytest

from hostmot2.emulator import CardDescription, EmulatedBoard
from hostmot2.emulator.cards import GPIO, ModuleWords, pin
from hostmot2.emulator.cards import card as known_card
from hostmot2.registers import Gtag

CARD = CardDescription(
    name="plain encoders",
    board_name="MESATEST",
    modules=(
        ModuleWords(Gtag.WATCHDOG, 0x0C00, 3),
        ModuleWords(Gtag.IOPORT, 0x1000, 5, instances=1, multiple=0x1F),
        ModuleWords(Gtag.ENCODER, 0x3000, 5, instances=1, version=2, multiple=3),
    ),
    pins=(*(pin(Gtag.ENCODER, number) for number in (1, 2, 3, 4)), *(GPIO,) * 13),
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


QUADRATURE = (0, 1, 3, 2)
PERIOD = 30_000  # picoseconds


class Motion:
    """What an encoder does: runs of equidistant edges, one after the other; times in picoseconds."""

    def __init__(self) -> None:
        self.runs = [(-1, 0, 1, 0)]  # start, position there, period, counts

    def run(self, now: int, period: int, counts: int) -> None:
        self.runs.append((now, self.at(now + 1), period, counts))

    def at(self, time: int) -> int:
        """The position just before `time`."""
        start, position, period, counts = next(
            run for run in reversed(self.runs) if run[0] < time or run[0] < 0
        )
        edges = min(max(0, (time - 1 - start) // period), abs(counts))
        return position + (edges if counts > 0 else -edges)

    def lines(self, time: int) -> int:
        position = self.at(time)
        return QUADRATURE[position % 4] | (4 if position % 10 < 3 else 0)


@pytest.mark.parametrize("seed", range(8))
def test_plain_encoder_sees_a_moving_encoder_at_each_edge(seed: int) -> None:
    rng = random.Random(seed)
    board = EmulatedBoard(CARD, clock="virtual")
    encoder = board.encoder_input(0)
    encoder.index_every(10, 3)
    board.write(0x3400, 0xFFF)
    board.write(0x3100, 0x18)
    reference, motion = Reference(3, 1), Motion()
    for _ in range(60):
        period, counts = rng.choice([45_000, 90_000, 100_001, 240_000, 1_000_000]), rng.randrange(-30, 30)
        encoder.run(period / 1000, counts)
        motion.run(board.clocks * PERIOD, period, counts)
        for _ in range(rng.choice([1, 10, 200])):
            edge = reference.clock + 1
            time = edge * PERIOD - PERIOD // 2
            reference.edge(motion.lines(time), edge >= 2, (edge - 1) // 2 & 0xFFFF)
        board.advance_clocks(reference.clock - board.clocks)
        assert board.read(0x3000) == reference.stamp << 16 | reference.count
        assert board.read(0x3100) >> 16 == reference.latch
        assert encoder.position == motion.at(reference.clock * PERIOD + 1)


class Multiplexer:
    """The select counter, its pin and the sampling of two encoders, an edge at a time (card observed 4)."""

    def __init__(self) -> None:
        self.rate, self.down, self.deskew, self.delay = 2, 0, 0, 5_000
        self.history = [0] * 64  # select counter behind the last edges, newest first
        self.sampled = 0
        self.demuxed = [0, 0]
        self.pins: list[int] = [0]  # Sel0 behind each edge

    def edge(self, clock: int, motions: list[Motion]) -> tuple[bool, list[int]]:
        """Returns whether the filters tick, and the lines the two counters register with this edge."""
        registered = list(self.demuxed)
        now, before = self.history[self.deskew + 1], self.sampled
        if now != before:
            phase = 0 if now else 1
            time = clock * PERIOD - PERIOD // 2 - self.delay
            pin_edge = (time - 1 + PERIOD // 2) // PERIOD
            select = self.pins[pin_edge] if pin_edge >= 0 else 0
            self.demuxed[phase] = motions[select].lines(time)
        self.sampled = now
        tick = self.down < 0
        counter = self.history[0] ^ tick
        self.pins.append(self.history[1])
        self.history = [counter, *self.history[:-1]]
        self.down = (-1 if self.rate & 0x800 else self.rate) if tick else self.down - 1
        return tick, registered


@pytest.mark.parametrize("seed", range(12))
def test_muxed_pair_follows_the_plain_reference(seed: int) -> None:
    rng = random.Random(seed)
    board = EmulatedBoard(known_card("5i25+7i77"), clock="virtual")
    encoders = [board.encoder_input(n) for n in (0, 1)]
    for encoder in encoders:
        encoder.index_every(10, 3)
    board.write(0x1200, 0x80)
    board.write(0x1100, 0x80)
    for n in (0, 4):
        board.write(0x3600 + n, 0x18)
    references, motions, mux = [Reference(3, 1), Reference(3, 1)], [Motion(), Motion()], Multiplexer()
    for _ in range(60):
        which = rng.randrange(2)
        period = rng.choice([120_000, 235_001, 240_000, 245_000, 500_000, 3_000_000])
        counts = rng.randrange(-60, 60)
        encoders[which].run(period / 1000, counts)
        motions[which].run(board.clocks * PERIOD, period, counts)
        if rng.random() < 0.2:
            mux.rate, mux.deskew = rng.choice([0, 1, 2, 6, 0xFFF]), rng.choice([0, 0, 1, 2, 7])
            board.write(0x3900, mux.deskew << 28 | mux.rate)
        if references[0].clock > 20 and rng.random() < 0.1:
            mux.delay = rng.choice([5_000, 20_000, 65_000, 130_000])
            board.mux_delay_ns = mux.delay / 1000
        for _ in range(rng.choice([1, 3, 10, 300])):
            edge = references[0].clock + 1
            tick, lines = mux.edge(edge, motions)
            for reference, registered in zip(references, lines, strict=True):
                reference.edge(registered, tick, (edge - 1) // 2 & 0xFFFF)
        board.advance_clocks(references[0].clock - board.clocks)
        for n, reference in enumerate(references):
            assert board.read(0x3500 + 4 * n) == reference.stamp << 16 | reference.count
            assert board.read(0x3600 + 4 * n) >> 16 == reference.latch
            assert board.read(0x3600 + 4 * n) >> 15 & 1 == reference.error
