"""The exception tree, and the one place where a C status becomes an exception.

Every error the package raises on its own account derives from HostMot2Error and carries its evidence
as attributes. A caller's mistake is a ValueError, TypeError or KeyError.
"""

from __future__ import annotations

from typing import Any

from hostmot2._core import ffi, lib


class HostMot2Error(Exception):
    """Base of every error of this package: what, where, expected and received, what to do."""

    def __init__(
        self,
        message: str,
        *,
        address: int | None = None,
        index: int | None = None,
        expected: int | None = None,
        received: int | None = None,
    ) -> None:
        super().__init__(message)
        self.address = address
        self.index = index
        self.expected = expected
        self.received = received


class TransportError(HostMot2Error):
    """The card could not be reached."""


class TransportTimeout(TransportError, TimeoutError):
    """No answer before the deadline."""


class TransportClosed(TransportError):
    """The board was used after close()."""


class ProtocolError(TransportError):
    """An answer that cannot be right."""


class PermissionDenied(TransportError, PermissionError):
    """The operating system does not let us at the card."""


class ReadOnly(TransportError):
    """A write to a board that can only be read (a dump)."""


class BoardError(HostMot2Error):
    """The card's own description of itself is wrong or not supported."""


class SserialError(HostMot2Error):
    """A smart-serial port, channel or remote failed."""


_BY_STATUS: dict[int, type[HostMot2Error]] = {
    lib.HM2_ERR_IO: TransportError,
    lib.HM2_ERR_TIMEOUT: TransportTimeout,
    lib.HM2_ERR_PROTOCOL: ProtocolError,
    lib.HM2_ERR_CLOSED: TransportClosed,
    lib.HM2_ERR_READ_ONLY: ReadOnly,
}


def new_error() -> Any:
    """A caller-owned hm2_error for one C call or for many."""
    return ffi.new("hm2_error *")


def check(status: int, error: Any) -> None:
    """Raise the exception that `status` and its evidence stand for; nothing for HM2_OK."""
    if status == lib.HM2_OK:
        return
    where = ffi.string(error.where).decode("ascii")
    name = ffi.string(lib.hm2_status_name(status)).decode("ascii")
    message = f"{where or 'hostmot2'}: {name} at 0x{error.address:04X}"
    if status in (lib.HM2_ERR_RANGE, lib.HM2_ERR_ALIGN):
        raise ValueError(message)
    if status == lib.HM2_ERR_NO_MEMORY:
        raise MemoryError(message)
    raise _BY_STATUS.get(status, HostMot2Error)(
        message,
        address=error.address,
        index=None if error.index < 0 else error.index,
        expected=error.expected,
        received=error.received,
    )
