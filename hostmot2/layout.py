"""Where the elements of a remote's process data lie, and how they are scaled unless the user says otherwise.

Source: sserial.md 6.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hostmot2.fields import Direction, Field, FieldKind

COUNTERS = (FieldKind.ENCODER, FieldKind.ENCODER_H, FieldKind.ENCODER_L)
_NOT_IN_PROCESS_DATA = (FieldKind.NONVOL_UNSIGNED, FieldKind.NONVOL_SIGNED, FieldKind.NONVOL_FLOAT)


@dataclass(frozen=True, slots=True)
class Scaling:
    """What a user may change about an element. For BITS `invert` is a mask, for BOOLEAN 0 or 1."""

    scale: float  # user units at full scale; counters: counts per user unit
    low: float  # user units; an output is clamped to low..high before anything else
    high: float
    invert: int = 0


@dataclass(frozen=True, slots=True)
class Element:
    """A field at its place. A bidirectional field is two elements of the same name."""

    field: Field
    direction: Direction  # INPUT or OUTPUT
    offset: int  # of the least significant bit, in bits from bit 0 of the channel's first register
    partner: int | None = None  # ENCODER_H and ENCODER_L: index of the other part in the layout

    @property
    def name(self) -> str:
        """The name of the field."""
        return self.field.name

    @property
    def is_visible(self) -> bool:
        """Whether it has a value: PAD carries nothing, and a counter cannot be written."""
        kind = self.field.kind
        return kind is not FieldKind.PAD and not (self.direction is Direction.OUTPUT and kind in COUNTERS)

    def default_scaling(self) -> Scaling:
        """Full scale and limits as the remote states them; 0..1 if it states none (FLOAT: unlimited)."""
        low, high = self.field.minimum, self.field.maximum
        if low == high and self.field.kind is FieldKind.FLOAT:
            return Scaling(1.0, -math.inf, math.inf)
        if low == high:
            low, high = 0.0, 1.0
        return Scaling(high, low, high)


class Layout:
    """Where the fields of one channel lie. Immutable.

    Inputs and outputs are counted from bit 0 each; a bidirectional field takes room in both, PAD in its own.
    Raises ValueError for a width its kind cannot have, for a name used twice in one direction, and for
    kinds that are for parameters only.
    """

    def __init__(self, fields: Iterable[Field]) -> None:
        self.fields = tuple(fields)
        self.input_bits = 0
        self.output_bits = 0
        elements: list[Element] = []
        for field in self.fields:
            _check_field(field)
            if field.direction in (Direction.INPUT, Direction.BIDIRECTIONAL):
                elements.append(Element(field, Direction.INPUT, self.input_bits))
                self.input_bits += field.bits
            if field.direction in (Direction.OUTPUT, Direction.BIDIRECTIONAL):
                elements.append(Element(field, Direction.OUTPUT, self.output_bits))
                self.output_bits += field.bits
        self.elements = tuple(_with_partners(elements))
        _check_names(self.elements)

    @property
    def words(self) -> int:
        """Registers needed, the larger of both directions."""
        return -(-max(self.input_bits, self.output_bits) // 32)

    def __repr__(self) -> str:
        rows = [("element", "kind", "bits", "direction", "offset", "minimum", "maximum", "unit")]
        rows += [
            (
                element.name,
                element.field.kind.name,
                str(element.field.bits),
                element.direction.name.lower(),
                str(element.offset),
                f"{element.field.minimum:g}",
                f"{element.field.maximum:g}",
                element.field.unit,
            )
            for element in self.elements
        ]
        return f"Layout: {self.input_bits} bits in, {self.output_bits} bits out\n" + table(rows)


def _check_field(field: Field) -> None:
    kind, bits = field.kind, field.bits
    if kind in _NOT_IN_PROCESS_DATA:
        raise ValueError(f"{field.name}: {kind.name} is for parameters only")
    if kind is FieldKind.FLOAT and bits not in (32, 64):
        raise ValueError(f"{field.name}: FLOAT of {bits} bits; 32 and 64 exist")
    if not 1 <= bits <= (255 if kind is FieldKind.PAD else 64):
        raise ValueError(f"{field.name}: {kind.name} of {bits} bits")


def _check_names(elements: Iterable[Element]) -> None:
    seen: set[tuple[str, Direction]] = set()
    for element in elements:
        if element.field.kind is FieldKind.PAD:
            continue
        if (element.name, element.direction) in seen:
            raise ValueError(f"two {element.direction.name.lower()}s are called {element.name!r}")
        seen.add((element.name, element.direction))


def _with_partners(elements: list[Element]) -> list[Element]:
    """Join the n-th upper to the n-th lower counter part of each direction.

    A part left over stands alone, and so do two that are wider together than a count.
    """
    paired = list(elements)
    for direction in (Direction.INPUT, Direction.OUTPUT):
        upper, lower = (
            [i for i, e in enumerate(elements) if e.direction is direction and e.field.kind is kind]
            for kind in (FieldKind.ENCODER_H, FieldKind.ENCODER_L)
        )
        for high, low in zip(upper, lower, strict=False):
            if elements[high].field.bits + elements[low].field.bits > 64:
                continue
            paired[high] = Element(elements[high].field, direction, elements[high].offset, low)
            paired[low] = Element(elements[low].field, direction, elements[low].offset, high)
    return paired


def table(rows: Sequence[tuple[str, ...]]) -> str:
    """Rows of cells as text, columns aligned."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)
    return "\n".join("  " + line.rstrip() for line in lines)
