"""What this card contains: the ID block, the IDROM header, module descriptors and pin descriptors.

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
from hostmot2.pin_names import pin_function
from hostmot2.registers import MODULES, Gtag

ReadWords = Callable[[int, int], Sequence[int]]
"""(byte address, number of words) -> words."""


class HostMot2Warning(UserWarning):
    """The card works, but something about it is worth knowing."""


@dataclass(frozen=True, slots=True)
class Idrom:
    """The ID block and the IDROM header.

    Clocks in Hz, strides and offsets in bytes, `address` is where the header lies. fpga_size is in the
    vendor's unit (thousands of gates or logic cells).
    """

    config_name: str
    board_name: str
    address: int
    type: int
    module_offset: int
    pin_offset: int
    fpga_size: int
    fpga_pins: int
    io_ports: int
    io_width: int
    port_width: int
    clock_low: int
    clock_high: int
    instance_strides: tuple[int, int]
    register_strides: tuple[int, int]


@dataclass(frozen=True, slots=True)
class ModuleDescriptor:
    """One module of the loaded firmware, and where its registers are.

    address: of the descriptor itself. multiple: bit r set: register r exists once per instance.
    clock: the clock the module runs on, Hz.
    """

    index: int
    address: int
    gtag: int
    version: int
    clock_tag: int
    clock: int
    instances: int
    base: int
    num_registers: int
    register_stride: int
    instance_stride: int
    multiple: int

    @property
    def name(self) -> str:
        """The module's name, such as "muxed_encoder"; "gtag 0x7F" if unknown."""
        return gtag_name(self.gtag)

    def register_address(self, register: int, instance: int = 0, channel: int = 0) -> int:
        """The byte address of a register.

        channel: the word within the register's port, for registers that span several words per instance
        (interface data of SSERIAL, FIFO ports of BSPI and UART). register may exceed num_registers:
        optional registers are not counted. Raises ValueError for an instance, channel or address that
        cannot be. Source: fact sheet registers 1.4, exceptions included.
        """
        if register < 0:
            raise ValueError(f"{self.name}: no register {register}")
        if not 0 <= instance < max(self.instances, 1):
            raise ValueError(f"{self.name}: instance {instance} of {self.instances}")
        if not 0 <= channel < self._channels(register):
            raise ValueError(f"{self.name}: register {register} has no channel {channel}")
        address = self.base + register * self.register_stride + 4 * channel
        address += instance * self._instance_step(register)
        if not 0 < address <= lib.HM2_ADDRESS_SPACE - 4:
            raise ValueError(f"{self.name}: register {register} would be at 0x{address:X}")
        return address

    def _instance_step(self, register: int) -> int:
        if self.gtag in _SSERIAL:
            return self.instance_stride  # COMMAND and DATA repeat too, though their bits say global
        if self.gtag in _BSPI and register > 0:
            return 4  # only the FIFO port is as wide as the stride
        return self.instance_stride if self.multiple >> register & 1 else 0

    def _channels(self, register: int) -> int:
        if self.gtag in _SSERIAL and register >= 2:
            return self.instance_stride // 4
        if self.gtag in _BSPI and register == 0:
            return 16
        if self.gtag in _UART and register == 0:
            return 4
        return 1


_SSERIAL = (Gtag.SSERIAL, Gtag.SSERIAL_B)
_BSPI = (Gtag.BSPI, Gtag.DBSPI)
_UART = (Gtag.UART_TX, Gtag.UART_RX)


@dataclass(frozen=True, slots=True)
class PinDescriptor:
    """One I/O pin: its place in an IOPort, on a connector, and the module function it can be switched to.

    secondary_gtag 0: GPIO only. shared: the function serves all instances of its module.
    connector is "" and connector_pin None where the board is not in the table.
    """

    index: int
    port: int
    bit: int
    primary_gtag: int
    secondary_gtag: int
    secondary_unit: int
    secondary_pin: int
    connector: str = ""
    connector_pin: int | None = None

    @property
    def shared(self) -> bool:
        """Whether the function belongs to all instances of its module."""
        return bool(self.secondary_unit & 0x80)

    @property
    def is_output(self) -> bool:
        """Whether the module function drives the pin."""
        return bool(self.secondary_gtag and self.secondary_pin & 0x80)

    @property
    def module(self) -> str:
        """The name of the module the pin can be switched to, "" for GPIO only."""
        return gtag_name(self.secondary_gtag) if self.secondary_gtag else ""

    @property
    def function(self) -> str:
        """The module function's name, such as "step" or "tx 2" (channel or number counted from 0)."""
        return pin_function(self.secondary_gtag, self.secondary_pin)

    @property
    def word(self) -> int:
        """The descriptor as it is in the IDROM."""
        return (
            self.primary_gtag << 24
            | self.secondary_unit << 16
            | self.secondary_gtag << 8
            | self.secondary_pin
        )


@dataclass(frozen=True, slots=True)
class Inventory:
    """Everything a card says about itself. board: its row in the board table, None if unknown."""

    idrom: Idrom
    modules: tuple[ModuleDescriptor, ...]
    pins: tuple[PinDescriptor, ...]
    board: boards.BoardFacts | None


def gtag_name(gtag: int) -> str:
    """The lower-case name of a GTAG."""
    try:
        return Gtag(gtag).name.lower()
    except ValueError:
        return f"gtag 0x{gtag:02X}"


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
