"""What hangs on the smaller modules of an emulated card: made by the methods of EmulatedBoard."""

from __future__ import annotations

from typing import Any

from hostmot2._core import lib


def _checked(status: int, what: str) -> None:
    if status < 0:
        raise IndexError(f"the card has no {what}")


class EmulatedInmux:
    """The multiplexer of one InMux instance, with 32 lines. Lines float high (pull-ups) until set."""

    def __init__(self, handle: Any, unit: int) -> None:
        self._handle, self.unit = handle, unit
        self._levels = 0xFFFFFFFF
        self._write()

    def _write(self) -> None:
        _checked(lib.hm2_emulator_inmux_set(self._handle, self.unit, self._levels), f"InMux {self.unit}")

    def drive(self, number: int, level: int) -> None:
        """Put a level, 0 or 1, on line `number`, 0 to 31."""
        if not 0 <= number < 32 or level not in (0, 1):
            raise ValueError(f"line {number}, level {level!r}")
        self._levels = self._levels & ~(1 << number) | level << number
        self._write()
