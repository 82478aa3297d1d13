"""What is at an address: module, register, instance and channel, and a word's fields by name.

Everything follows from the card's own descriptors and the register description; nothing is read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hostmot2.idrom import Inventory, ModuleDescriptor
from hostmot2.register_map import Register
from hostmot2.registers import MODULES, Id
from hostmot2.registers import Idrom as IdromRegisters


@dataclass(frozen=True, slots=True)
class Place:
    """A register of this card. instance and channel are None where there is only one."""

    address: int
    module: str
    register: Register
    instance: int | None = None
    channel: int | None = None

    def __str__(self) -> str:
        instance = "" if self.instance is None else f"[{self.instance}]"
        channel = "" if self.channel is None else f" channel {self.channel}"
        return f"{self.module}{instance}.{self.register.name}{channel}"


def places(inventory: Inventory) -> dict[int, tuple[Place, ...]]:
    """Every register this card has, by address: ID block, IDROM header, modules, descriptors excepted."""
    found: dict[int, tuple[Place, ...]] = {}
    for place in _all(inventory):
        found[place.address] = (*found.get(place.address, ()), place)
    return found


def describe(place: Place, word: int) -> str:
    """The word's fields as `name=value`; nothing for a register that is one number."""
    fields = (field for field in place.register.fields if field.readable)
    return " ".join(f"{field.name}={_value(field.get(word), field.width)}" for field in fields)


def _value(value: int, width: int) -> str:
    return str(value) if width <= 4 else f"0x{value:0{(width + 3) // 4}X}"


def _all(inventory: Inventory) -> Iterator[Place]:
    for register in Id.registers:
        yield Place(register.number, "id", register)
    for register in IdromRegisters.registers:
        yield Place(inventory.idrom.address + register.number, "idrom", register)
    for module in inventory.modules:
        yield from _of_module(module)


def _of_module(module: ModuleDescriptor) -> Iterator[Place]:
    known = MODULES.get(module.gtag)
    for register in known.registers if known else ():
        # optional registers are beyond the count, and the card does not say whether it has them
        if register.number >= max(module.num_registers, 1):
            continue
        repeats = module.instances if _repeats(module, register) else 1
        channels = module.instance_stride // 4 if register.per_channel else 1
        for instance in range(repeats):
            for channel in range(channels):
                yield Place(
                    module.register_address(register.number, instance, channel if channels > 1 else 0),
                    module.name,
                    register,
                    instance if module.instances > 1 and repeats > 1 else None,
                    channel if channels > 1 else None,
                )


def _repeats(module: ModuleDescriptor, register: Register) -> bool:
    addresses = {module.register_address(register.number, instance) for instance in range(module.instances)}
    return len(addresses) > 1
