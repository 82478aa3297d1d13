"""Records of cycles on their way from the cycle's thread to whoever writes them down.

The ring itself is C (csrc/record_ring.c): pushing never waits, and what finds no room is counted exactly.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hostmot2._core import ffi, lib
from hostmot2.errors import check, new_error
from hostmot2.handles import own

STAGES = ("wake", "request", "reply", "unpack", "control", "pack", "write")
"""The stages of a cycle, in order; `stage_ns` of a record is indexed by them."""

_HEADER: list[tuple[Any, ...]] = [
    ("cycle", "<u8"),
    ("start_ns", "<i8"),
    ("stage_ns", "<u4", 8),
    ("outputs_number", "<u8"),
    ("status", "<i4"),
    ("flags", "<u4"),
    ("image_words", "<u4"),
    ("reserved", "<u4"),
    ("fresh", "<u4", 8),
]


class RingCounters(NamedTuple):
    """What went through a ring since it was made."""

    pushed: int
    dropped: int
    popped: int


def record_dtype(words: int = 0, inputs: int = 0, outputs: int = 0) -> np.dtype[Any]:
    """The type of a record: header, register image, input values, output values (`hm2_record` in hm2.h).

    words: of the image, at most HM2_RECORD_WORDS. `fresh` has a bit for each word that the cycle moved;
    `start_ns` is when the cycle was due, `stage_ns` what passed until each stage of STAGES was over.
    """
    if not 0 <= words <= lib.HM2_RECORD_WORDS:
        raise ValueError(f"{words} words are outside 0..{lib.HM2_RECORD_WORDS}")
    pad = [("pad", "<u4")] if words % 2 else []
    return np.dtype(
        [
            *_HEADER,
            ("words", "<u4", (words,)),
            *pad,
            ("inputs", "<f8", (inputs,)),
            ("outputs", "<f8", (outputs,)),
        ]
    )


class RecordRing:
    """A ring of `slots` (a power of two) records of `dtype`.

    Thread-safety: one thread pushes (the cycle's), one pops; counters may be read by any. Raises ValueError
    for slots that are no power of two.
    """

    def __init__(self, dtype: np.dtype[Any], slots: int = 8192) -> None:
        if slots < 2 or slots & slots - 1 or slots > 1 << 24:
            raise ValueError(f"{slots} slots: a power of two from 2 to {1 << 24} is needed")
        self.dtype = dtype
        self.slots = slots
        error = new_error()
        handle = ffi.new("struct hm2_record_ring **")
        check(lib.hm2_record_ring_new(slots, dtype.itemsize, handle, error), error)
        self.handle, self._kept = own(handle[0], lib.hm2_record_ring_free)

    def push(self, record: npt.NDArray[Any]) -> bool:
        """Put one record in; False: no room, counted as dropped."""
        data = np.ascontiguousarray(record, self.dtype)
        if data.size != 1:
            raise ValueError(f"{data.size} records instead of one")
        return bool(lib.hm2_record_ring_push(self.handle, ffi.from_buffer(data.reshape(1).view(np.uint8))))

    def pop(self, most: int = 4096) -> npt.NDArray[Any]:
        """Up to `most` records, oldest first, as an array of their own."""
        records = np.empty(min(most, self.slots), self.dtype)
        return records[: self.pop_into(records)]

    def pop_into(self, records: npt.NDArray[Any]) -> int:
        """Fill a contiguous array of `dtype` from its beginning; how many records were taken."""
        if records.dtype != self.dtype or not records.flags.c_contiguous:
            raise ValueError("the array is not a contiguous one of this ring's records")
        buffer = ffi.cast("void *", records.ctypes.data)
        return int(lib.hm2_record_ring_pop_many(self.handle, buffer, len(records)))

    @property
    def counters(self) -> RingCounters:
        """Records pushed, dropped and popped so far."""
        counters: Any = ffi.new("hm2_record_ring_counters *")
        lib.hm2_record_ring_get_counters(self.handle, counters)
        return RingCounters(counters.pushed, counters.dropped, counters.popped)
