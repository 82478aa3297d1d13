"""Servo pulses as in radio control. Source: fact sheet registers 2.21."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hostmot2.board import SafeOff
from hostmot2.cycle import Order
from hostmot2.modules.instances import CommandedInstances, number, switched
from hostmot2.registers import Gtag
from hostmot2.registers import Rcpwm as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

_STEP = 16
"""Clocks per unit of the width register."""
_SLOWEST, _FASTEST = 0.01, 1000.0


class Rcpwm:
    """One servo output: pulses of `offset + value * scale` seconds.

    The module has no off state, so the pin is driven only while `enable` is set.
    """

    def __init__(self, rcpwms: Rcpwms, index: int) -> None:
        self._all, self.index = rcpwms, index
        self._value, self._scale, self._offset, self._enable = 0.0, 0.0005, 0.0015, False

    @property
    def value(self) -> float:
        """The wanted position; with the default scale -1 to 1 is 1 to 2 ms. The next exchange writes it."""
        return self._value

    @value.setter
    def value(self, value: float) -> None:
        self._value = number(value)
        self._all.update()

    @property
    def scale(self) -> float:
        """Seconds per unit of value; the default is 0.0005."""
        return self._scale

    @scale.setter
    def scale(self, seconds: float) -> None:
        self._scale = self._finite("scale", seconds)
        self._all.update()

    @property
    def offset(self) -> float:
        """Seconds at value 0; the default is 0.0015."""
        return self._offset

    @offset.setter
    def offset(self, seconds: float) -> None:
        self._offset = self._finite("offset", seconds)
        self._all.update()

    def _finite(self, name: str, seconds: float) -> float:
        if not math.isfinite(seconds):
            raise ValueError(f"rcpwm {self.index}: {name} {seconds}")
        return seconds

    @property
    def width(self) -> float:
        """The pulse asked for, in seconds, within what the hardware can make; 0 while off."""
        if not self._enable or math.isnan(self._value):
            return 0.0
        wanted = self._offset + self._value * self._scale
        return max(0.0, min(wanted, self._all.longest))

    def forget(self) -> None:
        """What it was told to put out is not wanted any more."""
        self._value = 0.0

    def word(self) -> int:
        """The width register: 16 clocks are 0."""
        return Registers.width.periods.put(max(0, round(self.width * self._all.clock / _STEP) - 1))

    @property
    def enable(self) -> bool:
        """Whether the pin is driven. Setting it arms the watchdog; clearing it lets go of the pin at once."""
        return self._enable

    @enable.setter
    def enable(self, on: bool) -> None:
        self._enable = switched(on)
        self._all.update()
        if not on:
            self._all.let_go(self.index)
        self._all.write_now()
        if on:
            self._all.drive(self.index, f"rcpwm {self.index}")

    def __repr__(self) -> str:
        return f"<Rcpwm {self.index} {'on' if self._enable else 'off'} {self.width * 1e3:g} ms>"


class Rcpwms(CommandedInstances[Rcpwm]):
    """The card's servo outputs. All off when the board closes and after a watchdog bite."""

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.RCPWM, Registers.width)
        self._period = self._clocks(50.0)
        self._instances = [Rcpwm(self, n) for n in range(self.descriptor.instances)]
        self._off()
        self.join_cycle(Order.GENERATORS)
        board.on_restore(self._restore)
        board.on_close(self._off, SafeOff.GENERATORS)

    def _clocks(self, hertz: float) -> int:
        if not _SLOWEST <= hertz <= _FASTEST:
            raise ValueError(f"servo pulses at {hertz} Hz: not within {_SLOWEST} to {_FASTEST} Hz")
        clocks = round(self.clock / hertz)
        if clocks - 2 > 0xFFFFFFFF:
            raise ValueError(f"servo pulses at {hertz} Hz: the slowest here is {self.clock / 2**32:.4f} Hz")
        return clocks

    @property
    def frequency(self) -> float:
        """Pulses per second of all outputs; the default is 50.

        Set: 0.01 to 1000, and not below ClockLow / 2^32 (0.023 with 100 MHz). Raises ValueError.
        """
        return self.clock / self._period

    @frequency.setter
    def frequency(self, hertz: float) -> None:
        self._period = self._clocks(hertz)
        self.update()
        self.write(Registers.rate.number, self._period - 2)
        self.write_now()

    @property
    def longest(self) -> float:
        """Seconds of the longest pulse: 16 bits, and shorter than the repetition."""
        return min((Registers.width.periods.maximum + 1) * _STEP, self._period - 1) / self.clock

    def _off(self) -> None:
        for rcpwm in self._instances:
            rcpwm._enable = False
        self.update()
        self.write(Registers.rate.number, self._period - 2)
        self.write_now()
