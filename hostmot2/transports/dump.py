"""dump://: a register dump as a board that can only be read."""

from __future__ import annotations

from urllib.parse import unquote, urlsplit

from hostmot2 import dump, errors
from hostmot2._core import ffi, lib
from hostmot2.transports.base import Transport


def open_transport(url: str) -> Transport:
    """Open dump://FILE. Reading a word that is not in the dump raises NotInDump, writing raises ReadOnly.

    Raises CardNotFound, PermissionDenied or BrokenDump, each naming the file.
    """
    parts = urlsplit(url)
    recorded = dump.load(unquote(parts.netloc + parts.path))
    addresses = list(recorded.words)
    bus = ffi.new("hm2_bus *")
    error = errors.new_error()
    words = [recorded.words[address] for address in addresses]
    errors.check(lib.hm2_image_bus(addresses, words, len(addresses), bus, error), error)
    return Transport(bus=bus, url=url, read_only=True)
