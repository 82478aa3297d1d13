"""What can go wrong between a serial adapter and a remote."""

from __future__ import annotations

from hostmot2.errors import TransportError
from hostmot2.registers import LbpStatus


class LbpError(TransportError):
    """LBP over a line failed. counted: what the line showed so far, see `LineCounters`."""

    code = "HM2-E100"


class LineSilent(LbpError, TimeoutError):
    """The remote did not answer, however often it was asked. A wrong checksum is met with silence, too."""

    code = "HM2-E101"
    fix = (
        "Is the remote powered, its set-up jumper in place, the adapter's RX and TX pair not swapped, the "
        "rate 115200? Another program on the port eats answers."
    )


class WrongAnswer(LbpError):
    """Answers came, but none that can be trusted: checksum, length, surplus bytes, two that differ."""

    code = "HM2-E102"
    fix = "Noise or the wrong rate: check cable, shield, ground and BAUDRATE."


class RemoteRefused(LbpError):
    """The remote hears well and refuses: its LBP status says why. status: the bits."""

    code = "HM2-E103"
    fix = "An address that does not exist or may not be written; check the card's name and revision."

    status = LbpStatus(0)


class NotLbp(LbpError):
    """Something answers, but not with LBP's cookie 5A. received: what it said."""

    code = "HM2-E104"


class AdapterMissing(LbpError):
    """There is no such serial port or USB adapter."""

    code = "HM2-E105"
    fix = "hm2 discover --serial lists adapters; without a kernel driver use ftdi:///1."


class AdapterBusy(LbpError):
    """Another program uses the adapter."""

    code = "HM2-E106"
    fix = "End the other program: two on one line take each other's answers."


class FirmwareRefused(LbpError):
    """The file, or the remote, is not fit for an update; nothing was changed."""

    code = "HM2-E107"


class UpdateFailed(LbpError):
    """An update ended before its last block. block: the first that was not done.

    Block 0, which holds the boot loader, is never touched: the remote still answers and can be updated again.
    """

    code = "HM2-E108"
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
