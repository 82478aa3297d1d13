"""A bus around another bus: what passes through it can be looked at, or come from elsewhere."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.transports.base import Transport

logger = logging.getLogger(__name__)


class BusAround:
    """Passes everything on to `under`. Subclasses change what they need.

    Written for tests, slow loops and replays: each exchange costs some tens of microseconds in Python.
    """

    def __init__(self, under: Transport) -> None:
        self.under = under
        self._bus: Any = under.bus

    @property
    def transport(self) -> Transport:
        """This bus as what a Board takes; `hostmot2.Board(around.transport)`."""
        signatures = {
            "begin": ("int(void *, const hm2_transfer *, size_t, hm2_error *)", self._begin),
            "finish": ("int(void *, int64_t, hm2_error *)", self._finish),
            "now_ns": ("int64_t(void *)", lambda _self: self.now_ns()),
            "pause_ns": ("void(void *, int64_t)", lambda _self, ns: self.pause_ns(ns)),
            "close": ("void(void *)", lambda _self: self._bus.close(self._bus.self)),
            "disturbances": ("uint64_t(void *)", lambda _self: self.disturbances()),
        }
        bus: Any = ffi.new("hm2_bus *")
        callbacks = {name: ffi.callback(*each, error=-1) for name, each in signatures.items() if name in _INT}
        callbacks |= {name: ffi.callback(*each) for name, each in signatures.items() if name not in _INT}
        for name, callback in callbacks.items():
            setattr(bus, name, callback)
        return Transport(
            bus=bus,
            url=self.under.url,
            model=self.under.model,
            read_only=self.under.read_only,
            virtual_time=self.under.virtual_time,
            keep=(self, *self.under.keep, *callbacks.values()),
            on_close=self.under.on_close,
        )

    def begin(self, transfers: Any, count: int, error: Any) -> int:
        """The first half of an exchange; a status."""
        return int(self._bus.begin(self._bus.self, transfers, count, error))

    def finish(self, deadline_ns: int, error: Any) -> int:
        """The second half; a status."""
        return int(self._bus.finish(self._bus.self, deadline_ns, error))

    def now_ns(self) -> int:
        """The clock that deadlines are measured on."""
        return int(self._bus.now_ns(self._bus.self))

    def pause_ns(self, ns: int) -> None:
        """Let time pass."""
        self._bus.pause_ns(self._bus.self, ns)

    def disturbances(self) -> int:
        """How often an old request was carried out once more; 0 from a bus where that cannot be."""
        tells = self._bus.disturbances
        return int(tells(self._bus.self)) if tells else 0

    def _begin(self, _self: Any, transfers: Any, count: int, error: Any) -> int:
        return self._guarded(lambda: self.begin(transfers, count, error))

    def _finish(self, _self: Any, deadline_ns: int, error: Any) -> int:
        return self._guarded(lambda: self.finish(deadline_ns, error))

    def _guarded(self, work: Any) -> int:
        """A C core is between here and who would see an exception."""
        try:
            return int(work())
        except Exception:
            logger.exception("the bus around %s failed", self.under.url)
            return int(lib.HM2_ERR_IO)


_INT = ("begin", "finish")


def places(transfers: Any, count: int) -> Iterator[tuple[int, bool, Any, int]]:
    """Every word of a list of transfers in order: address, whether it is written, its buffer and index."""
    for number in range(count):
        transfer = transfers[number]
        step = 0 if transfer.flags & lib.HM2_TRANSFER_SAME_ADDRESS else 4
        write = bool(transfer.flags & lib.HM2_TRANSFER_WRITE)
        for index in range(transfer.count):
            yield transfer.address + step * index, write, transfer.words, index
