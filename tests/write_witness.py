"""A bus that notes what is written."""

from __future__ import annotations

from typing import Any

from hostmot2.recording.bus import BusAround, places


class Witness(BusAround):
    """Notes what is written."""

    def __init__(self, under: Any) -> None:
        super().__init__(under)
        self.written: list[int] = []

    def begin(self, transfers: Any, count: int, error: Any) -> int:
        self.written += [address for address, write, _, _ in places(transfers, count) if write]
        return super().begin(transfers, count, error)
