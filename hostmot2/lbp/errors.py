"""What can go wrong between a serial adapter and a remote."""

from __future__ import annotations

from collections.abc import Sequence

from hostmot2.errors import TransportError
from hostmot2.registers import LbpStatus


class LbpError(TransportError):
    """LBP over a line failed.

    counted: what the line showed so far, see `LineCounters`.
    """

    code = "HM2-E100"
    causes: Sequence[str] = ("cable, adapter or remote: the line did not carry what it should",)
    fix = (
        "`hm2 discover --serial` lists adapters; `hm2 rpd SWREVISION -p PORT` is the smallest question to"
        " a remote."
    )


class LineSilent(LbpError, TimeoutError):
    """The remote did not answer, however often it was asked. A wrong checksum is met with silence, too."""

    code = "HM2-E101"
    causes = (
        "the remote is unpowered",
        "its set-up jumper is not in place, so that it listens at another rate",
        "the adapter's RX and TX pair are swapped, or a pair's polarity",
        "another program on the port eats the answers",
        "the address does not exist in this remote: a wrong one is met with silence, too",
    )
    fix = (
        "Check the remote's power, its set-up jumper (115200 baud), the RX and TX pairs, and that no "
        "other program uses the port."
    )


class WrongAnswer(LbpError):
    """Answers came, but none that can be trusted: checksum, length, surplus bytes, two that differ."""

    code = "HM2-E102"
    causes = (
        "noise: no ground between adapter and remote, no shield, an unterminated pair",
        "a rate that is nearly right",
        "another program that talks on the same line",
    )
    fix = "Check cable, shield, ground and --baud; end other programs on the port."


class RemoteRefused(LbpError):
    """The remote hears well and refuses: its LBP status says why.

    status: the bits.
    """

    code = "HM2-E103"
    causes = (
        "an address that this card or revision does not have",
        "a parameter that may not be written",
        "a memory space that is locked",
    )
    fix = (
        "Check the card's name and revision (`hm2 rpd SWREVISION`), and the parameter's name (`hm2 param "
        "list`)."
    )

    status = LbpStatus(0)


class NotLbp(LbpError):
    """Something answers, but not with LBP's cookie 5A.

    received: what it said.
    """

    code = "HM2-E104"
    causes = (
        "another device hangs on this adapter",
        "the rate is wrong, and what arrives is noise",
        "the adapter echoes what is sent (two-wire RS-485)",
    )
    fix = (
        "Check which adapter it is (`hm2 discover --serial`), the rate, and that the adapter is for four-"
        "wire RS-422."
    )


class AdapterMissing(LbpError):
    """There is no such serial port or USB adapter."""

    code = "HM2-E105"
    causes = (
        "a mistyped name",
        "the adapter is not plugged in, or came back under another number",
        "its chip has no driver in this kernel",
    )
    fix = "`hm2 discover --serial` lists adapters; without a kernel driver use ftdi:///1."


class AdapterBusy(LbpError):
    """Another program uses the adapter."""

    code = "HM2-E106"
    causes = ("another program has the port: a terminal, ModemManager, another hm2",)
    fix = "End the other program: two on one line take each other's answers."


class FirmwareRefused(LbpError):
    """The file, or the remote, is not fit for an update; nothing was changed."""

    code = "HM2-E107"
    causes = (
        "the file is for another card",
        "the remote is not in set-up mode, or an older SSLBP cannot reach its flash",
        "the file is no firmware, or was damaged",
    )
    fix = (
        "Nothing was changed. Check the file's name against the remote's, the set-up jumper, and `hm2 "
        "uflbp --dry-run`."
    )


class UpdateFailed(LbpError):
    """An update ended before its last block.

    block: the first that was not done.
    Block 0, which holds the boot loader, is never touched: the remote still answers and can be updated again.
    """

    code = "HM2-E108"
    index_of = "block"
    causes = (
        "the remote lost its power or its cable",
        "too much noise on the line",
    )
    fix = "Leave the remote powered and repeat the update with --resume."

    block = 0


def status_names(status: int) -> str:
    """The bits of an LBP status byte in words; "clean" for none."""
    words = {
        LbpStatus.CRC_ERROR: "CRC error",
        LbpStatus.WATCHDOG: "watchdog has bitten",
        LbpStatus.BUFFER: "buffer overflow",
        LbpStatus.INVALID_ADDRESS: "invalid address or write",
        LbpStatus.COMMAND_TIMEOUT: "command cut short by a pause",
        LbpStatus.FIFO_TIMEOUT: "FIFO time-out",
    }
    found = [text for bit, text in words.items() if status & bit]
    if status & ~sum(words):
        found.append(f"reserved bits 0x{status & ~sum(words):02X}")
    return ", ".join(found) or "clean"
