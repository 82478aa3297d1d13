"""FPGA image headers: both formats, and every way to be broken."""

from __future__ import annotations

import contextlib
import struct

import pytest
from bitfile_samples import efinix, payload, xilinx
from hypothesis import given
from hypothesis import strategies as st

from hostmot2.bitfile import check_part, parse_bitfile
from hostmot2.errors import BitfileError

DATA = payload(1000)


def test_xilinx_fields():
    image = parse_bitfile(xilinx(DATA))
    assert (image.family, image.part, image.date, image.time) == (
        "xilinx", "6slx9tqg144", "2026/11/22", "12:34:56",
    )  # fmt: skip
    assert image.data == DATA
    assert image.warnings == ()


def test_efinix_fields():
    image = parse_bitfile(efinix(b"\x00\xffimage"))
    assert (image.family, image.part, image.data) == ("efinix", "T20F256", b"\x00\xffimage")
    assert image.design == "/nowhere/made_up.xml"


def test_trailing_bytes_are_a_warning():
    assert parse_bitfile(xilinx(DATA) + b"abc").warnings == ("3 bytes follow the configuration data",)


def test_every_truncation_is_refused():
    whole = xilinx(DATA)
    for end in [*range(100), len(whole) - 1]:
        with pytest.raises(BitfileError):
            parse_bitfile(whole[:end])


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"\xff" * 100, "raw image"),
        (b"PK\x03\x04", "neither"),
        (b"", "neither"),
        (xilinx(DATA, fields="acd"), "does not name its FPGA"),
        (xilinx(DATA, fields="aab"), "no field a to e"),
        (xilinx(b"\xff" * 500), "sync word"),
        (xilinx(b"\xff" * 65 + b"\xaa\x99\x55\x66" + bytes(9)), "sync word"),
        (xilinx(DATA).replace(b"144\0", b"144x"), "not terminated"),
        (xilinx(DATA).replace(b"6slx9", b"6sl\xe99"), "not ASCII"),
        (xilinx(DATA).replace(b"e" + struct.pack(">I", 1000), b"e" + struct.pack(">I", 1001)), "are left"),
        (b"Version: 1\nDate: 2\n\xff\xff\n", "does not name its FPGA"),
        (b"Version: 1\nDevice: T20F256\n", "cut short"),
        (b"Version" + b"x" * 400, "cut short"),
    ],
)
def test_broken_files(content, reason):
    with pytest.raises(BitfileError, match=reason):
        parse_bitfile(content)


def test_part_must_match_exactly_or_be_one_of_several():
    image = parse_bitfile(xilinx(DATA, part="6slx16ftg256"))
    check_part(image, "6slx16ftg256")
    check_part(image, "6slx9ftg256|6slx16ftg256")
    for part in ("6slx9tqg144", "6SLX16FTG256", "T20F256"):
        with pytest.raises(BitfileError, match="the image is for"):
            check_part(image, part)


@given(st.binary(max_size=300), st.integers(0, 200), st.booleans())
def test_no_bytes_break_the_parser(noise, at, use_efinix):
    whole = efinix(DATA) if use_efinix else xilinx(DATA)
    with contextlib.suppress(BitfileError):
        parse_bitfile(whole[:at] + noise + whole[at + len(noise) :])


def test_an_efinix_header_ends_where_it_stops_being_one():
    image = parse_bitfile(b"Version: 1\nDevice: T20F256 C4\nnot a label\n\xff\xfe")
    assert image.data == b"not a label\n\xff\xfe"
    with pytest.raises(BitfileError, match="ends before its data"):
        parse_bitfile(b"Version: 1\nDevice: T20F256 C4\nPadded Bits: 1000\n")
