"""A plain reader of a remote's self-description, from sserial.md 5.1 and independent of the package."""

import struct
from collections.abc import Callable
from typing import NamedTuple

Read = Callable[[int, int], bytes]


class Record(NamedTuple):
    bits: int
    kind: int
    direction: int
    minimum: float
    maximum: float
    address: int
    unit: str
    name: str


class Mode(NamedTuple):
    index: int
    kind: int
    name: str


def string(read: Read, address: int) -> tuple[str, int]:
    text = b""
    while (byte := read(address, 1)) != b"\0":
        text += byte
        address += 1
        assert len(text) < 48
    return text.decode("ascii"), address + 1


def record(read: Read, address: int) -> Record | Mode:
    kind = read(address, 1)[0]
    if kind == 0xB0:
        _, index, mode_kind, _ = read(address, 4)
        return Mode(index, mode_kind, string(read, address + 4)[0])
    assert kind == 0xA0, hex(kind)
    head = b"".join(read(address + offset, 1) for offset in range(14))
    _, bits, data_type, direction, low, high, place = struct.unpack("<BBBBffH", head)
    unit, after = string(read, address + 14)
    return Record(bits, data_type, direction, low, high, place, unit, string(read, after)[0])


def toc(read: Read, pointer: int) -> list[Record | Mode]:
    entries: list[Record | Mode] = []
    while (address := int.from_bytes(read(pointer, 2), "little")) != 0:
        entries.append(record(read, address))
        pointer += 2
        assert len(entries) < 256
    return entries
