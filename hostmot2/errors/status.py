"""The one place where a status of the C core becomes an exception."""

from __future__ import annotations

import os
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.errors.base import HostMot2Error
from hostmot2.errors.board import WatchdogBite
from hostmot2.errors.transport import (
    LinkFailed,
    NotInDump,
    ProtocolError,
    ReadOnly,
    TransportClosed,
    TransportError,
    TransportTimeout,
)

_BY_STATUS: dict[int, type[HostMot2Error]] = {
    lib.HM2_ERR_IO: TransportError,
    lib.HM2_ERR_TIMEOUT: TransportTimeout,
    lib.HM2_ERR_PROTOCOL: ProtocolError,
    lib.HM2_ERR_CLOSED: TransportClosed,
    lib.HM2_ERR_READ_ONLY: ReadOnly,
    lib.HM2_ERR_GATED: WatchdogBite,
    lib.HM2_ERR_LINK: LinkFailed,
    lib.HM2_ERR_ABSENT: NotInDump,
}


def new_error() -> Any:
    """A caller-owned hm2_error for one C call or for many."""
    return ffi.new("hm2_error *")


def check(status: int, error: Any) -> None:
    """Raise the exception that `status` and its evidence stand for; nothing for HM2_OK."""
    if status == lib.HM2_OK:
        return
    where = text(error.where)
    name = text(lib.hm2_status_name(status))
    message = f"{where or 'hostmot2'}: {name}"
    if status == lib.HM2_ERR_CLOSED:
        message = "the board has been closed"
    elif status == lib.HM2_ERR_GATED:
        message = "nothing is written after a watchdog bite until watchdog.acknowledge()"
    elif error.address:
        message += f" at 0x{error.address:04X}"
    if error.os_errno:
        message += f" ({os.strerror(error.os_errno)})"
    if status in (lib.HM2_ERR_RANGE, lib.HM2_ERR_ALIGN):
        raise ValueError(message)
    if status == lib.HM2_ERR_NO_MEMORY:
        raise MemoryError(message)
    raise _BY_STATUS.get(status, HostMot2Error)(message, **evidence(error))


def text(c_text: Any) -> str:
    """A NUL-terminated C string as ASCII."""
    raw = ffi.string(c_text)
    return raw if isinstance(raw, str) else raw.decode("ascii")


def evidence(error: Any) -> dict[str, Any]:
    """What a hm2_error holds, as the keyword arguments of an exception."""
    return {
        "address": error.address,
        "index": None if error.index < 0 else error.index,
        "expected": error.expected,
        "received": error.received,
        "os_errno": error.os_errno or None,
    }
