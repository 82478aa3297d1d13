"""The two remotes that predate discovery, 8I20 and 7I64. Source: sserial.md 7.2, 7.3; 8I20 manual."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hostmot2 import drive_8i20
from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.remotes.discovery import RemoteDescription

MAX_CURRENT_8I20 = drive_8i20.MAX_CURRENT
"""Address of the 8I20's working MAXCURRENT, a word of 10 mA."""
STORED_MAX_CURRENT_8I20 = next(p.address for p in drive_8i20.EEPROM if p.name == "NVMAXCURRENT")
"""Of the one in EEPROM that it takes over at power-up."""
TEN_MILLIAMPERES = 0.01
"""A of a count of it."""

_IN, _OUT = Direction.INPUT, Direction.OUTPUT
_UNSIGNED = FieldKind.UNSIGNED


def describe(
    name: str,
    unit_number: int,
    read: Callable[[int, int], int],
    software_mode: int = 0,
    *,
    read_stored: Callable[[int, int], int] | None = None,
) -> RemoteDescription | None:
    """A remote that is known by its name, None for all others.

    read, read_stored: (address, size) of its memory and its EEPROM.
    """
    if name == "8I20":
        counts = read(MAX_CURRENT_8I20, 2)
        stored = read_stored(STORED_MAX_CURRENT_8I20, 2) if read_stored else counts
        drive = describe_8i20(unit_number, counts * TEN_MILLIAMPERES, software_mode)
        # 0: no current, whatever it is scaled by
        return replace(drive, scale_pending=stored not in (0, counts))
    return describe_7i64(unit_number, software_mode) if name == "7I64" else None


def describe_8i20(unit_number: int, max_current: float, software_mode: int = 0) -> RemoteDescription:
    """An 8I20. max_current: its working full scale in A, which is what `current` is scaled by."""
    return RemoteDescription(
        name="8I20",
        unit_number=unit_number,
        software_mode=software_mode,
        fields=(
            Field("angle", _UNSIGNED, 16, _OUT, 0.0, 1.0, "rev"),
            Field("current", FieldKind.SIGNED, 16, _OUT, -max_current, max_current, "A"),
            # counts: the manual says both degrees and hundredths of them
            Field("card-temp", _UNSIGNED, 16, _IN, 0.0, 65535.0, ""),
            Field("bus-voltage", _UNSIGNED, 16, _IN, 0.0, 655.35, "V"),
            Field("status", FieldKind.BITS, 16, _IN),
            Field("fault", FieldKind.BITS, 16, _IN),
        ),
        parameters=drive_8i20.PARAMETERS,
        aliases=drive_8i20.ALIASES,
        receive_size=8,
        transmit_size=4,
        fault_word=(1, 0xFFFF0000),
        fault_names=("",) * 16 + drive_8i20.FAULTS,
        scaled_by_parameter=True,
    )


def describe_7i64(unit_number: int, software_mode: int = 0) -> RemoteDescription:
    """A 7I64: 24 outputs, 24 inputs, two analog inputs of 3.3 V full scale."""
    return RemoteDescription(
        name="7I64",
        unit_number=unit_number,
        software_mode=software_mode,
        fields=(
            Field("output", FieldKind.BITS, 24, _OUT),
            Field("input", FieldKind.BITS, 24, _IN),
            Field("", FieldKind.PAD, 8, _IN),
            Field("analog0", _UNSIGNED, 16, _IN, 0.0, 3.3, "V"),
            Field("analog1", _UNSIGNED, 16, _IN, 0.0, 3.3, "V"),
        ),
        receive_size=8,
        transmit_size=4,
    )
