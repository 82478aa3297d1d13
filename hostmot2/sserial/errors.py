"""What can go wrong with a smart-serial port, a channel or a remote."""

from __future__ import annotations

from typing import Any, NoReturn

from hostmot2._core import lib
from hostmot2.errors import EngineError, SserialError, check, evidence, text
from hostmot2.remotes.errors import BrokenTable, UnsupportedRemote, VerifyFailed

__all__ = [
    "BrokenTable",
    "CommandHung",
    "NoFirmware",
    "NoRemote",
    "NotDiscovered",
    "NotStarted",
    "PortRunning",
    "RemoteSilent",
    "SetupJumper",
    "UnsupportedRemote",
    "VerifyFailed",
    "raise_for",
]


class CommandHung(SserialError, TimeoutError):
    """The firmware never completed a command. All channels are stopped, unless even a reset failed.

    detail: what ended it, one of HM2_SSERIAL_UNJAMMED, _RESET, _DEAD. received: the hung command.
    """

    code = "HM2-E030"
    causes = (
        "a remote that stays busy while it clears its faults: the start then waits for ever",
        "another program wrote the command register at the same time",
        "the processor of the port was stopped or its ROM overwritten",
    )
    fix = (
        "Start the channels again, those with a fault alone; the port, printed, shows where each of them "
        "stands."
    )

    detail = 0


class NoRemote(SserialError):
    """No remote answered where one was asked for.

    channels: what each channel showed.
    """

    code = "HM2-E021"
    causes = (
        "the remote is unpowered: field power, logic supply",
        "5 V does not reach it: cable power jumpers on both cards",
        "the cable: not wired alike at both ends (T568B), or pairs swapped",
        "RX and TX exchanged, or a pair's polarity",
        "the remote's set-up jumper is in place (115200 baud)",
        "the bitfile has this channel on other pins",
    )
    fix = (
        "Go through the causes in this order, then `hm2 sserial scan` again: it names the card's own "
        "terminals where it can."
    )

    channels: tuple[Any, ...] = ()


class SetupJumper(SserialError):
    """A remote answers, but only at 115.2 kbaud: it moves no process data.

    index: the channel.
    """

    code = "HM2-E031"
    causes = (
        "its set-up jumper is in place (7I77: W12 field I/O, W4 analog outputs; 8I20: W6)",
        "its stored baud rate (NVBAUDRATE) is 115200",
    )
    fix = (
        "Move the jumper to operate mode and cycle the remote's power. A stored rate is changed through an "
        "adapter, `hm2 param set NVBAUDRATE 9 --port PORT` (2.5 Mbaud), or in Python through the card: "
        'channel.baud_rate = 115200, channel.discover(), channel.parameters["NVBAUDRATE"] = 9.'
    )


class RemoteSilent(SserialError, TimeoutError):
    """A remote did not answer an access, or not with a valid checksum.

    index: channel, received: CS.
    """

    code = "HM2-E022"
    causes = (
        "the address does not exist in this remote: a wrong one is not answered either",
        "the cable, if other accesses fail, too",
        "the remote was powered off or restarted",
    )
    fix = (
        "Try an address that is known (`hm2 param list`); check the cable and the counters if others "
        "fail, too."
    )


class PortRunning(SserialError):
    """Remote memory and discovery need setup mode, which would end the process data of running channels."""

    code = "HM2-E025"
    causes = (
        "channels of the port move process data: outputs are live",
        "they were started in the other mode",
    )
    fix = "stop() the port first; its outputs go off."


class NotStarted(SserialError):
    """The operation needs a started channel."""

    code = "HM2-E026"
    causes = (
        "start() was not called, or stop() was",
        "start() did not bring the channel up: its result was not looked at",
        "a hung command stopped all channels",
    )
    fix = "start(mask) tells which channels started, and why others did not."


class NoFirmware(SserialError):
    """The SSERIAL processor does not answer as SSLBP does."""

    code = "HM2-E027"
    causes = (
        "the bitfile has the smart-serial module without its program",
        "the program memory was overwritten by a write to the command register",
    )
    fix = "Load a bitfile with SSLBP firmware; power-cycle the card if its ROM was overwritten."


class NotDiscovered(SserialError):
    """The elements of a channel are not known, because it was started while others ran."""

    code = "HM2-E028"
    causes = ("the channel was started while others ran, and looking at it would have stopped them",)
    fix = "stop() the port, then scan() or start() again."


_RECOVERED = {
    lib.HM2_SSERIAL_UNJAMMED: "it was aborted and all channels stopped",
    lib.HM2_SSERIAL_RESET: "only a reset of the processor ended it; all channels are stopped",
    lib.HM2_SSERIAL_DEAD: "neither stopping nor resetting the processor helped",
}


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
        if detail == lib.HM2_SSERIAL_LENT:
            raise EngineError(f"{at}: the cycle engine has the port ({where})", **facts)
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
