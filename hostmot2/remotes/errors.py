"""What can be wrong with what a remote says of itself, or with a parameter written to it."""

from __future__ import annotations

from typing import Any

from hostmot2._core import lib
from hostmot2.errors import SserialError, evidence, text


class BrokenTable(SserialError):
    """A remote's table of contents cannot be right.

    channel, table ("PTOC" or "GTOC"), entry (-1: the table itself), address in the remote, detail (an
    HM2_TOC_ code).
    """

    code = "HM2-E023"
    index_of = "entry"
    causes = (
        "the remote's firmware is faulty, or an own build of a remote",
        "the table was read while its memory was changing",
    )
    fix = (
        "The channel stays stopped, others work. Update the remote's firmware; `hm2 -v` and a report help"
        " to tell which entry is wrong."
    )

    channel = 0
    table = ""
    entry = -1
    detail = 0


class UnsupportedRemote(SserialError):
    """A remote that neither describes itself nor is known by its name."""

    code = "HM2-E024"
    causes = (
        "a remote from before process data could be discovered, other than 8I20 and 7I64",
        "the tables exist in another software mode only",
        "an update of its firmware was broken off",
    )
    fix = "Update the remote's firmware, or write its facts down as a card model of your own."


class VerifyFailed(SserialError):
    """A parameter reads back differently from what was written. expected, received."""

    code = "HM2-E029"
    causes = (
        "the parameter is set by the remote itself",
        "the value is limited or rounded by the remote",
        "noise on the line",
    )
    fix = "Read the parameter again; a value that the remote limits is best written as it reads."


class WrongBackup(SserialError):
    """A backup of parameters that is broken, or of another remote. Nothing was written."""

    code = "HM2-E032"
    causes = (
        "the file is of another remote, or of another unit of the same kind",
        "it was edited, and a name or value is no longer one",
        "it is no backup",
    )
    fix = "Nothing was written. `hm2 param diff FILE` compares; --other-unit lets a file of another unit in."


TABLE_NAMES = {"ptoc": "PTOC", "gtoc": "GTOC"}

TOC_DETAILS = {
    lib.HM2_TOC_POINTER: "the pointer 0x{received:04X} cannot be",
    lib.HM2_TOC_TOO_LONG: "no end after {expected} entries",
    lib.HM2_TOC_LOOP: "the pointer 0x{received:04X} is there twice",
    lib.HM2_TOC_CROSSES_END: "the record runs over the end of memory",
    lib.HM2_TOC_RECORD_TYPE: "record type 0x{received:02X} is neither A0 (data) nor B0 (mode)",
    lib.HM2_TOC_BITS: "{received} bits are not possible for this type (limit {expected})",
    lib.HM2_TOC_DIRECTION: "direction 0x{received:02X} is neither 00, 40 nor 80",
    lib.HM2_TOC_NOT_IN_PTOC: "data type 0x{received:02X} is for parameters only",
    lib.HM2_TOC_PARAMETER_SIZE: "a parameter of {received} bits; 8, 16, 32 and 64 exist",
    lib.HM2_TOC_STRING_END: "a string without an end in {expected} bytes",
    lib.HM2_TOC_NOT_A_NUMBER: "a limit that is not a number (0x{received:08X})",
    lib.HM2_TOC_INFINITE: "an infinite limit (0x{received:08X}) of a type that has none",
    lib.HM2_TOC_LIMITS: "the minimum is above the maximum",
    lib.HM2_TOC_INPUT_BITS: "{received} input bits, where {expected} are transferred",
    lib.HM2_TOC_OUTPUT_BITS: "{received} output bits, where {expected} are transferred",
}


def broken_table(channel: int, error: Any) -> BrokenTable:
    """The exception for a HM2_ERR_FORMAT of the discovery functions."""
    table = TABLE_NAMES.get(text(error.where), text(error.where))
    what = TOC_DETAILS.get(error.detail, "broken").format(expected=error.expected, received=error.received)
    entry = f" entry {error.index}" if error.index >= 0 else ""
    broken = BrokenTable(
        f"channel {channel}: {table}{entry} at 0x{error.address:04X}: {what}", **evidence(error)
    )
    broken.channel, broken.table, broken.entry, broken.detail = channel, table, error.index, error.detail
    return broken
