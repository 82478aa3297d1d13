"""Recording a loop written in Python: the words of its exchanges, a record per `push`.

The cycle engine fills its records itself; this is for loops of some hundred hertz without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hostmot2._core import lib
from hostmot2.record_ring import STAGES, RecordRing
from hostmot2.recording.bus import BusAround, places
from hostmot2.transports.base import Transport


class Tap(BusAround):
    """A bus that notes every word that passes, for the next record.

        tap = Tap(open_transport(url))
        board = Board(tap.transport)
        tap.ring = RecordRing(record_dtype(words=64, inputs=1), 1024)

    Nothing is noted until `ring` is set: set it when everything but the cycles is done. Words beyond the
    records' room are left out.
    """

    def __init__(self, under: Transport, ring: RecordRing | None = None) -> None:
        super().__init__(under)
        self.registers: list[int] = []
        """What register each word of the image is, bit 0 set if written; grows. For `Recorder(image=...)`."""
        self.ring = ring
        self._words: dict[int, int] = {}  # register -> word of the image
        self._cycle = 0
        self._record: Any = None
        self._outstanding: tuple[Any, int] | None = None

    def begin(self, transfers: Any, count: int, error: Any) -> int:
        """Notes when the first exchange of a record begins."""
        if self.ring is not None:
            self._next_record(self.ring)
            self._outstanding = transfers, count
        status = super().begin(transfers, count, error)
        if status != lib.HM2_OK:  # nobody will finish it
            self._end(status)
        return status

    def finish(self, deadline_ns: int, error: Any) -> int:
        """Notes the words, or the failure."""
        status = super().finish(deadline_ns, error)
        self._end(status)
        return status

    def _end(self, status: int) -> None:
        """Of an exchange. What failed first is the record's status, whatever came back behind it."""
        if self._outstanding is not None and self._record is not None:
            if status == lib.HM2_OK:
                self._note(*self._outstanding)
            elif not self._record["status"][0]:
                self._record["status"] = status
            self._record["stage_ns"] = self._passed()
        self._outstanding = None

    def push(self, inputs: Sequence[float] = (), outputs: Sequence[float] = (), flags: int = 0) -> bool:
        """What was noted since the last push becomes a record; False: no room, counted as dropped.

        Raises ValueError where inputs and outputs are not as many as the ring's records have.
        """
        if self.ring is None:
            raise ValueError("the tap has no ring")
        self._next_record(self.ring)
        record = self._record
        for name, values in (("inputs", inputs), ("outputs", outputs)):
            if len(values) != record[name].shape[1]:  # numpy would repeat a single one
                raise ValueError(f"{len(values)} {name}, the records have {record[name].shape[1]}")
            record[name] = values
        record["flags"] = flags
        record["image_words"] = len(self.registers)
        pushed = self.ring.push(record)
        self._cycle += 1
        record["fresh"], record["status"] = 0, 0
        record["start_ns"] = -1
        return pushed

    def _next_record(self, ring: RecordRing) -> None:
        if self._record is None:
            self._record = np.zeros(1, ring.dtype)
            self._record["start_ns"] = -1
        if self._record["start_ns"][0] < 0:
            self._record["cycle"] = self._cycle
            self._record["start_ns"] = self.now_ns()
            self._record["stage_ns"] = 0

    def _passed(self) -> Any:
        """All stages end now: from outside they cannot be told apart."""
        passed = min(max(self.now_ns() - int(self._record["start_ns"][0]), 0), 0xFFFFFFFF)
        return [0, *[passed] * (len(STAGES) - 1), 0]

    def _note(self, transfers: Any, count: int) -> None:
        room = self._record["words"].shape[1]
        for address, write, words, index in places(transfers, count):
            register = address | write
            slot = self._words.get(register)
            if slot is None:
                if len(self.registers) == room:
                    continue
                slot = self._words[register] = len(self.registers)
                self.registers.append(register)
            self._record["words"][0, slot] = words[index]
            self._record["fresh"][0, slot // 32] |= np.uint32(1 << slot % 32)
