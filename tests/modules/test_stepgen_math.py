"""Step generators against a plain model of the 48-bit accumulator: position, limits, tracking."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hostmot2._core import ffi, lib

CLOCK = 33333333
PERIOD_NS = 1_000_000


class Chip:
    """The accumulator as the register sheet (2.7) tells it: acc48 += sext(rate) per clock."""

    def __init__(self, start: int = 0) -> None:
        self.acc = start << 16

    def run(self, rate: int, clocks: int) -> None:
        signed = rate - (1 << 32) if rate >> 31 else rate
        self.acc = (self.acc + signed * clocks) & 0xFFFFFFFFFFFF

    @property
    def register(self) -> int:
        return self.acc >> 16


def new_stepgen(**settings: float) -> Any:
    stepgen = ffi.new("hm2_stepgen *")
    stepgen.scale, stepgen.clock_hz = 100.0, CLOCK
    stepgen.max_velocity, stepgen.max_step_rate, stepgen.enable = math.inf, 1e6, 1
    for name, value in settings.items():
        setattr(stepgen, name, value)
    return stepgen


def cycle(stepgen: Any, chip: Chip, number: int) -> None:
    chip.run(stepgen.rate, CLOCK // 1000)
    lib.hm2_stepgen_update(stepgen, chip.register, number * PERIOD_NS)


@given(st.lists(st.integers(-(2**31) + 1, 2**31 - 1), max_size=30), st.integers(0, 2**32 - 1))
def test_position_is_extended_to_64_bits_without_drift_at_the_wrap(moves: list[int], start: int) -> None:
    stepgen = new_stepgen()
    acc = start
    lib.hm2_stepgen_update(stepgen, acc, 0)
    for number, move in enumerate(moves, 1):
        acc = (acc + move) & 0xFFFFFFFF
        lib.hm2_stepgen_update(stepgen, acc, number * PERIOD_NS)
        assert stepgen.subcounts == sum(moves[:number])


@pytest.mark.parametrize("velocity", [0.001, 1.0, 333.3, -50.0])
def test_the_rate_word_is_steps_per_second_in_the_clocks_fractions(velocity: float) -> None:
    stepgen = new_stepgen(velocity_command=velocity)
    for number in range(3):
        lib.hm2_stepgen_update(stepgen, 0, number * PERIOD_NS)
    signed = stepgen.rate - (1 << 32) if stepgen.rate >> 31 else stepgen.rate
    assert signed == round(velocity * 100 * 2**32 / CLOCK)


def test_off_is_rate_zero_at_once() -> None:
    stepgen, chip = new_stepgen(velocity_command=500.0), Chip()
    for number in range(5):
        cycle(stepgen, chip, number)
    assert stepgen.rate != 0
    stepgen.enable = 0
    cycle(stepgen, chip, 6)
    assert stepgen.rate == 0
    assert stepgen.velocity == 0.0


def test_not_a_number_stands_still() -> None:
    stepgen, chip = new_stepgen(velocity_command=math.nan), Chip()
    for number in range(3):
        cycle(stepgen, chip, number)
    assert stepgen.rate == 0


@pytest.mark.parametrize(("limit", "reached"), [(math.inf, 10_000.0), (30.0, 30.0)])
def test_velocity_is_limited_by_setting_and_by_pulse_times(limit: float, reached: float) -> None:
    stepgen, chip = new_stepgen(velocity_command=1e9, max_velocity=limit), Chip()
    for number in range(3):
        cycle(stepgen, chip, number)
    assert stepgen.velocity == pytest.approx(reached)


@pytest.mark.parametrize(("name", "value"), [("scale", -1000.0), ("max_step_rate", 2e5)])
def test_no_step_is_faster_than_the_pulse_times_allow_whatever_is_changed_on_the_way(
    name: str, value: float
) -> None:
    """Braking gently from where it is would lose steps, and the accumulator counts them all the same."""
    stepgen, chip = new_stepgen(velocity_command=9000.0), Chip()
    for number in range(3):
        cycle(stepgen, chip, number)
    stepgen.max_acceleration = 10.0
    setattr(stepgen, name, value)
    cycle(stepgen, chip, 3)
    signed = stepgen.rate - (1 << 32) if stepgen.rate >> 31 else stepgen.rate
    assert abs(signed) * CLOCK / 2**32 == pytest.approx(stepgen.max_step_rate)
    assert stepgen.velocity == pytest.approx(stepgen.max_step_rate / abs(stepgen.scale))


def test_acceleration_is_limited_in_velocity_control() -> None:
    stepgen, chip = new_stepgen(velocity_command=100.0, max_acceleration=1000.0), Chip()
    seen = []
    for number in range(200):
        cycle(stepgen, chip, number)
        seen.append(stepgen.velocity)
    steps = [b - a for a, b in itertools.pairwise(seen)]
    assert max(steps) == pytest.approx(1.0)
    assert seen[-1] == pytest.approx(100.0)


@pytest.mark.parametrize("target", [0.5, 12.0, -100.0])
def test_position_control_arrives_without_overshoot_worth_a_step(target: float) -> None:
    stepgen, chip = (
        new_stepgen(position_control=1, max_velocity=50.0, max_acceleration=400.0),
        Chip(0x7FFF0000),
    )
    cycle(stepgen, chip, 0)
    stepgen.position_command = target
    furthest = 0.0
    velocities = []
    for number in range(1, 4000):
        cycle(stepgen, chip, number)
        furthest = max(furthest, abs(stepgen.position))
        velocities.append(stepgen.velocity)
    steps = [abs(b - a) for a, b in itertools.pairwise(velocities)]
    assert stepgen.position == pytest.approx(target, abs=0.01)
    assert furthest <= abs(target) + 0.02
    assert max(map(abs, velocities)) <= 50.0 + 1e-9
    assert max(steps) <= 0.4 + 1e-9


def test_position_control_follows_a_moving_command_closely() -> None:
    stepgen, chip = new_stepgen(position_control=1, max_acceleration=5000.0), Chip()
    for number in range(3000):
        seconds = number * 1e-3
        stepgen.position_command = 3.0 * math.sin(2 * math.pi * seconds)
        cycle(stepgen, chip, number)
        if number > 500:
            assert abs(stepgen.position - stepgen.position_command) < 0.05
