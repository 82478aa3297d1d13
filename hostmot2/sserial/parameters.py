"""A remote's parameters by name, in its RAM or its EEPROM. Source: sserial.md 5, 7.1.

They are reached in setup mode only, so never while the port moves process data. Values are what is in the
remote's memory: whole numbers for the integer types, numbers for FLOAT; `scaled` applies the unit.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hostmot2.fields import Field, FieldKind
from hostmot2.registers import LbpSpace
from hostmot2.sserial.errors import VerifyFailed

if TYPE_CHECKING:
    from hostmot2.sserial.channel import Channel

NONVOLATILE = (FieldKind.NONVOL_UNSIGNED, FieldKind.NONVOL_SIGNED, FieldKind.NONVOL_FLOAT)
_SIGNED = (FieldKind.SIGNED, FieldKind.NONVOL_SIGNED)
_FLOAT = (FieldKind.FLOAT, FieldKind.NONVOL_FLOAT)

Number = int | float


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of one remote."""

    channel: Channel
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
    def nonvolatile(self) -> bool:
        """Whether it lies in EEPROM: it takes effect when the remote is powered up next."""
        return self.field.kind in NONVOLATILE

    @property
    def range(self) -> tuple[Number, Number]:
        """The smallest and largest value it can hold."""
        kind, bits = self.field.kind, self.field.bits
        if kind in _FLOAT:
            return -math.inf, math.inf
        if kind in _SIGNED:
            return -(1 << bits - 1), (1 << bits - 1) - 1
        return 0, (1 << bits) - 1

    def read(self) -> Number:
        """The value in the remote now. Raises PortRunning, RemoteSilent."""
        size = self.field.bits // 8
        return self.decode(self.channel.read_remote(self.field.address, size, space=self._space))

    def write(self, value: Number) -> None:
        """Write the value and read it back. An EEPROM cell that holds it already is not written again.

        Raises ValueError outside the range (of a non-volatile parameter also outside the limits that the
        remote states), PortRunning, RemoteSilent, and VerifyFailed if it reads back differently.
        """
        raw = self.encode(value)
        size, address = self.field.bits // 8, self.field.address
        if self.nonvolatile and self.channel.read_remote(address, size, space=self._space) == raw:
            return
        self.channel.write_remote(address, raw, size, space=self._space)
        back = self.channel.read_remote(address, size, space=self._space)
        if back != raw:
            raise VerifyFailed(
                f"{self.channel.label}: {self.name} was written as {value}, reads {self.decode(back)}",
                address=address,
                index=self.channel.number,
                expected=raw,
                received=back,
            )

    @property
    def scaled(self) -> float:
        """The value in its unit, by the rules of process data (sserial.md 6)."""
        value, field = self.read(), self.field
        if field.kind in _FLOAT or field.minimum == field.maximum:
            return float(value)
        return value * field.maximum / self.range[1]

    def decode(self, raw: int) -> Number:
        """The value of the bits in memory."""
        kind, bits = self.field.kind, self.field.bits
        if kind in _FLOAT:
            return float(struct.unpack("<f" if bits == 32 else "<d", raw.to_bytes(bits // 8, "little"))[0])
        if kind in _SIGNED and raw >> bits - 1:
            return raw - (1 << bits)
        return raw

    def encode(self, value: Number) -> int:
        """The bits for a value. ValueError outside the range, TypeError for a fraction of an integer."""
        kind, bits = self.field.kind, self.field.bits
        if kind in _FLOAT:
            packed = struct.pack("<f" if bits == 32 else "<d", value)
            return int.from_bytes(packed, "little")
        if kind is FieldKind.BOOLEAN:
            return (1 << bits) - 1 if value else 0
        if isinstance(value, float) and not value.is_integer():
            raise TypeError(f"{self.name} takes whole numbers, not {value}")
        low, high = self._limits()
        if not low <= value <= high:
            raise ValueError(f"{self.name}: {value} is outside {low:g}..{high:g}")
        return int(value) & (1 << bits) - 1

    def _limits(self) -> tuple[Number, Number]:
        low, high = self.range
        field = self.field
        if not self.nonvolatile or field.minimum >= field.maximum:
            return low, high
        # the remote states its limits as single floats: 2^32 - 1 comes as something near it
        stated = high if field.maximum >= high * (1 - 2**-22) else field.maximum
        return max(low, field.minimum), min(high, stated)

    @property
    def _space(self) -> int:
        return LbpSpace.EEPROM if self.nonvolatile else LbpSpace.RAM

    def __repr__(self) -> str:
        kind = self.field.kind.name.lower()
        return (
            f"<Parameter {self.name} {kind} {self.field.bits} bits at 0x{self.field.address:04X} {self.unit}>"
        )


class Parameters(Mapping[str, Number]):
    """The parameters of a channel's remote: `parameters["name"]` reads, assigning writes and verifies.

    Names are found whatever their case. `parameter(name)` gives type, unit and range.
    """

    def __init__(self, channel: Channel, fields: tuple[Field, ...]) -> None:
        self._parameters = {field.name: Parameter(channel, field) for field in fields}
        self._folded = {name.casefold(): name for name in reversed(self._parameters)}
        self._channel = channel

    def parameter(self, name: str) -> Parameter:
        """Type, unit and range of a parameter. Raises KeyError."""
        if name in self._parameters:
            return self._parameters[name]
        try:
            return self._parameters[self._folded[name.casefold()]]
        except KeyError:
            raise KeyError(f"{self._channel.label} has no parameter {name!r}") from None

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
        return f"<Parameters of {self._channel.label}: {', '.join(self._parameters) or 'none'}>"
