"""LBP16 commands, from the C codec. Fact sheet lbp16.md 1."""

from __future__ import annotations

import struct
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.registers import Lbp16Space

PORT: int = lib.HM2_LBP16_PORT
MAX_PAYLOAD: int = lib.HM2_LBP16_MAX_PAYLOAD
MAX_COUNT: int = lib.HM2_LBP16_MAX_COUNT


def element_size(space: int) -> int:
    """Bytes of an element of a space's memory: 4 in HostMot2 and flash, 2 elsewhere."""
    return 4 if space in (Lbp16Space.HOSTMOT2, Lbp16Space.FLASH) else 2


def _command(
    space: int, address: int, count: int, write: bool, info: bool, increment: bool, data: Any
) -> bytes:
    size = 2 if info else element_size(space)
    packet = ffi.new("uint8_t[]", MAX_PAYLOAD)
    length: Any = ffi.new("size_t *")
    command = ffi.new(
        "hm2_lbp16_command *",
        {
            "address": address,
            "write": write,
            "has_address": True,
            "info": info,
            "space": space,
            "element_size": size,
            "increment": increment,
            "count": count,
        },
    )
    if lib.hm2_lbp16_put(packet, MAX_PAYLOAD, length, command, data) != lib.HM2_OK:
        raise ValueError(f"space {space}, {count} elements: out of range")
    return bytes(ffi.buffer(packet, length[0]))


def read(space: int, address: int, count: int = 1, *, info: bool = False, increment: bool = True) -> bytes:
    """A command that reads `count` (1 to 127) elements; ValueError out of range."""
    return _command(space, address, count, False, info, increment, ffi.NULL)


def write(space: int, address: int, values: list[int], *, increment: bool = True) -> bytes:
    """A command that writes elements; ValueError out of range."""
    data = struct.pack(f"<{len(values)}{'I' if element_size(space) == 4 else 'H'}", *values)
    return _command(space, address, len(values), True, False, increment, data)


def reply_size(commands: bytes) -> int:
    """Bytes that a packet's reads bring back; ValueError for what is no packet."""
    size: Any = ffi.new("size_t *")
    if lib.hm2_lbp16_reply_size(commands, len(commands), size) != lib.HM2_OK:
        raise ValueError("not a whole LBP16 packet")
    return int(size[0])
