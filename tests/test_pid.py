"""The built-in PID, update by update, against what its settings say in words and in numbers."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hostmot2._core import ffi, lib

SECONDS = 0.001
NAN = math.nan


def make(**settings: float) -> Any:
    return ffi.new("hm2_pid *", settings)


def update(pid: Any, command: float, feedback: float, velocities: tuple[float, float] = (NAN, NAN)) -> float:
    return float(lib.hm2_pid_update(pid, command, velocities[0], feedback, velocities[1], SECONDS))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_axis_held_at_the_limit_does_not_run_past_its_place_when_it_is_let_go(sign: float) -> None:
    pid = make(p=1.0, i=10.0, max_output=5.0)
    for _ in range(1000):  # a second against a stop: 100 of integral if it went on
        assert update(pid, sign * 10.0, 0.0) == sign * 5.0
    assert abs(pid.integral) <= 10.0 * 10.0 * SECONDS  # at most the update in which the limit was met
    assert abs(update(pid, sign * 10.0, sign * 10.0)) <= 0.1


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_at_the_limit_the_integral_still_goes_down(sign: float) -> None:
    pid = make(p=0.0, i=1.0, max_output=5.0, bias=sign * 6.0)
    assert update(pid, 0.0, 0.0) == sign * 5.0
    before = pid.integral
    for _ in range(10):
        update(pid, -sign, 0.0)
    assert pid.integral - before == pytest.approx(-sign * 10 * SECONDS)


def test_the_integral_is_the_sum_of_the_errors_up_to_its_own_limit() -> None:
    pid = make(i=2.0, max_integral=0.5)
    for count in range(1, 400):
        assert update(pid, 1.0, 0.0) == pytest.approx(min(0.5, 2.0 * SECONDS * count))
    for count in range(1, 100):
        assert update(pid, -1.0, 0.0) == pytest.approx(0.5 - 2.0 * SECONDS * count)


def test_each_gain_has_its_own_share_of_the_output() -> None:
    gains = {"p": 2.0, "d": 3.0, "ff0": 5.0, "ff1": 7.0, "ff2": 11.0, "bias": 13.0}
    command, feedback, velocities = 4.0, 1.5, (0.25, -0.5)
    shares = {
        "p": 2.0 * (4.0 - 1.5),
        "d": 3.0 * (0.25 - -0.5),
        "ff0": 5.0 * 4.0,
        "ff1": 7.0 * 0.25,
        "ff2": 11.0 * (0.25 - 0.0) / SECONDS,
        "bias": 13.0,
    }
    for chosen in [[name] for name in gains] + [list(gains)]:
        pid = make(**{name: gains[name] for name in chosen})
        update(pid, 0.0, 0.0, (0.0, 0.0))
        out = update(pid, command, feedback, velocities)
        assert out == pytest.approx(sum(shares[name] for name in chosen))


def test_velocities_not_given_are_differences_and_none_in_the_first_update() -> None:
    pid = make(d=1.0, ff1=10.0)
    assert update(pid, 5.0, 3.0) == 0.0
    assert update(pid, 5.5, 3.25) == pytest.approx((1.0 * (0.5 - 0.25) + 10.0 * 0.5) / SECONDS)
    lib.hm2_pid_reset(pid)
    assert update(pid, 9.0, 0.0) == 0.0


def test_an_error_within_the_deadband_is_none_and_beyond_it_counts_from_its_edge() -> None:
    pid = make(p=1.0, deadband=0.5)
    for error, counted in ((0.5, 0.0), (-0.5, 0.0), (0.75, 0.25), (-0.75, -0.25)):
        assert update(pid, error, 0.0) == counted
        assert pid.error == error


@pytest.mark.parametrize("error", [1.0 + 1e-9, -1.0 - 1e-9, NAN])
def test_exceeding_the_following_error_is_remembered_until_the_reset(error: float) -> None:
    pid = make(p=1.0, max_error=1.0)
    update(pid, 1.0, 0.0)
    assert not pid.exceeded
    update(pid, error, 0.0)
    update(pid, 0.0, 0.0)
    assert pid.exceeded
    lib.hm2_pid_reset(pid)
    assert not pid.exceeded
