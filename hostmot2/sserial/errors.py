"""What can go wrong with a smart-serial port, a channel or a remote."""

from __future__ import annotations

from typing import Any, NoReturn

from hostmot2._core import lib
from hostmot2.errors import SserialError, check, evidence, text


class CommandHung(SserialError, TimeoutError):
    """The firmware never completed a command. All channels are stopped, unless even a reset failed.

    detail: what ended it, one of HM2_SSERIAL_UNJAMMED, _RESET, _DEAD. received: the hung command.
    """

    code = "HM2-E030"
    fix = "Start the channels again; a remote that stays busy during its start causes this, too."

    detail = 0


class NoRemote(SserialError):
    """No remote answered where one was asked for. channels: what each channel showed."""

    code = "HM2-E021"

    channels: tuple[Any, ...] = ()


class RemoteSilent(SserialError, TimeoutError):
    """A remote did not answer an access, or not with a valid checksum. index: channel, received: CS."""

    code = "HM2-E022"
    fix = "A wrong address is not answered either. Check the cable if others fail, too."


class BrokenTable(SserialError):
    """A remote's table of contents cannot be right.

    channel, table ("PTOC" or "GTOC"), entry (-1: the table itself), address in the remote, detail (an
    HM2_TOC_ code).
    """

    code = "HM2-E023"
    fix = "The channel stays stopped, others work. Update the remote's firmware."

    channel = 0
    table = ""
    entry = -1
    detail = 0


class UnsupportedRemote(SserialError):
    """A remote that neither describes itself nor is known by its name."""

    code = "HM2-E024"


class PortRunning(SserialError):
    """Remote memory and discovery need setup mode, which would end the process data of running channels."""

    code = "HM2-E025"
    fix = "stop() the port first; its outputs go off."


class NotStarted(SserialError):
    """The operation needs a started channel."""

    code = "HM2-E026"
    fix = "start(mask) tells which channels started, and why others did not."


class NoFirmware(SserialError):
    """The SSERIAL processor does not answer as SSLBP does."""

    code = "HM2-E027"
    fix = "Load a bitfile with SSLBP firmware; power-cycle the card if its ROM was overwritten."


class NotDiscovered(SserialError):
    """The elements of a channel are not known, because it was started while others ran."""

    code = "HM2-E028"
    fix = "stop() the port, then scan() or start() again."


class VerifyFailed(SserialError):
    """A parameter reads back differently from what was written. expected, received."""

    code = "HM2-E029"


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

_RECOVERED = {
    lib.HM2_SSERIAL_UNJAMMED: "it was aborted and all channels stopped",
    lib.HM2_SSERIAL_RESET: "only a reset of the processor ended it; all channels are stopped",
    lib.HM2_SSERIAL_DEAD: "neither stopping nor resetting the processor helped",
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


def raise_for(status: int, error: Any, port: int) -> NoReturn:
    """Raise what a negative status of a hm2_sserial_ function stands for."""
    where, detail = text(error.where), error.detail
    at = f"smart serial port {port}"
    facts = evidence(error)
    if where.startswith("sserial"):
        if detail in _RECOVERED and status == lib.HM2_ERR_TIMEOUT:
            hung = CommandHung(
                f"{at}: command 0x{error.received:04X} ({where}) never completed; {_RECOVERED[detail]}",
                **facts,
            )
            hung.detail = detail
            raise hung
        if detail == lib.HM2_SSERIAL_MODE_CONFLICT:
            raise PortRunning(f"{at}: channels run in the other mode", **facts)
        if detail == lib.HM2_SSERIAL_NOT_STARTED:
            raise NotStarted(f"{at} channel {error.index}: not started in setup mode", **facts)
        if detail == lib.HM2_SSERIAL_NO_FIRMWARE:
            raise NoFirmware(f"{at}: revision reads 0x{error.received:X} after a reset", **facts)
        if detail == lib.HM2_SSERIAL_REMOTE_SILENT:
            raise RemoteSilent(
                f"{at} channel {error.index}: no valid answer for address 0x{error.address:04X} "
                f"(CS 0x{error.received:08X})",
                **facts,
            )
        if detail == lib.HM2_SSERIAL_TOO_SOON:
            raise SserialError(f"{at}: the last DOIT is still at work, the cycle is too short", **facts)
    check(status, error)
    raise AssertionError("a status of HM2_OK is no error")
