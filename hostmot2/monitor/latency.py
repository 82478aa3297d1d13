"""How long cycles and answers take: over all time, and for each half second of the last minute."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from hostmot2.histogram import Histogram
from hostmot2.monitor.snapshot import LatencyView

KEPT = 120


class LatencyHistory:
    """Fed with an engine's histograms, which only grow."""

    def __init__(self) -> None:
        self._last = Histogram()
        self._history: deque[float] = deque(maxlen=KEPT)
        self.view = LatencyView()

    def add(self, trace: Mapping[str, Histogram]) -> None:
        """`Engine.trace()` now; the cycles since the last call are one more point."""
        cycle = trace["cycle"]
        fresh = cycle.since(self._last)
        self._last = cycle
        if len(fresh):
            self._history.append(fresh.percentile(99) / 1000)
            self.view = LatencyView(
                trace["reply"].percentile(99) / 1000,
                cycle.percentile(99) / 1000,
                cycle.maximum / 1000,
                tuple(self._history),
            )
