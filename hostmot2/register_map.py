"""Registers and bit fields as data: what `registers.py` is written in.

A register has a number inside its module; its address on a card follows from the module descriptor.
Everything here is immutable and free of I/O, so it may be used from any thread.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class BitField:
    """Bits `lsb` to `lsb + width - 1` of a register."""

    name: str
    lsb: int
    width: int
    readable: bool = True
    writable: bool = True
    unit: str = ""
    description: str = ""

    @property
    def maximum(self) -> int:
        """The largest value that fits."""
        return (1 << self.width) - 1

    @property
    def mask(self) -> int:
        """The field's bits in the register."""
        return self.maximum << self.lsb

    def get(self, word: int) -> int:
        """The field's value in `word`, unsigned."""
        return (word >> self.lsb) & self.maximum

    def put(self, value: int) -> int:
        """`value` at the field's place, all other bits 0. Raises ValueError if it does not fit."""
        if not 0 <= value <= self.maximum:
            raise ValueError(f"{self.name}: {value} is outside 0..{self.maximum}")
        return value << self.lsb

    def replace(self, word: int, value: int) -> int:
        """`word` with the field set to `value`. Raises ValueError if it does not fit."""
        return (word & ~self.mask) | self.put(value)


@dataclass(frozen=True)
class Register:
    """One register: its number in the module, what may be done with it and its fields.

    `access` is "r", "w" or "rw". `per_instance` is the module descriptor's multiple-registers bit;
    `per_channel` registers repeat every four bytes inside an instance. In tables and byte spaces
    (`RegisterMap.stride` 1) the number is the byte offset and `width` may be 8 or 16.
    """

    number: int
    name: str
    access: str
    width: int = 32
    per_instance: bool = False
    per_channel: bool = False
    unit: str = ""
    read_effect: str = ""
    write_effect: str = ""
    description: str = ""
    fields: tuple[BitField, ...] = ()

    @property
    def readable(self) -> bool:
        """Whether a read returns something defined."""
        return "r" in self.access

    @property
    def writable(self) -> bool:
        """Whether a write does something."""
        return "w" in self.access

    def field(self, name: str) -> BitField:
        """The field called `name`. Raises KeyError."""
        for field in self.fields:
            if field.name == name:
                return field
        raise KeyError(f"{self.name} has no field {name!r}")

    def decode(self, word: int) -> dict[str, int]:
        """Every readable field's value, by name."""
        return {field.name: field.get(word) for field in self.fields if field.readable}


@dataclass(frozen=True, slots=True)
class AcceptedDescriptor:
    """The module descriptors a driver accepts for one GTAG.

    An empty `versions` means that nothing about the descriptor is checked.
    """

    gtag: int
    versions: tuple[int, ...]
    faulty_versions: tuple[int, ...]
    fault_note: str
    num_registers: int
    instance_stride: int
    multiple_registers: int


class RegisterMap:
    """The registers of one module, or one table; never instantiated."""

    name: ClassVar[str]
    stride: ClassVar[int]
    size: ClassVar[int] = 0
    descriptor: ClassVar[AcceptedDescriptor | None] = None
    registers: ClassVar[tuple[Register, ...]]

    @classmethod
    def by_number(cls) -> Mapping[int, tuple[Register, ...]]:
        """Registers by number; two when reads and writes of one address differ."""
        numbers: dict[int, tuple[Register, ...]] = {}
        for register in cls.registers:
            numbers[register.number] = (*numbers.get(register.number, ()), register)
        return numbers
