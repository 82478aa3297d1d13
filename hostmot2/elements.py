"""Process data by name: the elements of one channel in one direction, in engineering units."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
import numpy.typing as npt

from hostmot2._core import lib
from hostmot2.bulk import Columns, Records, decode
from hostmot2.errors import check, new_error
from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.layout import COUNTERS, Scaling, table

if TYPE_CHECKING:
    from hostmot2.process_data import ProcessData


class Bits(int):
    """A word of independent bits, as read: an int with `word[3]`, `len(word)` and iteration, bit 0 first.

    From an output, `outputs["output"][3] = True` changes that bit of the output and no other; the int
    itself stays what was read.
    """

    width: int
    _assign: Callable[[int, bool], None] | None

    def __new__(cls, value: int, width: int, assign: Callable[[int, bool], None] | None = None) -> Bits:
        """`assign(bit, value)` carries out the assignment of a single bit."""
        self = super().__new__(cls, value)
        self.width = width
        self._assign = assign
        return self

    def _position(self, bit: int) -> int:
        if not -self.width <= bit < self.width:
            raise IndexError(f"bit {bit} of a word of {self.width} bits")
        return bit % self.width

    def __getitem__(self, bit: int) -> bool:
        return bool(self >> self._position(bit) & 1)

    def __setitem__(self, bit: int, value: bool) -> None:
        if self._assign is None:
            raise TypeError("the bits of an input cannot be assigned")
        if isinstance(value, str | bytes):  # "off" is true
            raise TypeError(f"a bit takes True or False, not {type(value).__name__}")
        self._assign(self._position(bit), bool(value))

    def __len__(self) -> int:
        return self.width

    def __iter__(self) -> Iterator[bool]:
        return (bool(self >> bit & 1) for bit in range(self.width))

    def __repr__(self) -> str:
        return f"0x{int(self):0{-(-self.width // 4)}X}"


Value = float | bool | int | Bits


class _Names(dict[str, int]):
    """Element names as the remote spells them, found in any capitals."""

    def __init__(self, names: Iterable[tuple[str, int]]) -> None:
        super().__init__(names)
        self._folded = {name.casefold(): index for name, index in self.items()}

    def __missing__(self, name: str) -> int:
        return self._folded[name.casefold()]


class _Retired(_Names):
    """No names any more: every use raises."""

    def __init__(self, error: Exception) -> None:
        super().__init__(())
        self._error = error

    def _raise(self) -> NoReturn:
        raise self._error.with_traceback(None)  # else it grows with each use

    def __missing__(self, name: str) -> int:
        self._raise()

    def __iter__(self) -> Iterator[str]:
        self._raise()

    def __len__(self) -> int:
        self._raise()


class Elements(Mapping[str, Value]):
    """The elements of one channel in one direction, by name, as they stand at the moment of the access.

    BITS are `Bits`, STREAM int, BOOLEAN bool, everything else float in the element's unit; a counter is its
    position, count / scale. Names are found in any capitals; an unknown one is a KeyError.
    """

    def __init__(self, process_data: ProcessData, channel: int, direction: Direction) -> None:
        self._data = process_data
        self._channel = channel
        self._direction = direction
        self._index = _Names(
            (element.name, index)
            for index, (owner, element) in enumerate(process_data._elements)
            if owner == channel and element.direction is direction and element.is_visible
        )

    def retire(self, error: Exception) -> None:
        """From now on every use raises `error`."""
        self._index = _Retired(error)

    def __getitem__(self, name: str) -> Value:
        index = self._index[name]
        field = self._data._elements[index][1].field
        if field.kind is FieldKind.BITS:
            return Bits(self._data._raw[index], field.bits)
        if field.kind is FieldKind.STREAM:
            return int(self._data._raw[index])
        if field.kind is FieldKind.BOOLEAN:
            return self._data._values[index] != 0.0
        return float(self._data._values[index])

    def __iter__(self) -> Iterator[str]:
        return iter(self._index)

    def __len__(self) -> int:
        return len(self._index)

    def field(self, name: str) -> Field:
        """The declaration of an element."""
        return self._data._elements[self._index[name]][1].field

    def index(self, name: str) -> int:
        """Where an element lies in `ProcessData.values` and `ProcessData.raw`."""
        return self._index[name]

    def raw(self, name: str) -> int:
        """The element's bits as they are in the registers; of a counter the count, signed.

        While a cycle engine runs only BITS, STREAM and counters are kept up to date.
        """
        raw = int(self._data._raw[self._index[name]])
        if self.field(name).kind in COUNTERS and raw >> 63:
            return raw - (1 << 64)
        return raw

    def scaling(self, name: str) -> Scaling:
        """Full scale, limits and inversion in use."""
        return self._data._scalings[self._index[name]]

    def configure(
        self,
        name: str,
        *,
        scale: float | None = None,
        low: float | None = None,
        high: float | None = None,
        invert: int | None = None,
    ) -> None:
        """Change full scale, limits (both in the element's unit) or inversion; what is None stays.

        Takes effect at the next exchange. ValueError: low > high, or a limit that is not a number.
        EngineError: a cycle engine runs.
        """
        old = self.scaling(name)
        new = Scaling(
            old.scale if scale is None else float(scale),
            old.low if low is None else float(low),
            old.high if high is None else float(high),
            old.invert if invert is None else int(invert),
        )
        self._data._configure(self._index[name], new)

    def decode(
        self,
        records: Records,
        *,
        dtype: npt.DTypeLike = np.float64,
        out: Mapping[str, npt.NDArray[Any]] | None = None,
    ) -> Columns:
        """Recorded registers of this channel alone, [record, register], to one column per element.

        See `bulk.decode`.
        """
        sources = self._data._sources(self._channel, self._direction, 0, "")
        return decode(sources, records, (1, self._data.input_image.shape[1]), dtype, out)

    def __repr__(self) -> str:
        rows = [("element", "value", "unit", "raw", "kind", "bits")]
        for name in self:
            field, value = self.field(name), self[name]
            text = repr(value) if isinstance(value, Bits | bool) else f"{value:.6g}"
            raw = str(self.raw(name)) if field.kind in COUNTERS else f"{self.raw(name):X}"
            rows.append((name, text, field.unit, raw, field.kind.name, str(field.bits)))
        return f"channel {self._channel} {self._direction.name.lower()}s\n" + table(rows)


class Inputs(Elements):
    """What a remote reports. See `Elements`."""

    def zero(self, name: str) -> None:
        """Let a counter start from 0 at its present position. TypeError: not a counter."""
        if self.field(name).kind not in COUNTERS:
            raise TypeError(f"{name} is not a counter")
        error, data = new_error(), self._data.stand_in or self._data
        check(lib.hm2_process_data_zero(data._plan, self._index[name], error), error)


class Outputs(Elements):
    """What is commanded to a remote, sent by the next exchange. See `Elements`.

    Assign numbers in the element's unit: they are clamped to the limits when packed, NaN is sent as 0
    (FLOAT: as NaN). BITS and STREAM take an int of their width (ValueError if it does not fit).
    """

    def __getitem__(self, name: str) -> Value:
        value = super().__getitem__(name)
        if isinstance(value, Bits):
            return Bits(value, value.width, partial(self._assign_bit, name))
        return value

    def __setitem__(self, name: str, value: float) -> None:
        array, index, checked = self._place(name, value)
        array[index] = checked

    def update(self, values: Mapping[str, float]) -> None:
        """Assign several elements. KeyError, TypeError, ValueError before anything is assigned."""
        places = [self._place(name, value) for name, value in values.items()]
        for array, index, checked in places:
            array[index] = checked

    def _place(self, name: str, value: float) -> tuple[Any, int, float]:
        """Where a value goes, and as what."""
        index = self._index[name]
        field = self._data._elements[index][1].field
        if isinstance(value, str | bytes):
            raise TypeError(f"{name} takes a number, not {type(value).__name__}")
        if field.kind in (FieldKind.BITS, FieldKind.STREAM):
            word = value.__index__() if hasattr(value, "__index__") else None
            if word is None:
                raise TypeError(f"{name} takes an int of {field.bits} bits, not {type(value).__name__}")
            if not 0 <= word < 1 << field.bits:
                raise ValueError(f"{name} has {field.bits} bits, {value} does not fit")
            return self._data._raw, index, word
        if field.kind is FieldKind.BOOLEAN:
            return self._data._values, index, 1.0 if value and not math.isnan(value) else 0.0
        return self._data._values, index, float(value)

    def off(self) -> None:
        """Everything to 0 and False."""
        for name in self:
            self[name] = 0

    def _assign_bit(self, name: str, bit: int, value: bool) -> None:
        index = self._index[name]
        word = self._data._raw[index]
        self._data._raw[index] = word | 1 << bit if value else word & ~(1 << bit)
