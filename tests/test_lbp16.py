"""The LBP16 codec: the sheet's vectors, and equality with a plain reference."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lbp16_reference import Command, parse, reply_size

from hostmot2._core import ffi, lib

GOLDEN = Path(__file__).parent / "golden"

# lbp16.md 7: request, and the commands it stands for
VECTORS = [
    ("01420001", [Command(0, 4, 1, increment=False, address=0x100)]),
    ("82420401", [Command(0, 4, 2, address=0x104)]),
    ("885d0000", [Command(7, 2, 8, address=0)]),
    ("83490200", [Command(2, 2, 3, address=2)]),
    ("88610000", [Command(0, 2, 8, info=True, address=0)]),
    ("886d0000", [Command(3, 2, 8, info=True, address=0)]),
    ("88790000", [Command(6, 2, 8, info=True, address=0)]),
    ("014e0800", [Command(3, 4, 1, increment=False, address=8)]),
    (
        "82c2001044332211ddccbbaa",
        [Command(0, 4, 2, write=True, address=0x1000, data=bytes.fromhex("44332211ddccbbaa"))],
    ),
    ("814204018102", [Command(0, 4, 1, address=0x104), Command(0, 4, 1)]),
    (
        "01d91a00025a82c920003201a8c0",
        [
            Command(6, 2, 1, write=True, increment=False, address=0x1A, data=b"\x02\x5a"),
            Command(2, 2, 2, write=True, address=0x20, data=bytes.fromhex("3201a8c0")),
        ],
    ),
    ("404e0400", [Command(3, 4, 64, increment=False, address=4)]),
    ("01d91c000100", [Command(6, 2, 1, write=True, increment=False, address=0x1C, data=b"\x01\x00")]),
    (
        "0159080082d110000700000084511000",
        [
            Command(6, 2, 1, increment=False, address=8),
            Command(4, 2, 2, write=True, address=0x10, data=struct.pack("<I", 7)),
            Command(4, 2, 4, address=0x10),
        ],
    ),
]


def c_command(command: Command):
    return ffi.new(
        "hm2_lbp16_command *",
        {
            "address": command.address or 0,
            "write": command.write,
            "has_address": command.address is not None,
            "info": command.info,
            "space": command.space,
            "element_size": command.size,
            "increment": command.increment,
            "count": command.count,
        },
    )


def encode(commands: list[Command], capacity: int = 1472) -> bytes:
    packet, length = ffi.new("uint8_t[]", capacity), ffi.new("size_t *")
    for command in commands:
        data = command.data if command.write else ffi.NULL
        assert lib.hm2_lbp16_put(packet, capacity, length, c_command(command), data) == lib.HM2_OK
    return bytes(ffi.buffer(packet, length[0]))


def decode(packet: bytes) -> list[Command]:
    view = ffi.from_buffer("uint8_t[]", packet)
    offset, command, data = ffi.new("size_t *"), ffi.new("hm2_lbp16_command *"), ffi.new("const uint8_t **")
    commands = []
    while offset[0] < len(packet):
        status = lib.hm2_lbp16_next(view, len(packet), offset, command, data)
        if status != lib.HM2_OK:
            raise ValueError(status)
        size = command.count * command.element_size
        commands.append(
            Command(
                space=command.space,
                size=command.element_size,
                count=command.count,
                write=bool(command.write),
                info=bool(command.info),
                increment=bool(command.increment),
                address=command.address if command.has_address else None,
                data=bytes(ffi.buffer(data[0], size)) if command.write else b"",
            )
        )
    return commands


def measure(packet: bytes) -> int:
    size = ffi.new("size_t *")
    assert lib.hm2_lbp16_reply_size(packet, len(packet), size) == lib.HM2_OK
    return int(size[0])


@pytest.mark.parametrize(("wire", "commands"), VECTORS)
def test_vectors_encode_and_decode(wire, commands):
    assert encode(commands).hex() == wire
    assert decode(bytes.fromhex(wire)) == commands


def test_every_command_word_survives_decoding_and_encoding():
    command = ffi.new("hm2_lbp16_command *")
    for word in range(0x10000):
        lib.hm2_lbp16_decode(word, command)
        assert lib.hm2_lbp16_encode(command) == word


def test_reply_sizes_of_the_recorded_linuxcnc_cycles():
    for line in (GOLDEN / "linuxcnc_20cycles.jsonl").read_text().splitlines():
        record = json.loads(line)
        assert measure(bytes.fromhex(record["req"])) == record["rsp_len"]


@st.composite
def command_strategy(draw):
    size, count, write = draw(st.sampled_from([1, 2, 4, 8])), draw(st.integers(1, 127)), draw(st.booleans())
    return Command(
        space=draw(st.integers(0, 7)),
        size=size,
        count=count,
        write=write,
        info=draw(st.booleans()),
        increment=draw(st.booleans()),
        address=draw(st.none() | st.integers(0, 0xFFFF)),
        data=draw(st.binary(min_size=count * size, max_size=count * size)) if write else b"",
    )


@given(st.lists(command_strategy(), max_size=6))
def test_codec_equals_the_reference(commands):
    wire = b"".join(command.wire() for command in commands)
    assert encode(commands, max(1, len(wire))) == wire
    assert decode(wire) == parse(wire) == commands
    assert measure(wire) == reply_size(commands)


@given(st.binary(max_size=64))
def test_any_bytes_parse_as_the_reference_does(packet):
    try:
        expected = parse(packet)
    except (ValueError, struct.error):
        with pytest.raises(ValueError, match="-"):
            decode(packet)
    else:
        assert decode(packet) == expected


def test_what_does_not_fit_leaves_the_packet_alone():
    packet, length = ffi.new("uint8_t[8]"), ffi.new("size_t *")
    write = c_command(Command(0, 4, 2, write=True, address=0))
    assert lib.hm2_lbp16_put(packet, 8, length, write, b"12345678") == lib.HM2_ERR_RANGE
    assert length[0] == 0
    assert bytes(packet) == bytes(8)
    for field, value in (("count", 0), ("count", 128), ("space", 8), ("element_size", 3)):
        bad = c_command(Command(0, 4, 1, address=0))
        setattr(bad, field, value)
        assert lib.hm2_lbp16_put(packet, 8, length, bad, ffi.NULL) == lib.HM2_ERR_RANGE
