"""LBP commands byte for byte: examples of the 8I20 and 7I77 manuals and of lbp_serial.md 4, sserial.md 4."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lbp import crc8 as crc8_bit_by_bit

from hostmot2.lbp import frame

EXAMPLES = [
    (frame.COOKIE, "DF 16"),
    (frame.read_local(0x10), "D0 57"),
    (frame.read_local(0x11), "D1 09"),
    (frame.read_local(0x12), "D2 EB"),
    (frame.read_local(0x13), "D3 B5"),
    (frame.UNIT_NUMBER, "BC 91"),
    (frame.DISCOVERY, "BB 12"),
    (frame.read_local(0x01), "C1 94"),
    (frame.write_local(0x01, 0), "E1 00 B1"),
    (frame.read_local(0x1A), "DA 29"),
    (frame.read_local(0x07), "C7 49"),
    (frame.read_local(0x17), "D7 D4"),
    (frame.write_local(0x07, 0xFF), "E7 FF 2E"),
    (frame.write_local(0x06, 3), "E6 03 3D"),
    (frame.write_local(0x0B, 0x28), "EB 28 B7"),
    (frame.write_local(0x0E, 0x0A), "EE 0A"),
    (frame.read(0x0874, 2), "45 74 08 4B"),
    (frame.write_local(0x0C, 1), "EC 01 66"),
    (frame.read(0x0002, 2), "45 02 00 95"),
    (frame.write_local(0x0C, 0), "EC 00 38"),
    (frame.write(0x0002, b"\xc4\x09"), "65 02 00 C4 09 D7"),
    (frame.write_local(0x0C, 2), "EC 02 84"),
    (frame.read(0x8005, 1), "44 05 80 DC"),
    (frame.read(0x8004, 1), "44 04 80 18"),
    (frame.write(0x8000, bytes([0, 4, 0, 0])), "66 00 80 00 04 00 00 F3"),
    (frame.write(0x8007, b"\xfe"), "64 07 80 FE A0"),
    (frame.read(0x1234, 2), "45 34 12 33"),
    (frame.write(0x1000, b"\xef\xbe"), "65 00 10 EF BE C9"),
    (frame.read(0x3085, 1, increment=True), "4C 85 30 E4"),
    (frame.read(0x3086, 1, increment=True), "4C 86 30 B1"),
    (frame.process_data(bytes.fromhex("9961663013 33F37F0060"), 1), "BD 99 61 66 30 13 33 F3 7F 00 60 62"),
    (frame.process_data(bytes(4), 8), "BD 00 00 00 00 A3"),
]


@pytest.mark.parametrize(("command", "wire"), EXAMPLES, ids=[wire for _, wire in EXAMPLES])
def test_commands_are_the_published_bytes(command: frame.Command, wire: str) -> None:
    expected = bytes.fromhex(wire)
    framed = command.data + bytes([frame.crc8(command.data)])
    assert framed[: len(expected)] == expected


def test_the_manuals_write_and_read_example() -> None:
    """8I20 and 7I77 manuals, "EXAMPLE LBP COMMANDS": the bits of every byte."""
    with_increment = frame.write(0x0010, b"\xaa\xbb\xcc\xdd", increment=True)
    assert [f"{byte:08b}" for byte in with_increment.data] == [
        "01101110",
        "00010000",
        "00000000",
        "10101010",
        "10111011",
        "11001100",
        "11011101",
    ]
    assert frame.write(None, b"\xee\xff").data == bytes([0b01100001, 0b11101110, 0b11111111])
    assert frame.read(0x0010, 8) == frame.Command(bytes([0b01000111, 0b00010000, 0]), 8)


def test_the_manuals_rpc_list() -> None:
    """8I20 manual, "EXAMPLE RPC COMMAND LIST": 7 bytes, called with 3."""
    steps = [frame.rpc_write(0x0010, 2), frame.rpc_read(0x0012, 2)]
    assert frame.rpc_list(steps) == bytes([0b01100101, 0x10, 0, 0b01000101, 0x12, 0, 0])
    assert frame.rpc_sizes(steps) == (2, 2)
    assert frame.rpc(5, b"\x55\xcc", 2).data == bytes([0b10000101, 0b01010101, 0b11001100])


def test_a_stored_write_may_carry_its_own_data() -> None:
    step = frame.rpc_write(0x20, 2, b"\xee\xff")
    assert step.command.data == bytes([0x75, 0x20, 0, 0xEE, 0xFF])
    assert frame.rpc_sizes([step]) == (0, 0)


@pytest.mark.parametrize(
    ("data", "crc"),
    [(bytes([1 << bit]), crc) for bit, crc in enumerate(bytes.fromhex("5E BC 61 C2 9D 23 46 8C"))]
    + [(b"123456789", 0xA1), (b"", 0)],
)
def test_crc8_of_the_sheets(data: bytes, crc: int) -> None:
    assert frame.crc8(data) == crc


@given(st.binary(max_size=64))
def test_crc8_is_that_of_a_shift_register(data: bytes) -> None:
    assert frame.crc8(data) == crc8_bit_by_bit(data)
    assert frame.crc8(data + bytes([frame.crc8(data)])) == 0


@pytest.mark.parametrize("size", [1, 2, 4, 8])
def test_headers_of_all_sizes(size: int) -> None:
    code = [1, 2, 4, 8].index(size)
    assert frame.read(0x100, size).data[0] == 0x44 + code
    assert frame.write(0x100, bytes(size)).data[0] == 0x64 + code
    assert frame.read(None, size).data == bytes([0x40 + code])
    assert frame.write(None, bytes(size), increment=True).data[0] == 0x68 + code


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: frame.read(0, 3),
        lambda: frame.read(0xFFFF, 2),
        lambda: frame.write(-1, b"\0"),
        lambda: frame.read_local(0x20),
        lambda: frame.write_local(0x1F, 0),
        lambda: frame.rpc(64),
        lambda: frame.rpc_write(0, 4, b"\0"),
    ],
)
def test_what_is_no_command_is_refused(wrong) -> None:
    with pytest.raises(ValueError, match=r"outside|not 1, 2, 4 or 8|bytes are not"):
        wrong()
