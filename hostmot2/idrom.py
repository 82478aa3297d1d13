"""The facts of an IDROM: its header, module descriptors and pin descriptors.

`inventory.read_inventory` reads and checks them. Source: fact sheet registers 1.2 to 1.8.
"""

from __future__ import annotations

from dataclasses import dataclass

from hostmot2._core import lib
from hostmot2.pin_names import pin_function
from hostmot2.registers import Gtag


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


def gtag_name(gtag: int) -> str:
    """The lower-case name of a GTAG."""
    try:
        return Gtag(gtag).name.lower()
    except ValueError:
        return f"gtag 0x{gtag:02X}"
