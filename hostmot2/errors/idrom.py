"""Checks of the ID block, the IDROM header and its descriptors: an exception for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from hostmot2.errors.board import BoardError

_LOAD = "Load the bitfile made for this card; `hm2 info` on one that works shows what is normal."


class IdromError(BoardError):
    """A check of the ID block, the IDROM header or its descriptors failed.

    text: the message, formatted with address, index, expected and received.
    """

    code = "HM2-E052"
    index_of = "descriptor"
    text: ClassVar[str] = "the IDROM is broken at 0x{address:04X}"
    causes: Sequence[str] = (
        "the firmware in the card is not HostMot2, or is damaged",
        "it is newer than this driver",
    )
    fix = (
        "Load a HostMot2 bitfile made for this card; a register dump (`hm2 dump`) belongs into a bug report."
    )


class WrongCookie(IdromError):
    """The word at 0x0100 is not 0x55AACAFE: no HostMot2 firmware answers there."""

    code = "HM2-E053"
    text = "IO cookie at 0x{address:04X} is 0x{received:08X}, expected 0x{expected:08X}"
    causes = (
        "all ones: memory decoding is off, the card is unpowered, or nothing is at this address",
        "another word: the FPGA is not loaded, or not with HostMot2",
        "0: a file or device of another kind was opened",
    )
    fix = "Check power and the URL; load the FPGA (`hm2 reload`, or power-cycle) with a HostMot2 bitfile."


class WrongConfigName(IdromError):
    """The config name at 0x0104 is not HOSTMOT2."""

    code = "HM2-E054"
    text = "config name word at 0x{address:04X} is 0x{received:08X}, expected 0x{expected:08X} (HOSTMOT2)"
    causes = (
        "firmware of another make that only shares the cookie",
        "reads that go wrong: power supply, bus, or another process that loads the card",
    )
    fix = "Load a HostMot2 bitfile made for this card."


class WrongIdromOffset(IdromError):
    """The IDROM offset at 0x010C points outside the register file or between words."""

    code = "HM2-E055"
    text = "IDROM offset at 0x{address:04X} is 0x{received:X}, not a multiple of 4 up to 0x{expected:X}"
    causes = (
        "a damaged or hand-made bitfile",
        "single reads that go wrong",
    )
    fix = _LOAD


class WrongIdromType(IdromError):
    """The IDROM type is neither 2 nor 3."""

    code = "HM2-E056"
    text = "IDROM type at 0x{address:04X} is 0x{received:X}, expected 2 or 3"
    causes = (
        "a bitfile newer than this driver",
        "a damaged or hand-made bitfile",
    )
    fix = "Use a bitfile with IDROM type 2 or 3; a register dump of the new one helps to support it."


class WrongPortWidth(IdromError):
    """PortWidth differs from the pins per connector of this board (or is not 1 to 32)."""

    code = "HM2-E057"
    text = "IDROM PortWidth at 0x{address:04X} is {received}, expected {expected}"
    causes = (
        "the bitfile is for another card",
        "the card is new, and the table of boards is wrong about it",
    )
    fix = "Load the bitfile for this card; for a new card give its facts: open(..., board=BoardFacts(...))."


class WrongIoPorts(IdromError):
    """IOPorts is 0 or differs from the number of connectors of this board."""

    code = "HM2-E058"
    text = "IDROM IOPorts at 0x{address:04X} is {received}, expected {expected}"
    causes = (
        "the bitfile is for another card of the family",
        "the card is new, and the table of boards is wrong about it",
    )
    fix = "Load the bitfile for this card; for a new card give its facts: open(..., board=BoardFacts(...))."


class WrongIoWidth(IdromError):
    """IOWidth is not IOPorts times PortWidth."""

    code = "HM2-E059"
    text = "IDROM IOWidth at 0x{address:04X} is {received}, IOPorts times PortWidth is {expected}"
    causes = ("a hand-made bitfile whose constants do not agree",)
    fix = _LOAD


class IoWidthLimit(IdromError):
    """IOWidth is larger than 1000 pins."""

    code = "HM2-E060"
    text = "IDROM IOWidth at 0x{address:04X} is {received}, the limit is {expected}"
    causes = ("a damaged or hand-made bitfile",)
    fix = _LOAD


class ClockLowTooSlow(IdromError):
    """ClockLow is below 1 MHz."""

    code = "HM2-E061"
    text = "IDROM ClockLow at 0x{address:04X} is {received} Hz, at least {expected} Hz expected"
    causes = ("a hand-made bitfile without its clock constants",)
    fix = "Times would be wrong by orders of magnitude: load a bitfile that tells its clocks."


class ClockHighTooSlow(IdromError):
    """ClockHigh is below 1 MHz."""

    code = "HM2-E062"
    text = "IDROM ClockHigh at 0x{address:04X} is {received} Hz, at least {expected} Hz expected"
    causes = ("a hand-made bitfile without its clock constants",)
    fix = "Times would be wrong by orders of magnitude: load a bitfile that tells its clocks."


class WrongPinOffset(IdromError):
    """The pin descriptors would lie in the header, between words, or outside the register file."""

    code = "HM2-E063"
    text = (
        "IDROM offset to pin descriptors at 0x{address:04X} is 0x{received:X}, not a multiple of 4 "
        "from 0x40 to 0x{expected:X}"
    )
    causes = ("a damaged or hand-made bitfile",)
    fix = _LOAD


class PinListTooShort(IdromError):
    """A pin descriptor has primary tag 0: the list ends before IOWidth pins."""

    code = "HM2-E064"
    text = (
        "pin descriptor {index} at 0x{address:04X} has primary tag 0: the list ends early, "
        "{expected} pins expected"
    )
    causes = ("a hand-made bitfile with fewer pin descriptors than pins",)
    fix = _LOAD


class WrongPrimaryTag(IdromError):
    """A pin descriptor's primary tag is not 3 (IOPort)."""

    code = "HM2-E065"
    text = (
        "pin descriptor {index} at 0x{address:04X} has primary tag 0x{received:02X}, expected "
        "0x{expected:02X}"
    )
    causes = ("a damaged or hand-made bitfile",)
    fix = _LOAD


class PinOutOfRange(IdromError):
    """A pin's bit within its port is beyond the 32 bits of a register."""

    code = "HM2-E066"
    index_of = "pin"
    text = "pin {index} would be bit {received} of its port, the highest is {expected}"
    causes = ("a hand-made bitfile with ports wider than a register",)
    fix = _LOAD


class WrongModuleOffset(IdromError):
    """The module descriptors would lie in the header, between words, or outside the register file."""

    code = "HM2-E067"
    text = (
        "IDROM offset to module descriptors at 0x{address:04X} is 0x{received:X}, not a multiple of "
        "4 from 0x40 to 0x{expected:X}"
    )
    causes = ("a damaged or hand-made bitfile",)
    fix = _LOAD


class ModuleListUnterminated(IdromError):
    """No end tag (gtag 0) where the module descriptors must have ended."""

    code = "HM2-E068"
    text = (
        "no end of the module descriptors: descriptor {index} at 0x{address:04X} should be gtag 0 at "
        "the latest"
    )
    causes = ("a hand-made bitfile without the end of its list of modules",)
    fix = _LOAD


class WrongClockTag(IdromError):
    """A module's clock tag is neither 1 (ClockLow) nor 2 (ClockHigh)."""

    code = "HM2-E069"
    text = "module descriptor {index} at 0x{address:04X} has clock tag {received}, expected 1 or 2"
    causes = (
        "a bitfile newer than this driver, with a third clock",
        "a damaged or hand-made bitfile",
    )
    fix = _LOAD


class WrongStrideSelect(IdromError):
    """A module's stride selector is neither 0 nor 1."""

    code = "HM2-E070"
    text = (
        "module descriptor {index} at 0x{address:04X} has stride selectors 0x{received:02X}, each "
        "must be 0 or 1"
    )
    causes = ("a damaged or hand-made bitfile",)
    fix = _LOAD


class ZeroStride(IdromError):
    """A module uses a stride that is 0, so that its registers or instances would coincide."""

    code = "HM2-E071"
    text = (
        "module descriptor {index} uses the stride at 0x{address:04X}, which is {received}, at least "
        "{expected} expected"
    )
    causes = ("a hand-made bitfile without its stride constants",)
    fix = _LOAD


class ModuleOutOfRange(IdromError):
    """A module's registers reach beyond the 64 KiB register file."""

    code = "HM2-E072"
    text = (
        "module descriptor {index} at 0x{address:04X}: its registers reach 0x{received:X}, the "
        "highest is 0x{expected:X}"
    )
    causes = ("a hand-made bitfile with more instances than its address space holds",)
    fix = _LOAD


class UnalignedModule(IdromError):
    """A module's base address or a stride it selects is no multiple of 4: its registers lie between words."""

    code = "HM2-E079"
    text = (
        "module descriptor {index} at 0x{address:04X}: a base or stride of 0x{received:X}, which is no "
        "multiple of {expected}"
    )
    causes = ("a hand-made bitfile whose strides count in bytes or instances",)
    fix = _LOAD


class IoportMissing(IdromError):
    """There is no IOPort module descriptor, so no pin can be switched."""

    code = "HM2-E073"
    index_of = "descriptors"
    text = (
        "none of the {index} module descriptors from 0x{address:04X} on is an IOPort (gtag 0x{expected:02X})"
    )
    causes = ("a hand-made bitfile that leaves the I/O ports out",)
    fix = "No pin could be switched: load a bitfile with I/O ports."


class WrongIoportCount(IdromError):
    """The IOPort module's instances differ from the header's IOPorts."""

    code = "HM2-E074"
    text = (
        "module descriptor {index} at 0x{address:04X}: {received} IOPort instances, the header says "
        "{expected}"
    )
    causes = ("a hand-made bitfile whose constants do not agree",)
    fix = _LOAD


class DuplicateModule(IdromError):
    """Two module descriptors of one kind."""

    code = "HM2-E075"
    text = (
        "module descriptor {index} at 0x{address:04X} repeats gtag 0x{received:02X} of descriptor {expected}"
    )
    causes = ("a hand-made bitfile",)
    fix = "Which of the two is meant cannot be known: load a bitfile that lists each module once."


class UnsupportedModule(IdromError):
    """A module's version, register count, instance stride or multiple bits are not ones this driver knows."""

    code = "HM2-E076"
    text = (
        "module descriptor {index} at 0x{address:04X}: {what} is 0x{received:X}, this driver knows "
        "0x{expected:X}"
    )
    causes = (
        "a bitfile newer than this driver",
        "a bitfile so old that the module had another form",
    )
    fix = "open(..., strict=False) leaves the module out and uses the rest of the card."


class WrongPinUnit(IdromError):
    """A pin names an instance its module does not have."""

    code = "HM2-E077"
    text = (
        "pin descriptor {index} at 0x{address:04X} belongs to instance {received} of a module with {expected}"
    )
    causes = ("a bitfile built with fewer instances than its pins name",)
    fix = "open(..., strict=False) accepts the pin as plain GPIO."


class DuplicateOutput(IdromError):
    """Two pins carry the same output of the same module instance."""

    code = "HM2-E078"
    text = (
        "pin descriptor {index} at 0x{address:04X} (0x{received:08X}) repeats the output already on "
        "pin {expected}"
    )
    causes = ("a bitfile built with the same output on two pins, by mistake or on purpose",)
    fix = "open(..., strict=False) accepts both."
