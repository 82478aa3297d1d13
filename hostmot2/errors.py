"""The exception tree, and the one place where a C status becomes an exception.

Every error the package raises on its own account derives from HostMot2Error and carries its evidence
as attributes. A caller's mistake is a ValueError, TypeError or KeyError.

    HostMot2Error
     +-- TransportError                 the card could not be reached
     |    +-- TransportTimeout            (also TimeoutError)
     |    +-- TransportClosed
     |    +-- ProtocolError
     |    +-- ReadOnly
     |    +-- NotInDump
     |    +-- BrokenDump
     |    +-- CardNotFound
     |    +-- CardBusy
     |    +-- MappingTooSmall
     |    +-- LinkFailed
     |    +-- FirmwareTooOld
     |    +-- FlashError
     |    +-- PermissionDenied            (also PermissionError)
     |         +-- KernelLockdown
     +-- BoardError                     the card's description of itself is wrong or not supported
     |    +-- ModuleMissing
     |    +-- UnsupportedFirmware
     |    +-- PinInUse
     |    +-- WatchdogBite
     |    +-- FaultPresent
     |    +-- ModuleTimeout               (also TimeoutError)
     |    +-- DataLost
     |    +-- IdromError
     |         +-- WrongCookie
     |         +-- WrongConfigName
     |         +-- WrongIdromOffset
     |         +-- WrongIdromType
     |         +-- WrongPortWidth
     |         +-- WrongIoPorts
     |         +-- WrongIoWidth
     |         +-- IoWidthLimit
     |         +-- ClockLowTooSlow
     |         +-- ClockHighTooSlow
     |         +-- WrongPinOffset
     |         +-- PinListTooShort
     |         +-- WrongPrimaryTag
     |         +-- PinOutOfRange
     |         +-- WrongModuleOffset
     |         +-- ModuleListUnterminated
     |         +-- WrongClockTag
     |         +-- WrongStrideSelect
     |         +-- ZeroStride
     |         +-- ModuleOutOfRange
     |         +-- IoportMissing
     |         +-- WrongIoportCount
     |         +-- DuplicateModule
     |         +-- UnsupportedModule
     |         +-- WrongPinUnit
     |         +-- DuplicateOutput
     +-- BitfileError                   an FPGA image file is broken or not for this card
     +-- EngineError                    the cycle engine has the board, or does not run
     +-- SserialError                   a smart-serial port, channel or remote failed

A code (HM2-E0xx) is stable: once given to a class it is never given to another. E010 to E019 transports,
E020 to E039 smart serial, E040 to E049 modules at work, E050 to E079 the card's description,
E080 to E089 dumps, E090 to E099 Ethernet cards and their images, E100 to E109 LBP over a serial line,
E110 to E119 recordings, E120 to E129 the cycle engine.
"""

from __future__ import annotations

import os
from typing import Any, ClassVar

from hostmot2._core import ffi, lib


class HostMot2Error(Exception):
    """Base of every error of this package: what, where, expected and received, what to do.

    code: stable, "HM2-E0xx". fix: what usually helps, one or two sentences.
    """

    code: ClassVar[str] = "HM2-E000"
    fix: ClassVar[str] = ""

    def __init__(
        self,
        message: str,
        *,
        address: int | None = None,
        index: int | None = None,
        expected: int | None = None,
        received: int | None = None,
        os_errno: int | None = None,
    ) -> None:
        super().__init__(message)
        self.address = address
        self.index = index
        self.expected = expected
        self.received = received
        self.os_errno = os_errno

    def __str__(self) -> str:
        return f"{self.code}: {self.args[0]}" if self.args else self.code


class TransportError(HostMot2Error):
    """The card could not be reached."""

    code = "HM2-E010"


class TransportTimeout(TransportError, TimeoutError):
    """No answer before the deadline."""

    code = "HM2-E011"
    fix = "Check power, cable and address; `hm2 doctor` measures the link."


class PermissionDenied(TransportError, PermissionError):
    """The operating system does not let us at the card."""

    code = "HM2-E012"
    fix = "Install the udev rule that `hm2 setup udev` prints and join its group, or run as root."


class CardBusy(TransportError):
    """Another process holds the card."""

    code = "HM2-E013"
    fix = "Only one process may drive a card: end the process named in the message."


class EngineError(HostMot2Error):
    """The cycle engine cannot do that now: it has the board, or it does not run."""

    code = "HM2-E120"
    fix = "While an engine runs, exchange values with it (write, read, frames), or stop() it first."


class TransportClosed(TransportError):
    """The board was used after close()."""

    code = "HM2-E014"


class ProtocolError(TransportError):
    """An answer that cannot be right."""

    code = "HM2-E015"


class ReadOnly(TransportError):
    """A write to a board that can only be read (a dump)."""

    code = "HM2-E016"


class CardNotFound(TransportError):
    """No card, file or transport of that name."""

    code = "HM2-E017"
    fix = "`hm2 discover` lists what can be opened."


class KernelLockdown(PermissionDenied):
    """The kernel forbids mapping the card's memory, whoever asks (Secure Boot lockdown)."""

    code = "HM2-E018"
    fix = (
        "The kernel is locked down (usually by Secure Boot): turn Secure Boot off in the firmware setup, "
        "or boot without lockdown= on the kernel command line. Permissions do not help."
    )


class MappingTooSmall(TransportError):
    """The file or BAR is smaller than the 64 KiB register file."""

    code = "HM2-E019"
    fix = "Name the BAR that holds HostMot2's registers (resource0, 3 or 5 by bridge), or a 64 KiB file."


class LinkFailed(TransportError):
    """Too many exchanges in a row failed: the link was given up (error level at its limit)."""

    code = "HM2-E090"
    fix = (
        "Check cable and network (`hm2 doctor`); the card's watchdog has switched its outputs off. Open the "
        "board again, or clear the link's error level and write the configuration anew."
    )


class FirmwareTooOld(TransportError):
    """The card's Ethernet firmware lacks what is needed."""

    code = "HM2-E091"
    fix = "Newer firmware is needed; `hm2 ip` shows the versions."


class FlashError(TransportError):
    """The card's configuration flash does not hold what it should, or refused to."""

    code = "HM2-E092"
    fix = "The fallback image still boots; write again. Do not reload or power down before a verify is good."


class BitfileError(HostMot2Error):
    """An FPGA image file is broken or not for this card."""

    code = "HM2-E093"
    fix = "Take the image made for exactly this card; a wrong family bricks it."


class SserialError(HostMot2Error):
    """A smart-serial port, channel or remote failed."""

    code = "HM2-E020"


class NotInDump(TransportError):
    """The word was not recorded in the dump (absent on purpose when reading it has side effects)."""

    code = "HM2-E080"


class BrokenDump(TransportError):
    """A line of a dump file is not one; index: the line number."""

    code = "HM2-E081"


class BoardError(HostMot2Error):
    """The card's own description of itself is wrong or not supported."""

    code = "HM2-E050"


class ModuleMissing(BoardError):
    """The card's firmware has no such module, or the card no such daughter card."""

    code = "HM2-E051"
    fix = "`hm2 modules` lists what the loaded firmware contains; another bitfile may have it."


class UnsupportedFirmware(BoardError):
    """The loaded firmware's version of a module cannot do what was asked for."""

    code = "HM2-E042"
    fix = "`hm2 modules` tells the versions; a newer bitfile may be able to."


class PinInUse(BoardError):
    """A pin belongs to somebody else."""

    code = "HM2-E043"
    fix = "`hm2 pins` tells who has which pin."


class WatchdogBite(BoardError):
    """The card's watchdog has let go of all outputs; writes are held back until it is acknowledged."""

    code = "HM2-E041"
    fix = "Find out what kept the host from its exchanges, then call watchdog.acknowledge()."


class FaultPresent(BoardError):
    """Something was to be enabled while its fault input is active; it stays off. index: the instance."""

    code = "HM2-E044"
    fix = "Remove the cause of the fault, check the fault input's polarity, then enable again."


class ModuleTimeout(BoardError, TimeoutError):
    """A module of the card did not finish what it was asked to do."""

    code = "HM2-E045"
    fix = "What hangs on the module may be without power or not there; is the bitfile the one for this card?"


class DataLost(BoardError):
    """A receiver of the card had no room: data was lost. Said once, reading goes on. index: the instance."""

    code = "HM2-E046"
    fix = "Read more often, or make the other side send less at a time."


class IdromError(BoardError):
    """A check of the ID block, the IDROM header or its descriptors failed.

    text: the message, formatted with address, index, expected and received.
    """

    code = "HM2-E052"
    text: ClassVar[str] = "the IDROM is broken at 0x{address:04X}"
    fix = "The firmware in the card is not HostMot2, is damaged, or is newer than this driver."


class WrongCookie(IdromError):
    """The word at 0x0100 is not 0x55AACAFE: no HostMot2 firmware answers there."""

    code = "HM2-E053"
    text = "IO cookie at 0x{address:04X} is 0x{received:08X}, expected 0x{expected:08X}"
    fix = (
        "All ones: memory decoding is off or the card is unpowered. Else: the FPGA is not loaded "
        "with HostMot2."
    )


class WrongConfigName(IdromError):
    """The config name at 0x0104 is not HOSTMOT2."""

    code = "HM2-E054"
    text = "config name word at 0x{address:04X} is 0x{received:08X}, expected 0x{expected:08X} (HOSTMOT2)"


class WrongIdromOffset(IdromError):
    """The IDROM offset at 0x010C points outside the register file or between words."""

    code = "HM2-E055"
    text = "IDROM offset at 0x{address:04X} is 0x{received:X}, not a multiple of 4 up to 0x{expected:X}"


class WrongIdromType(IdromError):
    """The IDROM type is neither 2 nor 3."""

    code = "HM2-E056"
    text = "IDROM type at 0x{address:04X} is 0x{received:X}, expected 2 or 3"


class WrongPortWidth(IdromError):
    """PortWidth differs from the pins per connector of this board (or is not 1 to 32)."""

    code = "HM2-E057"
    text = "IDROM PortWidth at 0x{address:04X} is {received}, expected {expected}"


class WrongIoPorts(IdromError):
    """IOPorts is 0 or differs from the number of connectors of this board."""

    code = "HM2-E058"
    text = "IDROM IOPorts at 0x{address:04X} is {received}, expected {expected}"


class WrongIoWidth(IdromError):
    """IOWidth is not IOPorts times PortWidth."""

    code = "HM2-E059"
    text = "IDROM IOWidth at 0x{address:04X} is {received}, IOPorts times PortWidth is {expected}"


class IoWidthLimit(IdromError):
    """IOWidth is larger than 1000 pins."""

    code = "HM2-E060"
    text = "IDROM IOWidth at 0x{address:04X} is {received}, the limit is {expected}"


class ClockLowTooSlow(IdromError):
    """ClockLow is below 1 MHz."""

    code = "HM2-E061"
    text = "IDROM ClockLow at 0x{address:04X} is {received} Hz, at least {expected} Hz expected"


class ClockHighTooSlow(IdromError):
    """ClockHigh is below 1 MHz."""

    code = "HM2-E062"
    text = "IDROM ClockHigh at 0x{address:04X} is {received} Hz, at least {expected} Hz expected"


class WrongPinOffset(IdromError):
    """The pin descriptors would lie in the header, between words, or outside the register file."""

    code = "HM2-E063"
    text = (
        "IDROM offset to pin descriptors at 0x{address:04X} is 0x{received:X}, not a multiple of 4 "
        "from 0x40 to 0x{expected:X}"
    )


class PinListTooShort(IdromError):
    """A pin descriptor has primary tag 0: the list ends before IOWidth pins."""

    code = "HM2-E064"
    text = (
        "pin descriptor {index} at 0x{address:04X} has primary tag 0: the list ends early, "
        "{expected} pins expected"
    )


class WrongPrimaryTag(IdromError):
    """A pin descriptor's primary tag is not 3 (IOPort)."""

    code = "HM2-E065"
    text = (
        "pin descriptor {index} at 0x{address:04X} has primary tag 0x{received:02X}, expected "
        "0x{expected:02X}"
    )


class PinOutOfRange(IdromError):
    """A pin's bit within its port is beyond the 32 bits of a register."""

    code = "HM2-E066"
    text = "pin {index} would be bit {received} of its port, the highest is {expected}"


class WrongModuleOffset(IdromError):
    """The module descriptors would lie in the header, between words, or outside the register file."""

    code = "HM2-E067"
    text = (
        "IDROM offset to module descriptors at 0x{address:04X} is 0x{received:X}, not a multiple of "
        "4 from 0x40 to 0x{expected:X}"
    )


class ModuleListUnterminated(IdromError):
    """No end tag (gtag 0) where the module descriptors must have ended."""

    code = "HM2-E068"
    text = (
        "no end of the module descriptors: descriptor {index} at 0x{address:04X} should be gtag 0 at "
        "the latest"
    )


class WrongClockTag(IdromError):
    """A module's clock tag is neither 1 (ClockLow) nor 2 (ClockHigh)."""

    code = "HM2-E069"
    text = "module descriptor {index} at 0x{address:04X} has clock tag {received}, expected 1 or 2"


class WrongStrideSelect(IdromError):
    """A module's stride selector is neither 0 nor 1."""

    code = "HM2-E070"
    text = (
        "module descriptor {index} at 0x{address:04X} has stride selectors 0x{received:02X}, each "
        "must be 0 or 1"
    )


class ZeroStride(IdromError):
    """A module uses a stride that is 0, so that its registers or instances would coincide."""

    code = "HM2-E071"
    text = (
        "module descriptor {index} uses the stride at 0x{address:04X}, which is {received}, at least "
        "{expected} expected"
    )


class ModuleOutOfRange(IdromError):
    """A module's registers reach beyond the 64 KiB register file or are not word aligned."""

    code = "HM2-E072"
    text = (
        "module descriptor {index} at 0x{address:04X}: its registers reach 0x{received:X}, the "
        "highest is 0x{expected:X}"
    )


class IoportMissing(IdromError):
    """There is no IOPort module descriptor, so no pin can be switched."""

    code = "HM2-E073"
    text = (
        "none of the {index} module descriptors from 0x{address:04X} on is an IOPort (gtag 0x{expected:02X})"
    )


class WrongIoportCount(IdromError):
    """The IOPort module's instances differ from the header's IOPorts."""

    code = "HM2-E074"
    text = (
        "module descriptor {index} at 0x{address:04X}: {received} IOPort instances, the header says "
        "{expected}"
    )


class DuplicateModule(IdromError):
    """Two module descriptors of one kind."""

    code = "HM2-E075"
    text = (
        "module descriptor {index} at 0x{address:04X} repeats gtag 0x{received:02X} of descriptor {expected}"
    )


class UnsupportedModule(IdromError):
    """A module's version, register count, instance stride or multiple bits are not ones this driver knows."""

    code = "HM2-E076"
    text = (
        "module descriptor {index} at 0x{address:04X}: {what} is 0x{received:X}, this driver knows "
        "0x{expected:X}"
    )
    fix = "open(..., strict=False) leaves the module out and uses the rest of the card."


class WrongPinUnit(IdromError):
    """A pin names an instance its module does not have."""

    code = "HM2-E077"
    text = (
        "pin descriptor {index} at 0x{address:04X} belongs to instance {received} of a module with {expected}"
    )
    fix = "open(..., strict=False) accepts the pin as plain GPIO."


class DuplicateOutput(IdromError):
    """Two pins carry the same output of the same module instance."""

    code = "HM2-E078"
    text = (
        "pin descriptor {index} at 0x{address:04X} (0x{received:08X}) repeats the output already on "
        "pin {expected}"
    )
    fix = "open(..., strict=False) accepts both."


_BY_STATUS: dict[int, type[HostMot2Error]] = {
    lib.HM2_ERR_IO: TransportError,
    lib.HM2_ERR_TIMEOUT: TransportTimeout,
    lib.HM2_ERR_PROTOCOL: ProtocolError,
    lib.HM2_ERR_CLOSED: TransportClosed,
    lib.HM2_ERR_READ_ONLY: ReadOnly,
    lib.HM2_ERR_GATED: WatchdogBite,
    lib.HM2_ERR_LINK: LinkFailed,
    lib.HM2_ERR_ABSENT: NotInDump,
}


def new_error() -> Any:
    """A caller-owned hm2_error for one C call or for many."""
    return ffi.new("hm2_error *")


def check(status: int, error: Any) -> None:
    """Raise the exception that `status` and its evidence stand for; nothing for HM2_OK."""
    if status == lib.HM2_OK:
        return
    where = text(error.where)
    name = text(lib.hm2_status_name(status))
    message = f"{where or 'hostmot2'}: {name}"
    if status == lib.HM2_ERR_CLOSED:
        message = "the board has been closed"
    elif status == lib.HM2_ERR_GATED:
        message = "nothing is written after a watchdog bite until watchdog.acknowledge()"
    else:
        message += f" at 0x{error.address:04X}"
    if error.os_errno:
        message += f" ({os.strerror(error.os_errno)})"
    if status in (lib.HM2_ERR_RANGE, lib.HM2_ERR_ALIGN):
        raise ValueError(message)
    if status == lib.HM2_ERR_NO_MEMORY:
        raise MemoryError(message)
    raise _BY_STATUS.get(status, HostMot2Error)(message, **evidence(error))


def text(c_text: Any) -> str:
    """A NUL-terminated C string as ASCII."""
    raw = ffi.string(c_text)
    return raw if isinstance(raw, str) else raw.decode("ascii")


def evidence(error: Any) -> dict[str, int | None]:
    """What a hm2_error holds, as the keyword arguments of an exception."""
    return {
        "address": error.address,
        "index": None if error.index < 0 else error.index,
        "expected": error.expected,
        "received": error.received,
        "os_errno": error.os_errno or None,
    }
