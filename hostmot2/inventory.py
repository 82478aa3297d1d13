"""What this card contains: the ID block, the IDROM and its descriptors, read and checked.

The words are parsed and checked in C (csrc/idrom.c); here they become frozen facts or exceptions.
Source: fact sheet registers 1.2 to 1.8.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hostmot2 import boards, errors
from hostmot2._core import ffi, lib
from hostmot2.idrom import HostMot2Warning, Idrom, ModuleDescriptor, PinDescriptor
from hostmot2.registers import MODULES, Gtag

ReadWords = Callable[[int, int], Sequence[int]]
"""(byte address, number of words) -> words."""


@dataclass(frozen=True, slots=True)
class Inventory:
    """Everything a card says about itself. board: its row in the board table, None if unknown."""

    idrom: Idrom
    modules: tuple[ModuleDescriptor, ...]
    pins: tuple[PinDescriptor, ...]
    board: boards.BoardFacts | None


def read_inventory(
    read: ReadWords, *, model: str | None = None, board: boards.BoardFacts | None = None, strict: bool = True
) -> Inventory:
    """Read and check what the card contains.

    model: the board's name as the transport knows it; board: its facts, if the caller knows better. Only a
    known board's port count and width are checked against the table. strict=False turns unsupported module
    forms (the module is left out), wrong pin units and repeated outputs into warnings.

    Raises a subclass of IdromError for a broken IDROM, and whatever `read` raises.
    """
    c_idrom: Any = ffi.new("hm2_idrom *")
    board = _read_header(read, c_idrom, model, board)
    c_pins = _read_pins(read, c_idrom)
    c_modules, count = _read_modules(read, c_idrom)
    modules, count = _check_modules(c_idrom, c_modules, count, strict)
    _check_pins(c_idrom, c_modules, count, c_pins, strict)
    _warn_of_unknown(modules)
    pins = tuple(_pin(index, c_pins[index], c_idrom, board) for index in range(c_idrom.io_width))
    return Inventory(_idrom(c_idrom), modules, pins, board)


def _read_header(
    read: ReadWords, c_idrom: Any, model: str | None, board: boards.BoardFacts | None
) -> boards.BoardFacts | None:
    error = errors.new_error()
    _check(lib.hm2_idrom_parse_id(read(lib.HM2_ID_ADDRESS, lib.HM2_ID_WORDS), c_idrom, error), error)
    # the type first: the words behind it mean nothing if it is wrong
    _check(lib.hm2_idrom_check_type(c_idrom, read(c_idrom.offset, 1)[0], error), error)
    words = read(c_idrom.offset, lib.HM2_IDROM_HEADER_WORDS)
    unknown = lib.HM2_IDROM_NONE
    if board is None:
        board = boards.find(model or _board_name_of(words), port_width=words[9], io_ports=words[7])
    width, ports = (board.port_width, board.io_ports) if board else (unknown, unknown)
    _check(lib.hm2_idrom_parse_header(words, width, ports, c_idrom, error), error)
    if board is None:
        name = model or _text(c_idrom.board_name)
        warnings.warn(f"board {name!r} is not in the table: pins have no connector names", HostMot2Warning, 4)
    return board


def _board_name_of(words: Sequence[int]) -> str:
    return b"".join(word.to_bytes(4, "little") for word in words[3:5]).decode("latin-1").rstrip("\0 ")


def _read_pins(read: ReadWords, c_idrom: Any) -> Any:
    error = errors.new_error()
    count = c_idrom.io_width
    _check(lib.hm2_idrom_check_pin_offset(c_idrom, error), error)
    words = read(c_idrom.offset + c_idrom.pin_offset, count)
    c_pins = ffi.new("hm2_pin_descriptor[]", count)
    _check(lib.hm2_idrom_parse_pins(c_idrom, words, count, c_pins, count, error), error)
    return c_pins


def _read_modules(read: ReadWords, c_idrom: Any) -> tuple[Any, int]:
    error = errors.new_error()
    size, count = ffi.new("size_t *"), ffi.new("size_t *")
    _check(lib.hm2_idrom_check_module_offset(c_idrom, size, error), error)
    words = read(c_idrom.offset + c_idrom.module_offset, size[0])
    capacity = lib.HM2_IDROM_MODULES_MAX
    c_modules = ffi.new("hm2_module_descriptor[]", capacity)
    _check(lib.hm2_idrom_parse_modules(c_idrom, words, size[0], c_modules, capacity, count, error), error)
    return c_modules, int(count[0])


def _check_modules(
    c_idrom: Any, c_modules: Any, count: int, strict: bool
) -> tuple[tuple[ModuleDescriptor, ...], int]:
    error = errors.new_error()
    _check(lib.hm2_idrom_check_modules(c_idrom, c_modules, count, error), error)
    modules = []
    for index in range(count):
        try:
            _check(lib.hm2_idrom_check_form(c_modules, index, error), error)
        except errors.UnsupportedModule as finding:
            if strict:
                raise
            warnings.warn(f"{finding}; left out", HostMot2Warning, 5)
        else:
            modules.append(_module(index, c_modules[index]))
    return tuple(modules), count


def _check_pins(c_idrom: Any, c_modules: Any, count: int, c_pins: Any, strict: bool) -> None:
    error = errors.new_error()
    first = 0
    while first < c_idrom.io_width:
        try:
            _check(
                lib.hm2_idrom_check_pins(c_idrom, c_modules, count, c_pins, c_idrom.io_width, first, error),
                error,
            )
        except (errors.WrongPinUnit, errors.DuplicateOutput) as finding:
            if strict or finding.index is None:
                raise
            warnings.warn(str(finding), HostMot2Warning, 5)
            first = finding.index + 1
        else:
            return


def _warn_of_unknown(modules: Sequence[ModuleDescriptor]) -> None:
    known = {int(gtag) for gtag in Gtag}
    for module in modules:
        if module.gtag not in known:
            warnings.warn(
                f"module descriptor {module.index}: unknown gtag 0x{module.gtag:02X}, not used",
                HostMot2Warning,
                5,
            )
        accepted = getattr(MODULES.get(module.gtag), "descriptor", None)
        if accepted is not None and module.version in accepted.faulty_versions:
            warnings.warn(
                f"{module.name} version {module.version}: {accepted.fault_note}", HostMot2Warning, 5
            )


def _idrom(c: Any) -> Idrom:
    return Idrom(
        config_name=_text(c.config_name),
        board_name=_text(c.board_name),
        address=c.offset,
        type=c.type,
        module_offset=c.module_offset,
        pin_offset=c.pin_offset,
        fpga_size=c.fpga_size,
        fpga_pins=c.fpga_pins,
        io_ports=c.io_ports,
        io_width=c.io_width,
        port_width=c.port_width,
        clock_low=c.clock_low,
        clock_high=c.clock_high,
        instance_strides=(c.instance_stride[0], c.instance_stride[1]),
        register_strides=(c.register_stride[0], c.register_stride[1]),
    )


def _module(index: int, c: Any) -> ModuleDescriptor:
    return ModuleDescriptor(
        index=index,
        address=c.address,
        gtag=c.gtag,
        version=c.version,
        clock_tag=c.clock_tag,
        clock=c.clock,
        instances=c.instances,
        base=c.base,
        num_registers=c.registers,
        register_stride=c.register_stride,
        instance_stride=c.instance_stride,
        multiple=c.multiple,
    )


def _pin(index: int, c: Any, c_idrom: Any, board: boards.BoardFacts | None) -> PinDescriptor:
    port, bit = divmod(index, c_idrom.port_width)
    connector, connector_pin = board.connector_pin(index) if board else ("", None)
    return PinDescriptor(
        index=index,
        port=port,
        bit=bit,
        primary_gtag=c.primary_tag,
        secondary_gtag=c.secondary_tag,
        secondary_unit=c.secondary_unit,
        secondary_pin=c.secondary_pin,
        connector=connector,
        connector_pin=connector_pin,
    )


def _text(c_text: Any) -> str:
    return errors.text(c_text).rstrip()


_BROKEN: dict[int, type[errors.IdromError]] = {
    lib.HM2_BROKEN_COOKIE: errors.WrongCookie,
    lib.HM2_BROKEN_CONFIG_NAME: errors.WrongConfigName,
    lib.HM2_BROKEN_OFFSET: errors.WrongIdromOffset,
    lib.HM2_BROKEN_TYPE: errors.WrongIdromType,
    lib.HM2_BROKEN_PORT_WIDTH: errors.WrongPortWidth,
    lib.HM2_BROKEN_IO_PORTS: errors.WrongIoPorts,
    lib.HM2_BROKEN_IO_WIDTH: errors.WrongIoWidth,
    lib.HM2_BROKEN_IO_WIDTH_LIMIT: errors.IoWidthLimit,
    lib.HM2_BROKEN_CLOCK_LOW: errors.ClockLowTooSlow,
    lib.HM2_BROKEN_CLOCK_HIGH: errors.ClockHighTooSlow,
    lib.HM2_BROKEN_PIN_OFFSET: errors.WrongPinOffset,
    lib.HM2_BROKEN_PIN_LIST_SHORT: errors.PinListTooShort,
    lib.HM2_BROKEN_PIN_PRIMARY_TAG: errors.WrongPrimaryTag,
    lib.HM2_BROKEN_PIN_RANGE: errors.PinOutOfRange,
    lib.HM2_BROKEN_MODULE_OFFSET: errors.WrongModuleOffset,
    lib.HM2_BROKEN_MODULE_LIST_UNTERMINATED: errors.ModuleListUnterminated,
    lib.HM2_BROKEN_MODULE_CLOCK_TAG: errors.WrongClockTag,
    lib.HM2_BROKEN_MODULE_STRIDE_SELECT: errors.WrongStrideSelect,
    lib.HM2_BROKEN_MODULE_STRIDE_ZERO: errors.ZeroStride,
    lib.HM2_BROKEN_MODULE_RANGE: errors.ModuleOutOfRange,
    lib.HM2_BROKEN_MODULE_ALIGNMENT: errors.UnalignedModule,
    lib.HM2_BROKEN_IOPORT_MISSING: errors.IoportMissing,
    lib.HM2_BROKEN_IOPORT_COUNT: errors.WrongIoportCount,
    lib.HM2_BROKEN_MODULE_DUPLICATE: errors.DuplicateModule,
    lib.HM2_BROKEN_MODULE_VERSION: errors.UnsupportedModule,
    lib.HM2_BROKEN_MODULE_REGISTERS: errors.UnsupportedModule,
    lib.HM2_BROKEN_MODULE_INSTANCE_STRIDE: errors.UnsupportedModule,
    lib.HM2_BROKEN_MODULE_MULTIPLE: errors.UnsupportedModule,
    lib.HM2_BROKEN_PIN_UNIT: errors.WrongPinUnit,
    lib.HM2_BROKEN_PIN_DUPLICATE_OUTPUT: errors.DuplicateOutput,
}

_FORM: dict[int, str] = {
    lib.HM2_BROKEN_MODULE_VERSION: "version",
    lib.HM2_BROKEN_MODULE_REGISTERS: "number of registers",
    lib.HM2_BROKEN_MODULE_INSTANCE_STRIDE: "instance stride",
    lib.HM2_BROKEN_MODULE_MULTIPLE: "multiple-registers bits",
}


def _check(status: int, error: Any) -> None:
    """Raise the exception of the broken IDROM that `error` describes; nothing for HM2_OK."""
    if status != lib.HM2_ERR_FORMAT:
        errors.check(status, error)
        return
    kind = _BROKEN[error.detail]
    facts = errors.evidence(error)
    raise kind(kind.text.format(what=_FORM.get(error.detail, ""), **facts), **facts)
