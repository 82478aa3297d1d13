"""One change tried: measured without and with it in turn, always put back; the difference with its bounds."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from math import comb
from statistics import median
from types import FrameType
from typing import Any

from hostmot2.doctor.guardian import Guardian
from hostmot2.doctor.knobs import Knob
from hostmot2.doctor.measure import Measurement

ROUNDS = 10
CONFIDENCE = 0.95
SETTLE_S = 0.05
STATISTICS = {"p50": 50.0, "p99": 99.0, "max": 100.0}


@dataclass(frozen=True)
class Difference:
    """One statistic, in us. low, high: with the confidence given, the median difference lies between them."""

    before: float
    after: float
    low: float
    high: float
    confidence: float

    @property
    def verdict(self) -> str:
        """What is shown."""
        if self.high < 0:
            return "faster"
        return "slower" if self.low > 0 else "no difference shown"


@dataclass(frozen=True)
class Outcome:
    """What a change did. lost: exchanges without an answer, without and with it."""

    key: str
    old: str
    new: str
    what: str
    rounds: int
    differences: dict[str, Difference]
    lost: tuple[int, int]
    restored: bool

    def as_json(self) -> dict[str, Any]:
        """As JSON takes it."""
        told = {name: asdict(each) | {"verdict": each.verdict} for name, each in self.differences.items()}
        return asdict(self) | {"differences": told}


def interval(deltas: Sequence[float], confidence: float = CONFIDENCE) -> tuple[float, float, float]:
    """Bounds of the median of what the differences are drawn from, and how sure they are.

    The k-th smallest and largest of n enclose it with probability 1 - 2 P(Binomial(n, 1/2) < k), whatever the
    distribution. ValueError for fewer than six.
    """
    ordered, count = sorted(deltas), len(deltas)
    best = 0
    for k in range(1, count // 2 + 1):
        if _sure(count, k) >= confidence:
            best = k
    if not best:
        raise ValueError(f"{count} rounds are too few for {confidence:.0%}")
    return ordered[best - 1], ordered[count - best], _sure(count, best)


def _sure(count: int, k: int) -> float:
    return 1 - 2 * sum(comb(count, below) for below in range(k)) / float(2**count)


def try_change(
    knob: Knob,
    value: str,
    probe: Callable[[], Measurement],
    *,
    rounds: int = ROUNDS,
    interface: str | None = None,
    progress: Callable[[str, int, int], object] = lambda *_: None,
) -> Outcome:
    """Measure without and with the change in turn, and put the setting back.

    It is put back at the end, after an exception, SIGINT, SIGTERM and SIGHUP, and, by a process of its own,
    if this one is killed. OSError and ValueError from the knob; ValueError for fewer than six rounds.
    """
    interval([0.0] * rounds)
    old = knob.read()
    guard = Guardian(knob.key, old, interface) if knob.kept else None
    runs: dict[bool, list[Measurement]] = {False: [], True: []}
    with guard or contextlib.nullcontext(), _signals_raise():
        try:
            for number in range(rounds):
                for changed in (False, True) if number % 2 == 0 else (True, False):
                    knob.write(value if changed else old)
                    time.sleep(SETTLE_S)
                    runs[changed].append(probe())
                progress(f"{knob.key}={value}", number + 1, rounds)
        finally:
            knob.write(old)
            if guard:
                guard.restored = True
    return _outcome(knob, old, value, runs, restored=knob.read() == old)


def _outcome(
    knob: Knob, old: str, new: str, runs: dict[bool, list[Measurement]], *, restored: bool
) -> Outcome:
    found = {}
    for name, percent in STATISTICS.items():
        before, after = (
            [m.times.percentile(percent) / 1000 for m in runs[c] if len(m.times)] for c in (False, True)
        )
        low, high, sure = interval([b - a for a, b in zip(before, after, strict=True)])
        found[name] = Difference(median(before), median(after), low, high, sure)
    lost = sum(m.lost for m in runs[False]), sum(m.lost for m in runs[True])
    return Outcome(knob.key, old, new, runs[False][0].what, len(runs[False]), found, lost, restored)


@contextlib.contextmanager
def _signals_raise() -> Iterator[None]:
    """What would end the process without a word ends it by an exception, so that everything is put back."""

    def end(number: int, _frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    before = {number: signal.signal(number, end) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
