"""Which register is where on this card, as far as the register description knows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hostmot2.idrom import ModuleDescriptor
from hostmot2.inventory import Inventory
from hostmot2.register_map import Register
from hostmot2.registers import MODULES, Gtag, Id, Idrom


@dataclass(frozen=True, slots=True)
class RegisterAt:
    """A register at its address. module is "id" or "idrom" for what every card has; instance and channel
    are None where the register has only one."""

    address: int
    module: str
    register: Register
    instance: int | None = None
    channel: int | None = None

    @property
    def name(self) -> str:
        """Such as "sserial 0 user1 2": module, instance, register, channel."""
        parts = (self.module, self.instance, self.register.name, self.channel)
        return " ".join(str(part) for part in parts if part is not None)


def registers_of(inventory: Inventory) -> Iterator[RegisterAt]:
    """Every register of the card that the description knows, once for reading and writing if those differ.

    Registers that the module descriptor does not count (optional ones) are left out: on another firmware
    generation their addresses belong to other modules.
    """
    for register in Id.registers:
        yield RegisterAt(register.number, "id", register)
    for register in Idrom.registers:
        yield RegisterAt(inventory.idrom.address + register.number, "idrom", register)
    for module in inventory.modules:
        if module.gtag in MODULES:
            yield from _module_registers(module, _channels(inventory, module))


def _module_registers(module: ModuleDescriptor, channels: int) -> Iterator[RegisterAt]:
    for register in MODULES[module.gtag].registers:
        if register.number >= module.num_registers and module.gtag != Gtag.FANUC:
            continue
        for instance in range(module.instances if _repeats(module, register) else 1):
            for channel in range(channels if register.per_channel else 1):
                yield RegisterAt(
                    module.register_address(register.number, instance, channel),
                    module.name,
                    register,
                    instance if _repeats(module, register) else None,
                    channel if register.per_channel else None,
                )


def _repeats(module: ModuleDescriptor, register: Register) -> bool:
    if module.gtag in (Gtag.SSERIAL, Gtag.SSERIAL_B):
        return True
    return bool(module.multiple >> register.number & 1)


def _channels(inventory: Inventory, module: ModuleDescriptor) -> int:
    """SSERIAL channels have pins: the highest one a pin names, and one more."""
    pins = [pin.secondary_pin & 0x0F for pin in inventory.pins if pin.secondary_gtag == module.gtag]
    return min(max(pins, default=0), 8)


def describe(inventory: Inventory, address: int) -> tuple[RegisterAt, ...]:
    """What is at `address`: nothing, one register, or two when reads and writes differ."""
    return tuple(found for found in registers_of(inventory) if found.address == address)
