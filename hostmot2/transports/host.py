"""A transport written in Python: for buses that have a Python library, and for trying one out.

Subclass HostBus, give the class's `transport` to your `open_transport(url)`, and name that function in an
entry point of the group `hostmot2.transports`. Calls come one at a time, with the board's lock held.
"""

from __future__ import annotations

import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.transports.base import Transport

logger = logging.getLogger(__name__)


class HostBus(ABC):
    """Words at addresses. Raise TimeoutError or OSError when the card cannot be reached."""

    @abstractmethod
    def read(self, address: int, count: int) -> Sequence[int]:
        """`count` consecutive words from byte address `address` on."""

    @abstractmethod
    def write(self, address: int, words: Sequence[int]) -> None:
        """Consecutive words from byte address `address` on, in order."""

    def close(self) -> None:  # noqa: B027  # most buses have nothing to close
        """Called once."""

    def transport(self, url: str, model: str | None = None) -> Transport:
        """This bus as what a Board takes; `model` is the board's name, if known."""
        signatures = {
            "begin": "int(void *, const hm2_transfer *, size_t, hm2_error *)",
            "finish": "int(void *, int64_t, hm2_error *)",
            "now_ns": "int64_t(void *)",
            "pause_ns": "void(void *, int64_t)",
            "close": "void(void *)",
        }
        functions: dict[str, Any] = {
            "begin": self._begin,
            "finish": lambda _self, _deadline, _error: lib.HM2_OK,
            "now_ns": lambda _self: time.monotonic_ns(),
            "pause_ns": lambda _self, ns: time.sleep(max(ns, 0) / 1e9),
            "close": lambda _self: self.close(),
        }
        bus: Any = ffi.new("hm2_bus *")
        callbacks = {name: ffi.callback(signature, functions[name]) for name, signature in signatures.items()}
        for name, callback in callbacks.items():
            setattr(bus, name, callback)
        return Transport(bus=bus, url=url, model=model, keep=(self, *callbacks.values()))

    def _begin(self, _self: Any, transfers: Any, count: int, error: Any) -> int:
        for index in range(count):
            try:
                self._transfer(transfers[index])
            except Exception as failure:
                return _note(failure, transfers[index].address, error)
        return int(lib.HM2_OK)

    def _transfer(self, transfer: Any) -> None:
        step = 0 if transfer.flags & lib.HM2_TRANSFER_SAME_ADDRESS else 4
        if step:
            spans = [(transfer.address, 0, transfer.count)]
        else:
            spans = [(transfer.address, index, 1) for index in range(transfer.count)]
        for address, first, count in spans:
            if transfer.flags & lib.HM2_TRANSFER_WRITE:
                self.write(address, [transfer.words[first + i] for i in range(count)])
            else:
                words = self.read(address, count)
                if len(words) != count:
                    raise OSError(f"{len(words)} words instead of {count}")
                for i, word in enumerate(words):
                    transfer.words[first + i] = word


def _note(failure: Exception, address: int, error: Any) -> int:
    """A Python exception as a status: a C core is between here and who will see it."""
    logger.debug("transfer at 0x%04X failed", address, exc_info=failure)
    status = lib.HM2_ERR_TIMEOUT if isinstance(failure, TimeoutError) else lib.HM2_ERR_IO
    if error != ffi.NULL:
        ffi.memmove(error, ffi.new("hm2_error *"), ffi.sizeof("hm2_error"))
        error.status, error.index, error.address = status, -1, address
        error.os_errno = getattr(failure, "errno", None) or 0
        text = f"{type(failure).__name__}: {failure}".encode("ascii", "replace")[:31]
        ffi.memmove(error.where, text, len(text))
    return int(status)
