"""Latency histograms: fixed memory, percentiles within 1 %, minimum and maximum exact."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from hostmot2._core import ffi, lib

PERCENTILES = (50.0, 99.0, 99.9)


class Histogram:
    """Times in nanoseconds, in buckets at most 1/128 of their value wide, up to 18 minutes.

    One thread records; any may read, and sees each number whole. `core` is the hm2_histogram itself, for
    C code that records into it.
    """

    def __init__(self, values_ns: Iterable[int] = ()) -> None:
        self.core: Any = ffi.new("hm2_histogram *")
        self._buckets: npt.NDArray[np.uint64] = np.frombuffer(ffi.buffer(self.core.buckets), np.uint64)
        self.record_many(values_ns)

    def record(self, ns: int) -> None:
        """Count one time. A negative one counts as 0."""
        lib.hm2_histogram_record(self.core, ns)

    def record_many(self, values_ns: Iterable[int]) -> None:
        """Count many times: any iterable of ints, or an int64 array."""
        given = values_ns if isinstance(values_ns, np.ndarray) else list(values_ns)
        values = np.ascontiguousarray(given, np.int64)
        if values.size:
            lib.hm2_histogram_record_many(self.core, ffi.cast("int64_t *", values.ctypes.data), values.size)

    def merge(self, other: Histogram) -> None:
        """Count everything the other has counted."""
        lib.hm2_histogram_merge(self.core, other.core)

    def since(self, earlier: Histogram) -> Histogram:
        """What was counted after `earlier`, a copy of this histogram then; minimum and maximum within 1 %."""
        fresh = Histogram()
        np.subtract(self._buckets, earlier._buckets, out=fresh._buckets)
        used = np.flatnonzero(fresh._buckets)
        if used.size:
            fresh.core.count = int(fresh._buckets.sum())
            fresh.core.sum_ns = self.core.sum_ns - earlier.core.sum_ns
            fresh.core.minimum_ns = lib.hm2_histogram_bucket_start(int(used[0]))
            last = lib.hm2_histogram_bucket_start(int(used[-1]) + 1) - 1
            fresh.core.maximum_ns = min(last, self.core.maximum_ns)
        return fresh

    def reset(self) -> None:
        """Forget everything."""
        lib.hm2_histogram_reset(self.core)

    def __len__(self) -> int:
        return int(self.core.count)

    @property
    def minimum(self) -> int:
        """Shortest time, ns. ValueError while empty."""
        return self.percentile(0)

    @property
    def maximum(self) -> int:
        """Longest time, ns. ValueError while empty."""
        return self.percentile(100)

    @property
    def mean(self) -> float:
        """Mean time, ns, exact. ValueError while empty."""
        if not len(self):
            raise ValueError("nothing recorded")
        return float(self.core.sum_ns / self.core.count)

    def percentile(self, percent: float) -> int:
        """The time in ns that `percent` (0..100) of all do not exceed; at most 1 % above the exact one.

        ValueError while empty or for a percentage out of range.
        """
        if not 0 <= percent <= 100:
            raise ValueError(f"{percent} %")
        if not len(self):
            raise ValueError("nothing recorded")
        return int(lib.hm2_histogram_percentile(self.core, percent))

    def buckets(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.uint64]]:
        """Start and width in ns, and count, of every bucket that is not empty. For pictures."""
        used = np.flatnonzero(self._buckets)
        start = np.array([lib.hm2_histogram_bucket_start(int(i)) for i in used], np.int64)
        end = np.array([lib.hm2_histogram_bucket_start(int(i) + 1) for i in used], np.int64)
        return start, end - start, self._buckets[used]

    def summary(self) -> dict[str, float]:
        """Count, and minimum, percentiles, maximum and mean in ns, as JSON takes it. Empty: count alone."""
        if not len(self):
            return {"count": 0}
        result: dict[str, float] = {"count": len(self), "min_ns": self.minimum}
        result |= {f"p{percent:g}_ns": self.percentile(percent) for percent in PERCENTILES}
        return result | {"max_ns": self.maximum, "mean_ns": self.mean}

    def __repr__(self) -> str:
        """One line, in microseconds."""
        if not len(self):
            return "Histogram: nothing recorded"
        names = {"min": 0.0} | {f"p{percent:g}": percent for percent in PERCENTILES} | {"max": 100.0}
        cells = (f"{name} {self.percentile(percent) / 1000:.2f}" for name, percent in names.items())
        return f"Histogram of {len(self)} (us): " + "  ".join(cells)
