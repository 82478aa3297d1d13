"""Parameters of remotes as people and --json see them."""

from __future__ import annotations

from typing import Any

import click

from hostmot2 import drive_8i20
from hostmot2.fields import ParameterField
from hostmot2.remotes.parameters import Number, Parameter

BAUDS = (
    9600,
    19200,
    38400,
    57600,
    115200,
    230400,
    460800,
    921600,
    1_250_000,
    2_500_000,
    5_000_000,
    10_000_000,
)
"""By the index in NVBAUDRATE (7I77 and 8I20 manuals, operate mode baud rate)."""

_NO_UNITS = ("", "none")


def warn_if_read_only(parameter: Parameter) -> None:
    """Says on stderr that what is written to it does not last."""
    if parameter.read_only:
        click.echo(f"hm2: {parameter.name} is set by the remote itself", err=True)


def in_unit(parameter: Parameter, value: Number) -> str:
    """What a value means, in brackets; "" if it is no more than a number."""
    meaning = _meaning(parameter, value)
    return f"  ({meaning})" if meaning else ""


def _meaning(parameter: Parameter, value: Number) -> str:
    name = parameter.name.upper()
    if name == "NVBAUDRATE" and 0 <= value < len(BAUDS):
        return f"{BAUDS[int(value)]} baud"
    if isinstance(parameter.field, ParameterField) and name in ("FAULT", "STATUS"):
        return _bits(int(value), drive_8i20.FAULTS if name == "FAULT" else drive_8i20.STATUS)
    if parameter.unit in _NO_UNITS:
        return ""
    return f"{parameter.to_unit(value):.6g} {parameter.unit}"


def _bits(value: int, names: tuple[str, ...]) -> str:
    found = [names[bit] if bit < len(names) and names[bit] else f"bit {bit}" for bit in range(16)]
    return ", ".join(found[bit] for bit in range(16) if value >> bit & 1)


def shown(parameter: Parameter, value: Number, *, hexadecimal: bool = False) -> str:
    """A value and what it means."""
    return parameter.format(value, hexadecimal=hexadecimal) + in_unit(parameter, value)


def document(parameter: Parameter, value: Number | None = None) -> dict[str, Any]:
    """A parameter for --json."""
    field = parameter.field
    facts: dict[str, Any] = {
        "name": parameter.name,
        "type": parameter.type_name,
        "nonvolatile": parameter.nonvolatile,
        "address": field.address,
        "range": list(parameter.limits),
        "unit": "" if parameter.unit in _NO_UNITS else parameter.unit,
    }
    if value is not None:
        facts |= {"value": value, "hex": parameter.format(value, hexadecimal=True)}
        if facts["unit"]:
            facts["scaled"] = parameter.to_unit(value)
    if isinstance(field, ParameterField):
        facts |= {"default": field.default, "address_derived": field.derived}
    return facts
