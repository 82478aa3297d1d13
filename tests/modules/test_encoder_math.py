"""Counts, index and velocity against a plain model of the counter chip, with losses anywhere."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hostmot2._core import ffi, lib

LATCH_ON_INDEX, JUST_ONCE, QUAD_ERROR = 1 << 4, 1 << 6, 1 << 15
TICK = 16 / 33333333  # TSDiv 14 at 33.33 MHz


@dataclass
class Chip:
    """Count, timestamp, CCR of one encoder as the register sheet (2.4) tells it."""

    count: int = 0
    stamp: int = 0
    control: int = 0
    latch: int = 0
    index_at: set[int] = field(default_factory=set)

    def move_to(self, count: int, ticks: int) -> None:
        step = 1 if count > self.count else -1
        while self.count != count:
            self.count += step
            self.stamp = ticks
            if self.count in self.index_at and self.control & LATCH_ON_INDEX:
                self.latch = self.count
                if self.control & JUST_ONCE:
                    self.control &= ~LATCH_ON_INDEX

    def count_register(self) -> int:
        return (self.stamp & 0xFFFF) << 16 | self.count & 0xFFFF

    def control_register(self) -> int:
        return (self.latch & 0xFFFF) << 16 | self.control


def new_encoder(scale: float = 1.0) -> tuple[Any, Any]:
    encoder = ffi.new("hm2_encoder *")
    encoder.scale = scale
    encoder.velocity_timeout = 0.5
    encoder.settings = 1 << 11
    encoder.readable = 0xCFFF
    timebase = ffi.new("hm2_timebase *")
    timebase.seconds_per_tick = TICK
    return encoder, timebase


def read(encoder: Any, timebase: Any, chip: Chip, seconds: float) -> None:
    lib.hm2_timebase_update(timebase, int(seconds / TICK) & 0xFFFF, int(seconds * 1e9))
    lib.hm2_encoder_update(encoder, timebase, chip.count_register(), chip.control_register())


def write(encoder: Any, chip: Chip, *, lost: bool = False) -> None:
    """What the cycle does: a control word is sent once for each reply that asked for it."""
    if encoder.write_control and not lost:
        chip.control = encoder.control_word & 0x7FFF
    encoder.write_control = 0


@given(st.lists(st.integers(-32767, 32767), max_size=60), st.integers(0, 0xFFFF))
def test_counts_are_extended_to_64_bits_whatever_the_moves(moves: list[int], start: int) -> None:
    encoder, timebase = new_encoder()
    chip = Chip(count=start)
    read(encoder, timebase, chip, 0.0)
    assert encoder.raw_count - encoder.zero == 0
    for number, move in enumerate(moves):
        chip.count += move
        read(encoder, timebase, chip, 0.001 * (number + 1))
        assert encoder.raw_count - encoder.zero == sum(moves[: number + 1])


def test_the_error_flag_of_open_inputs_at_power_up_is_cleared_and_not_reported() -> None:
    encoder, timebase = new_encoder()
    chip = Chip(control=QUAD_ERROR | 3)
    read(encoder, timebase, chip, 0.0)
    assert encoder.quad_error == 0
    assert encoder.write_control == 1
    assert encoder.control_word & QUAD_ERROR == 0
    write(encoder, chip)
    chip.control |= QUAD_ERROR
    read(encoder, timebase, chip, 0.001)
    assert encoder.quad_error == 1


@settings(max_examples=300)
@given(
    st.lists(st.tuples(st.integers(-300, 300), st.booleans(), st.booleans()), min_size=5, max_size=200),
    st.integers(3, 60),
)
def test_index_is_never_invented_and_never_wrong_whichever_replies_and_writes_are_lost(
    cycles: list[tuple[int, bool, bool]], arm_at: int
) -> None:
    encoder, timebase = new_encoder()
    chip = Chip(count=20000, index_at=set(range(-100000, 140000, 1000)))
    first_armed_index: int | None = None
    for number, (move, reply_lost, write_lost) in enumerate(cycles):
        if number == arm_at:
            encoder.request = lib.HM2_ENCODER_INDEX
        was_armed = bool(chip.control & LATCH_ON_INDEX)
        chip.move_to(chip.count + move, number * 2000)
        if was_armed and not chip.control & LATCH_ON_INDEX and first_armed_index is None:
            first_armed_index = chip.latch
        if not reply_lost:
            read(encoder, timebase, chip, 0.001 * number)
        write(encoder, chip, lost=write_lost)
        if encoder.events:
            assert encoder.events == 1
            assert encoder.latched == first_armed_index
            assert encoder.zero == encoder.latched


def test_index_comes_through_once_replies_and_writes_arrive_again() -> None:
    encoder, timebase = new_encoder()
    chip = Chip(index_at={1000})
    read(encoder, timebase, chip, 0.0)
    write(encoder, chip)
    read(encoder, timebase, chip, 0.001)
    encoder.request = lib.HM2_ENCODER_INDEX
    for number in range(2, 6):  # every write lost
        read(encoder, timebase, chip, 0.001 * number)
        assert encoder.write_control == 1
    assert encoder.events == 0
    write(encoder, chip)
    chip.move_to(1500, 12000)  # passes the index; three replies lost
    read(encoder, timebase, chip, 0.010)
    assert encoder.events == 1
    assert (encoder.latched, encoder.zero, encoder.request) == (1000, 1000, lib.HM2_ENCODER_NONE)
    assert encoder.position == 500.0
    write(encoder, chip)
    assert chip.control & (LATCH_ON_INDEX | JUST_ONCE) == 0


@pytest.mark.parametrize("rate", [0.1, 1, 7.3, 50, 999, 12345, 300_000, 2_000_000])
@pytest.mark.parametrize("sign", [1, -1])
def test_velocity_follows_a_steady_rate(rate: float, sign: int) -> None:
    """Below one count per timeout the velocity is 0 between counts; else within one tick and 0.1 %."""
    encoder, timebase = new_encoder(scale=4.0)
    encoder.velocity_timeout = 25.0
    period = 0.001
    seen: list[float] = []
    chip = Chip()
    for cycle in range(int(max(200, 3.2 / rate / period))):
        now = cycle * period
        counts = math.floor(now * rate)
        chip.count = sign * counts
        if counts:
            chip.stamp = int(counts / rate / TICK)
        read(encoder, timebase, chip, now)
        seen.append(encoder.velocity)
    settled = seen[len(seen) * 3 // 4 :]
    assert settled[-1] * 4.0 * sign == pytest.approx(
        rate, rel=max(0.002, 2 * TICK * rate / max(1.0, rate * period))
    )
    assert all(abs(v * 4.0) <= rate * 1.01 for v in settled)


def test_velocity_falls_as_one_count_over_the_waiting_time_and_ends_at_zero() -> None:
    encoder, timebase = new_encoder()
    chip = Chip()
    for cycle in range(20):
        chip.count, chip.stamp = cycle, int(cycle * 0.001 / TICK)
        read(encoder, timebase, chip, cycle * 0.001)
    assert encoder.velocity == pytest.approx(1000, rel=0.001)
    for waited in (0.002, 0.01, 0.1, 0.4):
        read(encoder, timebase, chip, 0.019 + waited)
        assert encoder.velocity == pytest.approx(1 / waited, rel=0.001)
    read(encoder, timebase, chip, 0.019 + 0.501)
    assert encoder.velocity == 0.0


def test_a_resting_axis_that_dithers_on_an_edge_has_no_velocity() -> None:
    encoder, timebase = new_encoder()
    chip = Chip()
    for cycle in range(10):
        chip.count, chip.stamp = cycle % 2, int(cycle * 0.001 / TICK)
        read(encoder, timebase, chip, cycle * 0.001)
        if cycle > 2:
            assert encoder.velocity == 0.0


def test_a_pause_of_many_timestamp_wraps_is_measured_with_the_host_clock() -> None:
    encoder, timebase = new_encoder()
    encoder.velocity_timeout = 100.0
    chip = Chip()
    read(encoder, timebase, chip, 0.0)
    for second in (1.0, 3.0):
        chip.count, chip.stamp = chip.count + 1, int(second / TICK)
        read(encoder, timebase, chip, second + 0.0005)  # two seconds are 61 wraps
    assert encoder.velocity == pytest.approx(0.5, rel=1e-4)
