"""What an engine tells of itself, while it runs and afterwards."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from hostmot2._core import ffi, lib
from hostmot2.engine.facts import EngineStatus, Event, Off, event_of, status_of
from hostmot2.engine.signals import PortData
from hostmot2.errors import new_error
from hostmot2.histogram import Histogram
from hostmot2.record_ring import STAGES, record_dtype

if TYPE_CHECKING:
    from hostmot2.board import Board

EVENTS_KEPT = 10_000


class EngineView:
    """An engine as one looks at it. Thread-safety: any thread, at any time; the cycle never waits."""

    def __init__(self, board: Board, rate: float, ports: list[PortData]) -> None:
        self.board = board
        self.rate = rate
        self.handle: Any = None
        self.restart_problems: list[str] = []
        """Why ports that were given up could not be started anew, in sentences, oldest first."""
        self._ports = ports
        self._lock = threading.RLock()  # behind the board's lock, where both are needed
        self._error = new_error()
        self._events: deque[Event] = deque(maxlen=EVENTS_KEPT)
        self._started = False

    @property
    def running(self) -> bool:
        """Whether it has the board: between start() and stop()."""
        return self._started

    def now_ns(self) -> int:
        """The clock of records' and events' times: CLOCK_MONOTONIC, or the card's virtual time."""
        return self.board.now_ns() if self.board.virtual_time else time.monotonic_ns()

    @property
    def status(self) -> EngineStatus:
        """The state behind the last cycle."""
        status: Any = ffi.new("hm2_engine_status *")
        if self.handle:
            lib.hm2_engine_read(self.handle, status, ffi.NULL, ffi.NULL)
        return status_of(status, len(self._ports))

    @property
    def off(self) -> Off:
        """Why outputs are off; 0: they are on."""
        return self.status.off if self._started else Off.STOP

    def events(self) -> list[Event]:
        """What has happened since the last call, oldest first; the last EVENTS_KEPT at most."""
        with self._lock:
            self._take_events()
            taken = list(self._events)
            self._events.clear()
            return taken

    def _take_events(self) -> None:
        if not self.handle:
            return
        buffer: Any = ffi.new("hm2_engine_event[]", 64)
        while count := lib.hm2_engine_take_events(self.handle, buffer, 64):
            self._events.extend(event_of(event) for event in buffer[0:count])

    def layout(self) -> list[tuple[int, bool]]:
        """Address, and whether written, of each word of the records' image. Grows in the first cycles."""
        if not self.handle:
            return []
        words: Any = ffi.new("uint32_t[]", lib.HM2_RECORD_WORDS)
        count = lib.hm2_engine_layout(self.handle, words, lib.HM2_RECORD_WORDS)
        return [(word & ~1, bool(word & 1)) for word in words[0:count]]

    @property
    def left_out(self) -> int:
        """Registers, reads and writes apart, that found no room in the records' image so far."""
        return int(lib.hm2_engine_left_out(self.handle)) if self.handle else 0

    def trace(self) -> dict[str, Histogram]:
        """How long each stage of STAGES took ("wake": how late it began), "cycle": all of them, "after": what
        followed, which is the trace, the record and the publishing of the values.
        """
        result = {}
        for number, name in enumerate((*STAGES, "cycle", "after")):
            result[name] = Histogram()
            if self.handle:
                lib.hm2_engine_get_histogram(self.handle, number, result[name].core)
        return result

    def slowest(self) -> np.ndarray[Any, Any]:
        """Headers of the slowest cycles' records, slowest first; `stage_ns` is indexed as STAGES."""
        records = np.zeros(lib.HM2_ENGINE_SLOWEST, record_dtype())
        count = 0
        if self.handle:
            count = lib.hm2_engine_slowest(
                self.handle, ffi.cast("hm2_record *", records.ctypes.data), len(records)
            )
        found = records[:count]
        return found[np.argsort(-found["stage_ns"][:, len(STAGES) - 1].astype(np.int64), kind="stable")]

    def reset_trace(self) -> None:
        """Begin histograms and slowest cycles anew."""
        if self.handle:
            lib.hm2_engine_reset_trace(self.handle)

    def __repr__(self) -> str:
        state = self.status
        off = state.off.name if state.off else "on"
        return (
            f"<Engine {self.rate:g} Hz, {'running' if self._started else 'stopped'}, cycle {state.cycles}, "
            f"outputs {off if self._started else 'off'}, {state.failures} failures, "
            f"{state.overruns} overruns>"
        )
