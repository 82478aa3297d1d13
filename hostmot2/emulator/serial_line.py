"""An emulated remote at the end of a real-time serial line: bytes in, bytes out, each when it is due."""

from __future__ import annotations

import time
from collections.abc import Callable

from hostmot2._core import ffi, lib
from hostmot2.emulator.remote import EmulatedRemote

PS_PER_S = 1_000_000_000_000
PS_PER_NS = 1000
BITS_PER_BYTE = 10


class SerialLine:
    """Both directions of the line. Bytes handed over together follow each other without gaps.

    clock_ns: what time it is, in nanoseconds; the remote's gap timer, watchdog and flash run by it.
    """

    def __init__(self, remote: EmulatedRemote, clock_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self.remote = remote
        self._clock_ns = clock_ns
        self._byte = ffi.new("hm2_line_byte *")
        self._start_ns = clock_ns()
        self._free_ps = 0

    def _now_ps(self) -> int:
        return (self._clock_ns() - self._start_ns) * PS_PER_NS

    def receive(self, data: bytes, baud: int | None = None) -> None:
        """Bytes from the host, who sends at `baud` (None: at the remote's own rate)."""
        bit_ps = PS_PER_S // (baud or self.remote.baud)
        start_ps = max(self._now_ps(), self._free_ps)
        for value in data:
            self._byte[0] = {"start_ps": start_ps, "bit_ps": bit_ps, "value": value, "framing_error": 0}
            lib.hm2_remote_line_receive(self.remote.handle, self._byte)
            start_ps += BITS_PER_BYTE * bit_ps
        self._free_ps = start_ps

    def take(self) -> bytes:
        """Bytes of the remote whose last bit has passed."""
        now_ps, due = self._now_ps(), bytearray()
        lib.hm2_remote_advance(self.remote.handle, now_ps)
        while self._peek() and self._byte.start_ps + BITS_PER_BYTE * self._byte.bit_ps <= now_ps:
            due.append(self._byte.value)
            lib.hm2_remote_line_pop(self.remote.handle)
        return bytes(due)

    def due_in_s(self) -> float | None:
        """Seconds until `take` has something; None: nothing is on its way."""
        if not self._peek():
            return None
        due_ps = self._byte.start_ps + BITS_PER_BYTE * self._byte.bit_ps - self._now_ps()
        return float(max(due_ps, 0)) / PS_PER_S

    def _peek(self) -> bool:
        return bool(lib.hm2_remote_line_peek(self.remote.handle, self._byte))
