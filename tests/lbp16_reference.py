"""A tiny plain reading of the LBP16 wire format (fact sheet lbp16.md 1), to test the C codec against."""

from __future__ import annotations

import dataclasses
import struct


@dataclasses.dataclass(frozen=True)
class Command:
    space: int
    size: int
    count: int
    write: bool = False
    info: bool = False
    increment: bool = True
    address: int | None = None
    data: bytes = b""

    def word(self) -> int:
        size = {1: 0, 2: 1, 4: 2, 8: 3}[self.size]
        flags = self.write << 15 | (self.address is not None) << 14 | self.info << 13 | self.increment << 7
        return flags | self.space << 10 | size << 8 | self.count

    def wire(self) -> bytes:
        address = b"" if self.address is None else struct.pack("<H", self.address)
        return struct.pack("<H", self.word()) + address + self.data


def parse(packet: bytes) -> list[Command]:
    commands = []
    while packet:
        (word,) = struct.unpack_from("<H", packet)
        packet = packet[2:]
        count, size = word & 127, 1 << (word >> 8 & 3)
        if count == 0:
            raise ValueError("count 0")
        address = None
        if word & 0x4000:
            (address,) = struct.unpack_from("<H", packet)
            packet = packet[2:]
        data = b""
        if word & 0x8000:
            data, packet = packet[: count * size], packet[count * size :]
            if len(data) < count * size:
                raise ValueError("data past the end")
        commands.append(
            Command(
                space=word >> 10 & 7,
                size=size,
                count=count,
                write=bool(word & 0x8000),
                info=bool(word & 0x2000),
                increment=bool(word & 0x80),
                address=address,
                data=data,
            )
        )
    return commands


def reply_size(commands: list[Command]) -> int:
    return sum(command.count * command.size for command in commands if not command.write)
