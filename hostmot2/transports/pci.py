"""pci://: a PCI card, or a plain file or shared memory mapped the same way."""

from __future__ import annotations

import os
from urllib.parse import unquote, urlsplit

from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.transports.base import Transport


def open_transport(url: str) -> Transport:
    """Map the file that `url` (pci:///path) names.

    Raises CardNotFound, PermissionDenied, KernelLockdown or MappingTooSmall, each with the path.
    """
    parts = urlsplit(url)
    return Transport(bus=map_file(unquote(parts.path)), url=url)


_REFUSALS: dict[int, tuple[type[errors.TransportError], str]] = {
    lib.HM2_MEMORY_MAP_NOT_FOUND: (errors.CardNotFound, "there is no such file"),
    lib.HM2_MEMORY_MAP_PERMISSION: (errors.PermissionDenied, "this user may not read and write it"),
    lib.HM2_MEMORY_MAP_LOCKDOWN: (errors.KernelLockdown, "the kernel forbids mapping it"),
    lib.HM2_MEMORY_MAP_TOO_SMALL: (errors.MappingTooSmall, "{received} bytes, at least {expected} needed"),
    lib.HM2_MEMORY_MAP_OTHER: (errors.TransportError, "{reason}"),
}


def map_file(path: str) -> object:
    """A `hm2_bus *` over the first 64 KiB of `path`; errors as open_transport()."""
    bus = ffi.new("hm2_bus *")
    error = errors.new_error()
    status = lib.hm2_memory_map_bus(path.encode(), bus, error)
    if status == lib.HM2_ERR_IO:
        kind, text = _REFUSALS[error.detail]
        facts = errors.evidence(error)
        message = text.format(reason=os.strerror(error.os_errno), **facts)
        raise kind(f"{path}: {message}. {kind.fix}".strip(), **facts)
    errors.check(status, error)
    return bus
