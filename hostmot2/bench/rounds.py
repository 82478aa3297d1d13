"""Timing of candidates that take turns, so that what disturbs the machine disturbs them alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import repeat
from statistics import median

ROUNDS = 15
ROUND_SECONDS = 0.01


@dataclass(frozen=True, slots=True)
class Candidate:
    """Something to time. One call does `units` pieces of the work that is counted."""

    name: str
    call: Callable[[], object]
    units: int = 1


@dataclass(frozen=True, slots=True)
class Timing:
    """Nanoseconds per unit of work in each round."""

    name: str
    rounds: tuple[float, ...]

    @property
    def ns(self) -> float:
        """Median over the rounds."""
        return median(self.rounds)

    def times_faster_than(self, other: Timing) -> float:
        """Median of the ratios round by round: how many times longer the other takes."""
        return median(b / a for a, b in zip(self.rounds, other.rounds, strict=True))


def measure(
    candidates: Iterable[Candidate], rounds: int = ROUNDS, seconds: float = ROUND_SECONDS
) -> dict[str, Timing]:
    """Times of all candidates, by name. Each runs about `seconds` per round; the empty loop is subtracted."""
    runs = [(each, _calls_for(each, seconds)) for each in candidates]
    times: dict[str, list[float]] = {each.name: [] for each, _ in runs}
    for _ in range(rounds):
        for each, calls in runs:
            spent = _time(each.call, calls) - _time_empty(calls)
            times[each.name].append(max(spent, 1) / (calls * each.units))
    return {name: Timing(name, tuple(values)) for name, values in times.items()}


def _calls_for(candidate: Candidate, seconds: float) -> int:
    candidate.call()  # first-call costs are nobody's business
    calls, spent = 1, 0
    while (spent := _time(candidate.call, calls)) < seconds * 1e9 / 4 and calls < 1 << 24:
        calls *= 2
    return max(1, round(calls * seconds * 1e9 / spent))


def _time(call: Callable[[], object], calls: int) -> int:
    loop = repeat(None, calls)
    start = time.perf_counter_ns()
    for _ in loop:
        call()
    return time.perf_counter_ns() - start


def _time_empty(calls: int) -> int:
    loop = repeat(None, calls)
    start = time.perf_counter_ns()
    for _ in loop:
        pass
    return time.perf_counter_ns() - start
