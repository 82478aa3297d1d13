"""The exception tree, and the one place where a C status becomes an exception.

Every error the package raises on its own account derives from HostMot2Error and carries its evidence
as attributes. A caller's mistake is a ValueError, TypeError or KeyError.

    HostMot2Error
     +-- TransportError                 the card could not be reached
     |    +-- TransportTimeout            (also TimeoutError)
     |    +-- TransportClosed
     |    +-- ProtocolError
     |    +-- StaleRequest
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
     |         +-- UnalignedModule
     |         +-- IoportMissing
     |         +-- WrongIoportCount
     |         +-- DuplicateModule
     |         +-- UnsupportedModule
     |         +-- WrongPinUnit
     |         +-- DuplicateOutput
     +-- BitfileError                   an FPGA image file is broken or not for this card
     +-- EngineError                    the cycle engine has the board, or does not run
     +-- LiveError                      the live view cannot listen at its address
     +-- SserialError                   a smart-serial port, channel or remote failed

A code (HM2-E0xx) is stable: once given to a class it is never given to another (tests/error_codes.txt).
E010 to E019 transports, E020 to E039 smart serial, E040 to E049 modules at work, E050 to E079 the card's
description, E080 to E089 dumps, E090 to E099 Ethernet cards and their images, E100 to E109 LBP over a serial
line, E110 to E119 recordings and live views, E120 to E129 the cycle engine, E130 to E139 daughter cards.
Every class has its likely causes and what to do beside its code, or inherits them where they are the same; a
module of errors is called `errors`, so that `hm2 explain` finds it.
"""

from __future__ import annotations

from hostmot2.errors.base import (
    NUMBERS,
    BitfileError,
    EngineError,
    HostMot2Error,
    SserialError,
)
from hostmot2.errors.board import (
    BoardError,
    DataLost,
    FaultPresent,
    ModuleMissing,
    ModuleTimeout,
    PinInUse,
    UnsupportedFirmware,
    WatchdogBite,
)
from hostmot2.errors.idrom import (
    ClockHighTooSlow,
    ClockLowTooSlow,
    DuplicateModule,
    DuplicateOutput,
    IdromError,
    IoportMissing,
    IoWidthLimit,
    ModuleListUnterminated,
    ModuleOutOfRange,
    PinListTooShort,
    PinOutOfRange,
    UnalignedModule,
    UnsupportedModule,
    WrongClockTag,
    WrongConfigName,
    WrongCookie,
    WrongIdromOffset,
    WrongIdromType,
    WrongIoportCount,
    WrongIoPorts,
    WrongIoWidth,
    WrongModuleOffset,
    WrongPinOffset,
    WrongPinUnit,
    WrongPortWidth,
    WrongPrimaryTag,
    WrongStrideSelect,
    ZeroStride,
)
from hostmot2.errors.live import LiveError
from hostmot2.errors.status import (
    check,
    evidence,
    new_error,
    text,
)
from hostmot2.errors.transport import (
    BrokenDump,
    CardBusy,
    CardNotFound,
    FirmwareTooOld,
    FlashError,
    KernelLockdown,
    LinkFailed,
    MappingTooSmall,
    NotInDump,
    PermissionDenied,
    ProtocolError,
    ReadOnly,
    StaleRequest,
    TransportClosed,
    TransportError,
    TransportTimeout,
)

__all__ = [
    "NUMBERS",
    "BitfileError",
    "BoardError",
    "BrokenDump",
    "CardBusy",
    "CardNotFound",
    "ClockHighTooSlow",
    "ClockLowTooSlow",
    "DataLost",
    "DuplicateModule",
    "DuplicateOutput",
    "EngineError",
    "FaultPresent",
    "FirmwareTooOld",
    "FlashError",
    "HostMot2Error",
    "IdromError",
    "IoWidthLimit",
    "IoportMissing",
    "KernelLockdown",
    "LinkFailed",
    "LiveError",
    "MappingTooSmall",
    "ModuleListUnterminated",
    "ModuleMissing",
    "ModuleOutOfRange",
    "ModuleTimeout",
    "NotInDump",
    "PermissionDenied",
    "PinInUse",
    "PinListTooShort",
    "PinOutOfRange",
    "ProtocolError",
    "ReadOnly",
    "SserialError",
    "StaleRequest",
    "TransportClosed",
    "TransportError",
    "TransportTimeout",
    "UnalignedModule",
    "UnsupportedFirmware",
    "UnsupportedModule",
    "WatchdogBite",
    "WrongClockTag",
    "WrongConfigName",
    "WrongCookie",
    "WrongIdromOffset",
    "WrongIdromType",
    "WrongIoPorts",
    "WrongIoWidth",
    "WrongIoportCount",
    "WrongModuleOffset",
    "WrongPinOffset",
    "WrongPinUnit",
    "WrongPortWidth",
    "WrongPrimaryTag",
    "WrongStrideSelect",
    "ZeroStride",
    "check",
    "evidence",
    "new_error",
    "text",
]
