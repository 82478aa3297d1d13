"""Three-phase PWM for bridges. Source: fact sheet registers 2.9."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from hostmot2 import errors
from hostmot2._core import ffi
from hostmot2.board import SafeOff
from hostmot2.cycle import Order
from hostmot2.modules.instances import CommandedInstances, number, switched, whole
from hostmot2.registers import Gtag
from hostmot2.registers import TpPwm as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

_CENTRE, _SPAN = 512, 511
_CLOCKS = 2048
"""PWM clocks per cycle."""
_FAULT_FILTER = 2e-6
"""Seconds; the hardware looks at the fault input for 7 clocks."""


class TpPwm:
    """One three-phase bridge: `a`, `b` and `c` between -scale and scale. All gates off until `enable`."""

    def __init__(self, tp_pwms: TpPwms, index: int) -> None:
        self._all, self.index = tp_pwms, index
        self._values, self._scale, self._enable = [0.0, 0.0, 0.0], 1.0, False
        self._dead_time, self._fault_high, self._sample = 5e-6, False, 0.5

    def _phase(self, phase: int, value: float) -> None:
        self._values[phase] = number(value)
        self._all.update()

    @property
    def a(self) -> float:
        """Phase A in units of `scale`; limited to +-scale. The next exchange writes it."""
        return self._values[0]

    @a.setter
    def a(self, value: float) -> None:
        self._phase(0, value)

    @property
    def b(self) -> float:
        """Phase B, as `a`."""
        return self._values[1]

    @b.setter
    def b(self, value: float) -> None:
        self._phase(1, value)

    @property
    def c(self) -> float:
        """Phase C, as `a`."""
        return self._values[2]

    @c.setter
    def c(self, value: float) -> None:
        self._phase(2, value)

    @property
    def scale(self) -> float:
        """The value of full duty; not 0."""
        return self._scale

    @scale.setter
    def scale(self, scale: float) -> None:
        if not math.isfinite(scale) or scale == 0:
            raise ValueError(f"three-phase PWM {self.index}: scale {scale}")
        self._scale = scale
        self._all.update()

    @property
    def dead_time(self) -> float:
        """Seconds between one side's off and the other's on; the default is 5 us. Rounded up."""
        return self._dead_time

    @dead_time.setter
    def dead_time(self, seconds: float) -> None:
        self._all.dead_clocks(seconds)
        self._dead_time = seconds
        self._all.configure(self)

    @property
    def fault_is_high(self) -> bool:
        """Whether a high level at the fault input is a fault; False (the default): a low one."""
        return self._fault_high

    @fault_is_high.setter
    def fault_is_high(self, high: bool) -> None:
        self._fault_high = switched(high)
        self._all.configure(self)

    @property
    def sample_time(self) -> float:
        """Where in the cycle the ADC samples, 0 to 1; 0.5 (the default) is its middle."""
        return self._sample

    @sample_time.setter
    def sample_time(self, part: float) -> None:
        if not 0 <= part <= 1:
            raise ValueError(f"three-phase PWM {self.index}: sample time {part} is outside 0..1")
        self._sample = part
        self._all.configure(self)

    @property
    def fault(self) -> bool:
        """Whether a fault keeps the gates off, or has switched them off, as of the last exchange."""
        return bool(Registers.enable.fault.get(self._all.status[self.index]))

    @property
    def enable(self) -> bool:
        """Whether the gates are on; False behind a fault until set again.

        Setting it arms the watchdog and clears an old fault. Raises FaultPresent if the fault input is
        active. Clearing it turns all gates off at once.
        """
        return self._enable and not self.fault

    @enable.setter
    def enable(self, on: bool) -> None:
        if switched(on):
            self._all.enable(self)
        else:
            self._all.disable(self)

    def forget(self) -> None:
        """What it was told to put out is not wanted any more."""
        self._values = [0.0, 0.0, 0.0]

    def word(self) -> int:
        """The value register; the centre while off. Not a number counts as 0."""
        words = [_CENTRE] * 3
        if self._enable:
            for phase, value in enumerate(self._values):
                part = value / self._scale
                part = 0.0 if math.isnan(part) else max(-1.0, min(1.0, part))
                words[phase] = round(_SPAN * part) + _CENTRE
        fields = (Registers.value.a, Registers.value.b, Registers.value.c)
        return sum(field.put(word) for field, word in zip(fields, words, strict=True))

    def setup_word(self) -> int:
        """The setup register."""
        setup = Registers.setup
        sample = min(round(self._sample * _CLOCKS), setup.sample_time.maximum)
        return (
            setup.dead_time.put(self._all.dead_clocks(self._dead_time))
            | setup.fault_polarity.put(self._fault_high)
            | setup.sample_time.put(sample)
        )

    def __repr__(self) -> str:
        state = "FAULT" if self.fault else "on" if self.enable else "off"
        return f"<TpPwm {self.index} {state} {self._values}>"


class TpPwms(CommandedInstances[TpPwm]):
    """The card's three-phase PWMs. All off when the board closes and after a watchdog bite."""

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.TP_PWM, Registers.value)
        count = self.descriptor.instances
        self.status: Any = ffi.new("uint32_t[]", count)
        self._rate = self._rate_of(20000.0)
        self._instances = [TpPwm(self, n) for n in range(count)]
        self._off()
        self.cyclic(Registers.enable.number, self.status, write=False, order=Order.GENERATORS)
        self.join_cycle(Order.GENERATORS)
        board.on_restore(self._restore)
        board.on_close(self._off, SafeOff.GENERATORS)

    def _rate_of(self, hertz: float) -> int:
        rate = whole(hertz * 65536 * _CLOCKS / self.clock)
        if not 1 <= rate <= Registers.rate.rate.maximum:
            low, high = (self.clock * n / 65536 / _CLOCKS for n in (0.5, Registers.rate.rate.maximum))
            raise ValueError(f"PWM frequency {hertz} Hz is outside {low:.2f}..{high:.0f} Hz")
        return rate

    @property
    def frequency(self) -> float:
        """PWM frequency of all bridges in Hz; the default is 20 kHz. Dead times stay what they are."""
        return self._rate * self.clock / 65536 / _CLOCKS

    @frequency.setter
    def frequency(self, hertz: float) -> None:
        rate = self._rate_of(hertz)
        for tp_pwm in self._instances:
            self.dead_clocks(tp_pwm.dead_time, rate)
        # a rate going up shortens the dead times in between: gates off first
        if any(tp_pwm.enable for tp_pwm in self._instances):
            raise ValueError("the PWM frequency can be changed only while all bridges are off")
        self._rate = rate
        self.write(Registers.rate.number, rate)
        for tp_pwm in self._instances:
            self.configure(tp_pwm)

    def dead_clocks(self, seconds: float, rate: int | None = None) -> int:
        """The dead time in pairs of PWM clocks, rounded up. Raises ValueError outside 0..511."""
        pwm_clock = self.clock * (self._rate if rate is None else rate) / 65536
        wanted = seconds * pwm_clock / 2
        pairs = math.ceil(wanted - 1e-6) if 0 <= wanted < math.inf else -1
        longest = Registers.setup.dead_time.maximum
        if not 0 <= pairs <= longest:
            raise ValueError(f"dead time {seconds} s is outside 0..{longest * 2 / pwm_clock:.9f} s")
        return pairs

    def _setup_address(self, index: int) -> int:
        # the descriptor calls the register global, but each instance has one
        return self.address(Registers.setup.number) + index * self.descriptor.instance_stride

    def configure(self, tp_pwm: TpPwm) -> None:
        """Write one setup register."""
        self.board.write(self._setup_address(tp_pwm.index), tp_pwm.setup_word())

    def enable(self, tp_pwm: TpPwm) -> None:
        """Turn one bridge on. Raises FaultPresent."""
        register, index = Registers.enable, tp_pwm.index
        self.configure(tp_pwm)
        self.drive(index, f"tp_pwm {index}")
        tp_pwm._enable = True
        self.update()
        self.write(Registers.value.number, self._words[index], index)
        self.write(register.number, register.enable.mask, index)
        self.board.pause(_FAULT_FILTER)
        self.status[index] = self.read(register.number, index)
        if tp_pwm.fault:
            self.disable(tp_pwm)
            raise errors.FaultPresent(
                f"three-phase PWM {index}: the fault input is active, the gates stay off", index=index
            )

    def disable(self, tp_pwm: TpPwm) -> None:
        """Turn one bridge off."""
        tp_pwm._enable = False
        self.update()  # first: if the write is lost, the next exchange brings all phases to the centre
        self.write(Registers.enable.number, 0, tp_pwm.index)

    def _off(self) -> None:
        for tp_pwm in self._instances:
            self.disable(tp_pwm)
            self.status[tp_pwm.index] = 0
        self.write_now()
        self.write(Registers.rate.number, self._rate)
        for tp_pwm in self._instances:
            self.configure(tp_pwm)
