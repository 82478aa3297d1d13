"""What a remote is, found out over LBP: the same tables and built-in facts as through a card."""

from __future__ import annotations

from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.errors import HostMot2Error
from hostmot2.lbp.client import LbpRemote
from hostmot2.lbp.errors import RemoteRefused
from hostmot2.remotes import builtin
from hostmot2.remotes.discovery import ReadFailed, RemoteDescription, read_tables
from hostmot2.remotes.errors import UnsupportedRemote
from hostmot2.remotes.parameters import Parameters

BLOCK = 8
"""Tables are read in aligned pieces of so many bytes."""

REGISTERS = 7
"""Interface registers that the widest card has; there are none on a line, so there is no tighter limit."""


class _Tables:
    """A remote's memory as the table parser of the core asks for it, each piece read once."""

    def __init__(self, remote: LbpRemote) -> None:
        self._remote = remote
        self._blocks: dict[int, bytes] = {}
        self.failure: BaseException | None = None
        self.handle = ffi.new_handle(self)
        self.memory = ffi.new("hm2_toc_memory *", {"self": self.handle, "fetch": lib.hm2_toc_fetch_python})

    def fetch(self, address: int, size: int) -> bytes:
        end = address + size
        first, last = address - address % BLOCK, (end - 1) - (end - 1) % BLOCK
        try:
            blocks = b"".join(self._block(at) for at in range(first, last + 1, BLOCK))
            return blocks[address - first : end - first]
        except RemoteRefused:
            return self._remote.read_bytes(address, size)  # the block's rest is not readable

    def _block(self, address: int) -> bytes:
        if address not in self._blocks:
            self._blocks[address] = self._remote.read_bytes(address, BLOCK)
        return self._blocks[address]


@ffi.def_extern()  # type: ignore[untyped-decorator]
def hm2_toc_fetch_python(self: Any, address: int, size: int, data: Any, error: Any) -> int:
    """The parser's memory access; a failure is kept for the caller to raise."""
    tables: _Tables = ffi.from_handle(self)
    try:
        ffi.memmove(data, tables.fetch(address, size), size)
    except BaseException as failure:
        tables.failure = failure
        return int(lib.HM2_ERR_TIMEOUT)
    return int(lib.HM2_OK)


def describe(remote: LbpRemote, software_mode: int | None = None) -> RemoteDescription:
    """What the remote says of itself, or what is built in about it.

    software_mode: selected first; None leaves it. Raises BrokenTable, UnsupportedRemote and errors of the
    line.
    """
    name, unit = remote.name, remote.unit_number
    if known := builtin.describe(name, unit, remote.read_remote):
        return known
    if software_mode is not None:
        remote.software_mode = software_mode
    found = remote.discovery()
    if not found.ptoc:
        raise UnsupportedRemote(f"{remote}: no table of its process data, and not known by its name")
    return _read(remote, found.gtoc << 16 | found.ptoc, (found.receive_size, found.transmit_size), name, unit)


def _read(remote: LbpRemote, toc: int, sizes: tuple[int, int], name: str, unit: int) -> RemoteDescription:
    tables = _Tables(remote)

    def read_table(pointer: int, table: int, *rest: Any) -> int:
        return int(lib.hm2_toc_read(tables.memory, pointer, table, *rest))

    try:
        return read_tables(
            read_table,
            0,
            toc,
            name=name,
            unit_number=unit,
            software_mode=remote.software_mode,
            registers=REGISTERS,
            sizes=sizes,
        )
    except ReadFailed as failure:
        if tables.failure is not None:
            raise tables.failure from None
        raise HostMot2Error(f"{remote}: reading its tables failed ({failure.status})") from failure


def parameters(remote: LbpRemote) -> Parameters:
    """The remote's parameters by name. Raises as `describe`, and BrokenTable for their own table."""
    description = describe(remote)
    description.raise_for_parameters()
    return Parameters(remote, description.parameters, description.aliases)
