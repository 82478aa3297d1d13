"""PWM and PDM generators. Source: fact sheets registers 2.6 and card_observed 7."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING

from hostmot2 import errors
from hostmot2.board import SafeOff
from hostmot2.cycle import Order
from hostmot2.modules.instances import CommandedInstances, number, switched, whole
from hostmot2.registers import Gtag, PwmgenOutput
from hostmot2.registers import Pwmgen as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

_WIDTHS = (12, 11, 10, 9)
_PDM_BITS = 12
_VALUE = Registers.value


class Pwmgen:
    """One generator: `value / scale` is the duty, -1 to 1. Off (0, /Enable high) until `enable` is set."""

    def __init__(self, pwmgens: Pwmgens, index: int) -> None:
        self._all = pwmgens
        self.index = index
        self._value, self._scale, self._enable = 0.0, 1.0, False
        self._output, self._offset_mode = PwmgenOutput.PWM_DIRECTION, False

    @property
    def value(self) -> float:
        """The wanted output in units of `scale`; limited to +-scale. The next exchange writes it."""
        return self._value

    @value.setter
    def value(self, value: float) -> None:
        self._value = number(value)
        self._all.update()

    @property
    def scale(self) -> float:
        """The value of full duty; not 0."""
        return self._scale

    @scale.setter
    def scale(self, scale: float) -> None:
        if not math.isfinite(scale) or scale == 0:
            raise ValueError(f"pwmgen {self.index}: scale {scale}")
        self._scale = scale
        self._all.update()

    @property
    def output(self) -> PwmgenOutput:
        """What comes out on pins A and B.

        UP_DOWN follows the hardware: a positive value pulses on B, a negative one on A.
        """
        return self._output

    @output.setter
    def output(self, output: PwmgenOutput) -> None:
        bits = self.bits
        self._output = PwmgenOutput(output)
        self._all.resize(coarser=self.bits < bits)

    @property
    def offset_mode(self) -> bool:
        """True: value 0 is 50 % duty."""
        return self._offset_mode

    @offset_mode.setter
    def offset_mode(self, on: bool) -> None:
        self._offset_mode = switched(on)
        self._all.update()

    @property
    def enable(self) -> bool:
        """Whether the output is on. Setting it drives the pins, clearing it makes the duty 0 at once."""
        return self._enable

    @enable.setter
    def enable(self, on: bool) -> None:
        on = switched(on)
        if on:
            self._all.drive(self.index, f"pwmgen {self.index}")
        self._enable = on
        self._all.update()
        if on:
            self._all.configure()
            return
        with suppress(errors.WatchdogBite):  # then the pins are off already
            self._all.write_now()
            self._all.configure()

    @property
    def duty(self) -> float:
        """The duty that the last update asked for: -1 to 1, 0 while off. Not a number counts as 0."""
        duty = self._value / self._scale if self._enable else 0.0
        return 0.0 if math.isnan(duty) else max(-1.0, min(1.0, duty))

    @property
    def bits(self) -> int:
        """Resolution: 9 to 12 bits by PWM frequency, 12 for PDM."""
        return _PDM_BITS if self._output == PwmgenOutput.PDM_DIRECTION else self._all.bits

    def forget(self) -> None:
        """What it was told to put out is not wanted any more."""
        self._value = 0.0

    def word(self) -> int:
        """The value register for the present duty."""
        if self._offset_mode and self._enable:
            half = 1 << self.bits - 1
            return _VALUE.magnitude.put(round(self.duty * (half - 1) + half))
        magnitude = int(abs(self.duty) * ((1 << self.bits) - 1))
        return _VALUE.magnitude.put(magnitude) | _VALUE.direction.put(self.duty < 0)

    def mode_word(self) -> int:
        """The mode register: PWM is double buffered, so that no cycle is cut; PDM cannot be."""
        mode = Registers.mode
        buffered = self._output != PwmgenOutput.PDM_DIRECTION
        return (
            mode.width_select.put(self._all.bits - 9)
            | mode.output.put(self._output)
            | mode.double_buffer.put(buffered)
        )

    def __repr__(self) -> str:
        return f"<Pwmgen {self.index} {'on' if self._enable else 'off'} duty {self.duty:g}>"


class Pwmgens(CommandedInstances[Pwmgen]):
    """The card's PWM generators. All off, values 0, when the board closes and after a watchdog bite."""

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.PWMGEN, _VALUE)
        self._pwm_frequency = self._pdm_frequency = 20000.0
        self.bits, self._pwm_rate = self._choose(20000.0)
        self._instances = [Pwmgen(self, n) for n in range(self.descriptor.instances)]
        self._off()
        self.join_cycle(Order.GENERATORS)
        board.on_restore(self._restore, SafeOff.GENERATORS)
        board.on_close(self._off, SafeOff.GENERATORS)

    def _choose(self, frequency: float) -> tuple[int, int]:
        """The widest resolution whose rate fits its 16 bits."""
        for bits in _WIDTHS:
            rate = whole(frequency * 65536 * 2**bits / self.clock)
            if 1 <= rate <= 0xFFFF:
                return bits, rate
        low, high = (
            self.clock * rate / 65536 / 2**bits for rate, bits in ((0.5, _WIDTHS[0]), (0xFFFF, _WIDTHS[-1]))
        )
        raise ValueError(f"PWM frequency {frequency} Hz is outside {low:.2f}..{high:.0f} Hz")

    @property
    def frequency(self) -> float:
        """PWM frequency of all generators in Hz; the default is 20 kHz. High ones have fewer bits."""
        return self._pwm_rate * self.clock / 65536 / float(2**self.bits)

    @frequency.setter
    def frequency(self, hertz: float) -> None:
        bits = self.bits
        self.bits, self._pwm_rate = self._choose(hertz)
        self.resize(coarser=self.bits < bits)

    @property
    def pdm_frequency(self) -> float:
        """Pulse slots per second of all PDM outputs; the default is 20 kHz."""
        return self._pdm_rate * self.clock / 65536

    @pdm_frequency.setter
    def pdm_frequency(self, hertz: float) -> None:
        if not 1 <= hertz * 65536 / self.clock < 65536:
            raise ValueError(
                f"PDM frequency {hertz} Hz is not within {self.clock / 65536:.0f}..{self.clock} Hz"
            )
        self._pdm_frequency = hertz
        self.configure()

    @property
    def _pdm_rate(self) -> int:
        return min(0xFFFF, max(1, round(self._pdm_frequency * 65536 / self.clock)))

    def resize(self, *, coarser: bool) -> None:
        """Write values and modes of another resolution, so that no duty is larger in between."""
        self.update()
        if coarser:
            self.write_now()
        self.configure()
        if not coarser:
            self.write_now()

    def configure(self) -> None:
        """Write modes, enables and rates, in this order."""
        for pwmgen in self._instances:
            self.write(Registers.mode.number, pwmgen.mode_word(), pwmgen.index)
        enables = sum(1 << pwmgen.index for pwmgen in self._instances if pwmgen.enable)
        self.write(Registers.enable.number, enables)
        self.write(Registers.pwm_rate.number, self._pwm_rate)
        self.write(Registers.pdm_rate.number, self._pdm_rate)

    def _off(self) -> None:
        for pwmgen in self._instances:
            pwmgen._enable = False
        self.update()
        self.write_now()
        self.configure()
