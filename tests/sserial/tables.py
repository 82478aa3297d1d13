"""Tables of remotes as bytes, written down plainly for tests (sserial.md 5.1)."""

import re
import struct

PAD, BITS, UNSIGNED, SIGNED, NV_UNSIGNED, NV_SIGNED, STREAM, BOOLEAN, ENCODER = range(9)
FLOAT, NV_FLOAT, ENCODER_H, ENCODER_L = 0x10, 0x11, 0x18, 0x28
IN, BOTH, OUT = 0x00, 0x40, 0x80


def element(name, kind, bits, direction, low=0.0, high=0.0, unit="", address=0):
    head = struct.pack("<BBBBffH", 0xA0, bits, kind, direction, low, high, address)
    return head + unit.encode("latin-1") + b"\0" + name.encode("latin-1") + b"\0"


def mode(index, software, name):
    return bytes([0xB0, index, int(software), 0]) + name.encode() + b"\0"


class Memory:
    """64 KiB with records placed one behind the other from `records` on."""

    def __init__(self, records=0x1000):
        self.bytes = bytearray(0x10000)
        self.free = records

    def record(self, data):
        address = self.free
        self.bytes[address : address + len(data)] = data
        self.free += len(data)
        return address

    def table(self, pointer, entries):
        data = struct.pack(f"<{len(entries) + 1}H", *entries, 0)
        self.bytes[pointer : pointer + len(data)] = data
        return pointer

    def build(self, ptoc, gtoc=(), at=(0x700, 0x900)):
        """Both tables from records; returns the pointers as one word."""
        addresses = [self.record(data) for data in ptoc]
        self.table(at[0], addresses)
        if gtoc:
            self.table(at[1], [entry if isinstance(entry, int) else self.record(entry) for entry in gtoc])
        return at[0] | (at[1] << 16 if gtoc else 0)

    def used(self):
        """As the emulated remote takes it: address to byte, where there is something."""
        return {found.start(): found[0][0] for found in re.finditer(rb"[^\0]", self.bytes)}
