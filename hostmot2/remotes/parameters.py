"""A remote's parameters by name, in its RAM or its EEPROM. Source: sserial.md 5, 7.1; lbp_serial.md 5, 6.

Any line that reaches a remote's memory will do: the card's setup mode or a serial adapter. Values are what
is in the remote's memory: whole numbers for the integer types, numbers for FLOAT; `scaled` applies the unit.
"""

from __future__ import annotations

import difflib
import operator
import struct
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

from hostmot2.fields import Direction, Field, FieldKind, ParameterField
from hostmot2.registers import LbpSpace
from hostmot2.remotes.errors import VerifyFailed

NONVOLATILE = (FieldKind.NONVOL_UNSIGNED, FieldKind.NONVOL_SIGNED, FieldKind.NONVOL_FLOAT)
_SIGNED = (FieldKind.SIGNED, FieldKind.NONVOL_SIGNED)
_FLOAT = (FieldKind.FLOAT, FieldKind.NONVOL_FLOAT)
_LARGEST_SINGLE = float.fromhex("0x1.fffffep127")
_TYPE_NAMES = {8: ("BYTE", "BYTE"), 16: ("UINT", "INT"), 32: ("ULONG", "LONG"), 64: ("UDOUBLE", "DOUBLE")}

CLEAR_READS = 1000
"""So often a parameter that clears itself is looked at before that counts as a failure."""

Number = int | float


def _plain(value: Number) -> Number:
    """A number of any type as int or float; numpy's are no floats, and compare in their own precision."""
    if isinstance(value, str | bytes):
        raise TypeError(f"a parameter takes a number, not {type(value).__name__}")
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return float(value)


class RemoteMemory(Protocol):
    """A line to the memory of one remote. Values are unsigned, size is 1, 2, 4 or 8 bytes."""

    @property
    def label(self) -> str:
        """Which remote, in a few words."""
        ...

    def read_remote(self, address: int, size: int = 1, *, space: int = 0) -> int:
        """The value at an address of a memory space."""
        ...

    def write_remote(self, address: int, value: int, size: int = 1, *, space: int = 0) -> None:
        """Write a value."""
        ...


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of one remote."""

    memory: RemoteMemory
    field: Field

    @property
    def name(self) -> str:
        """As the remote calls it."""
        return self.field.name

    @property
    def unit(self) -> str:
        """Unit of the scaled value, "" if the remote states none."""
        return self.field.unit

    @property
    def type_name(self) -> str:
        """As the manuals write it: UINT, INT, FLAG, ULONG, LONG, BYTE, DOUBLE, FLOAT, BITS24."""
        kind, bits = self.field.kind, self.field.bits
        if kind in _FLOAT:
            return "FLOAT" if bits == 32 else "FLOAT64"
        if bits not in _TYPE_NAMES:
            return f"BITS{bits}"
        if kind in (FieldKind.BITS, FieldKind.BOOLEAN) and bits == 16:
            return "FLAG"
        return _TYPE_NAMES[bits][kind in _SIGNED]

    @property
    def nonvolatile(self) -> bool:
        """Whether it lies in EEPROM: it takes effect when the remote is powered up next."""
        return self.field.kind in NONVOLATILE

    @property
    def read_only(self) -> bool:
        """Whether only the remote sets it: measured values, revisions."""
        return self.field.direction is Direction.INPUT and not self.nonvolatile

    @property
    def range(self) -> tuple[Number, Number]:
        """The smallest and largest value it can hold."""
        kind, bits = self.field.kind, self.field.bits
        if kind in _FLOAT:
            largest = _LARGEST_SINGLE if bits == 32 else sys.float_info.max
            return -largest, largest
        if kind in _SIGNED:
            return -(1 << bits - 1), (1 << bits - 1) - 1
        return 0, (1 << bits) - 1

    @property
    def limits(self) -> tuple[Number, Number]:
        """The smallest and largest value it may be given: its range, within what is stated of it."""
        low, high = self.range
        field = self.field
        stated = self.nonvolatile or isinstance(field, ParameterField)
        if stated and field.minimum < field.maximum:
            # remotes state their limits as single floats: 2^32 - 1 comes as something near it
            top = high if field.maximum >= high * (1 - 2**-22) else field.maximum
            return max(low, field.minimum), min(high, top)
        return low, high

    def read(self) -> Number:
        """The value in the remote now. Raises what the line raises."""
        return self.decode(self._read())

    def write(self, value: Number) -> bool:
        """Write the value and read it back; False: not written because an EEPROM cell holds it already.

        Raises ValueError outside the limits, VerifyFailed if it reads back differently, errors of the line.
        """
        raw = self.encode(value)
        if self.nonvolatile and self._read() == raw:
            return False
        at = 0
        for size in self._pieces():
            piece = raw >> 8 * at & (1 << 8 * size) - 1
            self.memory.write_remote(self.field.address + at, piece, size, space=self._space)
            at += size
        self._verify(raw)
        return True

    def _verify(self, raw: int) -> None:
        back = self._read()
        if isinstance(self.field, ParameterField) and self.field.clears_itself:
            for _ in range(CLEAR_READS):
                if back == 0:
                    return
                back = self._read()
            raw = 0
        if back != raw:
            raise VerifyFailed(
                f"{self.memory.label}: {self.name} was written as {self.decode(raw)}, "
                f"reads {self.decode(back)}",
                address=self.field.address,
                expected=raw,
                received=back,
            )

    def _read(self) -> int:
        raw, at = 0, 0
        for size in self._pieces():
            raw |= self.memory.read_remote(self.field.address + at, size, space=self._space) << 8 * at
            at += size
        return raw

    def _pieces(self) -> Iterator[int]:
        """Accesses of 8, 4, 2 and 1 bytes that make up its width."""
        left = (self.field.bits + 7) // 8
        for size in (8, 4, 2, 1):
            while left >= size:
                yield size
                left -= size

    @property
    def scaled(self) -> float:
        """The value in its unit, read now."""
        return self.to_unit(self.read())

    def to_unit(self, value: Number) -> float:
        """A value in its unit, by the rules of process data (sserial.md 6); stored values are as they are."""
        field = self.field
        if isinstance(field, ParameterField):
            return value * field.scale if field.scale else float(value)
        scaled = (FieldKind.UNSIGNED, FieldKind.SIGNED)
        if field.kind not in scaled or field.minimum == field.maximum:
            return float(value)
        if field.kind is FieldKind.SIGNED:
            return value * field.maximum / self.range[1]
        return value * (field.maximum - field.minimum) / self.range[1] + field.minimum

    def decode(self, raw: int) -> Number:
        """The value of the bits in memory."""
        kind, bits = self.field.kind, self.field.bits
        if kind in _FLOAT:
            return float(struct.unpack("<f" if bits == 32 else "<d", raw.to_bytes(bits // 8, "little"))[0])
        if kind in _SIGNED and raw >> bits - 1:
            return raw - (1 << bits)
        return raw

    def encode(self, value: Number) -> int:
        """The bits for a value. ValueError outside the limits, TypeError for a fraction of an integer."""
        kind, bits = self.field.kind, self.field.bits
        value = _plain(value)
        if kind not in _FLOAT:
            if isinstance(value, float) and not value.is_integer():
                raise TypeError(f"{self.name} takes whole numbers, not {value}")
            if kind is FieldKind.BOOLEAN and value in (0, 1):
                return (1 << bits) - 1 if value else 0
        low, high = self.limits
        if not low <= value <= high:
            raise ValueError(f"{self.name}: {value} is outside {low:.17g}..{high:.17g}")
        return self.encode_unchecked(value)

    def parse(self, text: str, *, hexadecimal: bool = False) -> Number:
        """The value that a person writes; hexadecimal values are the bits. ValueError, TypeError."""
        if hexadecimal:
            raw = int(text, 16)
            if not 0 <= raw < 1 << self.field.bits:
                raise ValueError(f"{self.name} has {self.field.bits} bits, {text} does not fit")
            value = self.decode(raw)
            self.encode(value)
            return value
        is_float = self.field.kind in _FLOAT
        try:
            number = float(text) if is_float else int(text, 0)
        except ValueError:
            kind = "numbers" if is_float else "whole numbers"
            raise ValueError(f"{self.name} takes {kind}, not {text!r}") from None
        self.encode(number)
        return number

    def format(self, value: Number, *, hexadecimal: bool = False) -> str:
        """A value for people; hexadecimal: the bits, as wide as the parameter."""
        if hexadecimal:
            raw = self.encode_unchecked(value)
            return f"{raw:0{-(-self.field.bits // 4)}X}"
        return f"{value:g}" if isinstance(value, float) else str(value)

    def encode_unchecked(self, value: Number) -> int:
        """The bits of a value that was read, whatever the limits say."""
        if self.field.kind in _FLOAT:
            packed = struct.pack("<f" if self.field.bits == 32 else "<d", value)
            return int.from_bytes(packed, "little")
        return int(value) & (1 << self.field.bits) - 1

    @property
    def _space(self) -> int:
        return LbpSpace.EEPROM if self.nonvolatile else LbpSpace.RAM

    def __repr__(self) -> str:
        kind = self.field.kind.name.lower()
        return (
            f"<Parameter {self.name} {kind} {self.field.bits} bits at 0x{self.field.address:04X} {self.unit}>"
        )


class Parameters(Mapping[str, Number]):
    """The parameters of one remote: `parameters["name"]` reads, assigning writes and verifies.

    Names are found whatever their case. `parameter(name)` gives type, unit and range. aliases: other names.
    """

    def __init__(
        self, memory: RemoteMemory, fields: Iterable[Field], aliases: Mapping[str, str] | None = None
    ) -> None:
        self._parameters = {field.name: Parameter(memory, field) for field in fields}
        self._folded = {name.casefold(): name for name in reversed(self._parameters)}
        for alias, name in (aliases or {}).items():
            if name.casefold() in self._folded:
                self._folded.setdefault(alias.casefold(), self._folded[name.casefold()])
        self._memory = memory

    def parameter(self, name: str) -> Parameter:
        """Type, unit and range of a parameter. Raises KeyError."""
        if name in self._parameters:
            return self._parameters[name]
        try:
            return self._parameters[self._folded[name.casefold()]]
        except KeyError:
            near = difflib.get_close_matches(name.casefold(), self._folded, 3, 0.5)
            hint = f"; did you mean {', '.join(self._folded[found] for found in near)}?" if near else ""
            raise KeyError(f"{self._memory.label} has no parameter {name!r}{hint}") from None

    def __getitem__(self, name: str) -> Number:
        return self.parameter(name).read()

    def __setitem__(self, name: str, value: Number) -> None:
        self.parameter(name).write(value)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (name in self._parameters or name.casefold() in self._folded)

    def __iter__(self) -> Iterator[str]:
        return iter(self._parameters)

    def __len__(self) -> int:
        return len(self._parameters)

    def __repr__(self) -> str:
        return f"<Parameters of {self._memory.label}: {', '.join(self._parameters) or 'none'}>"
