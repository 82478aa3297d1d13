"""FPGA image files: Xilinx .bit and Efinix .bin. Fact sheet bitfile.md.

A parser of foreign files: strict, it believes no length. Raises BitfileError and nothing else.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hostmot2.errors import BitfileError
from hostmot2.flash_layout import SYNC_WORD

_XILINX_START: Final = bytes.fromhex("00090ff00ff00ff00ff0000001")
_SYNC_WITHIN: Final = 64
_EFINIX_LABELS: Final = ("Version", "Date", "Project", "Family", "Device", "Width", "Mode", "Padded Bits")
_EFINIX_LINE: Final = 256
_EFINIX_LINES: Final = 20
LARGEST_FILE: Final = 1 << 23
"""More than any card's flash."""


@dataclass(frozen=True)
class Bitfile:
    """An image: what it says of itself, and the bytes for the flash."""

    family: str
    """`xilinx` or `efinix`."""
    part: str
    """The FPGA it is for, such as `6slx9tqg144` or `T20F256`."""
    design: str
    date: str
    time: str
    data: bytes
    """What goes into the flash, bit order unchanged."""
    file_size: int
    warnings: tuple[str, ...] = ()


def read_bitfile(path: str | Path) -> Bitfile:
    """Read and check a file. Raises BitfileError, OSError."""
    with Path(path).open("rb") as file:
        content = file.read(LARGEST_FILE + 1)
    if len(content) > LARGEST_FILE:
        raise BitfileError(f"{path}: a file for the largest flash has at most {LARGEST_FILE} bytes")
    return parse_bitfile(content)


def parse_bitfile(content: bytes) -> Bitfile:
    """Check a file's bytes. Raises BitfileError."""
    if content.startswith(_XILINX_START):
        return _parse_xilinx(content)
    if content.startswith(b"Version"):
        return _parse_efinix(content)
    if content[:4] == b"\xff" * 4:
        raise BitfileError("this is a raw image without a header: nothing tells which FPGA it is for")
    raise BitfileError("neither a Xilinx .bit nor an Efinix .bin file")


def _text(field: bytes, what: str) -> str:
    if not field.endswith(b"\0"):
        raise BitfileError(f"{what} is not terminated")
    try:
        return field[:-1].decode("ascii")
    except UnicodeDecodeError:
        raise BitfileError(f"{what} is not ASCII text") from None


def _fields(content: bytes) -> tuple[dict[str, bytes], bytes]:
    """The tagged fields a to e, and what follows e."""
    fields: dict[str, bytes] = {}
    at = len(_XILINX_START)
    while "e" not in fields:
        tag = content[at : at + 1].decode("latin-1")
        if tag not in "abcde" or tag in fields:
            raise BitfileError(f"no field a to e at byte {at}" if tag else "the file ends before its data")
        size_format = ">I" if tag == "e" else ">H"
        at += 1
        if at + struct.calcsize(size_format) > len(content):
            raise BitfileError(f"the file ends in the length of field {tag}")
        (size,) = struct.unpack_from(size_format, content, at)
        at += struct.calcsize(size_format)
        if size > len(content) - at:
            raise BitfileError(f"field {tag} is {size} bytes long, {len(content) - at} are left")
        fields[tag] = content[at : at + size]
        at += size
    return fields, content[at:]


def _parse_xilinx(content: bytes) -> Bitfile:
    fields, rest = _fields(content)
    if "b" not in fields:
        raise BitfileError("the file does not name its FPGA (field b)")
    data = fields["e"]
    if SYNC_WORD not in data[: _SYNC_WITHIN + len(SYNC_WORD)]:
        raise BitfileError("no sync word AA995566 at the start of the configuration data")
    names = {"a": "design name", "b": "part name", "c": "date", "d": "time"}
    texts = {tag: _text(fields[tag], what) if tag in fields else "" for tag, what in names.items()}
    return Bitfile(
        family="xilinx",
        part=texts["b"],
        design=texts["a"],
        date=texts["c"],
        time=texts["d"],
        data=data,
        file_size=len(content),
        warnings=(f"{len(rest)} bytes follow the configuration data",) if rest else (),
    )


def _parse_efinix(content: bytes) -> Bitfile:
    header: dict[str, str] = {}
    at, last = 0, ""
    for _ in range(_EFINIX_LINES):
        end = content.find(b"\n", at, at + _EFINIX_LINE)
        if end < 0:
            raise BitfileError("the header of an Efinix file is cut short")
        line = content[at:end]
        if not line.isascii():
            break
        label, colon, value = line.decode("ascii").strip("\r").partition(":")
        if colon and label in _EFINIX_LABELS:
            last = label
            header[label] = value.strip()
        elif last == "Project":
            header[last] = line.decode("ascii").strip()
        else:
            break
        at = end + 1
        if label == _EFINIX_LABELS[-1]:
            break
    return _efinix(header, content, at)


def _efinix(header: dict[str, str], content: bytes, at: int) -> Bitfile:
    part = header.get("Device", "").split(" ")[0]
    if not part:
        raise BitfileError("the file does not name its FPGA (Device)")
    if at >= len(content):
        raise BitfileError("the file ends before its data")
    return Bitfile(
        family="efinix",
        part=part,
        design=header.get("Project", ""),
        date=header.get("Date", ""),
        time="",
        data=content[at:],
        file_size=len(content),
    )


def check_part(image: Bitfile, part: str) -> None:
    """The image must be for `part`, or for one of several with bars between. Raises BitfileError."""
    if image.part not in part.split("|"):
        raise BitfileError(f"the image is for {image.part}, the card has {part}")
