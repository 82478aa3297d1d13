"""Pulse timers (OneShot): two per instance. Source: fact sheet registers 2.19."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hostmot2._core import ffi
from hostmot2.board import SafeOff
from hostmot2.cycle import Order
from hostmot2.idrom import PinDescriptor
from hostmot2.modules.instances import Instances, switched, whole
from hostmot2.register_map import BitField
from hostmot2.registers import Gtag, OneshotPin, OneshotTrigger
from hostmot2.registers import Oneshot as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

_CONTROL = Registers.control
_TRIGGER_PINS = (OneshotPin.TRIGGER_1, OneshotPin.TRIGGER_2)
_OUT_PINS = (OneshotPin.OUT_1, OneshotPin.OUT_2)


def _field(name: str, timer: int) -> BitField:
    field: BitField = getattr(_CONTROL, f"{name}_{timer + 1}")
    return field


class OneshotTimer:
    """One pulse timer: a pulse of `width` seconds on its output at each trigger. Settings act at once.

    Off until `enable` is set: no pulse, pin not driven.
    """

    def __init__(self, oneshot: Oneshot, index: int) -> None:
        self._oneshot, self.index = oneshot, index
        self._width = self._filter = 0
        self._trigger, self._dpll_timer = OneshotTrigger.OFF, 0
        self._rise, self._fall, self._retriggerable, self._enable = True, False, False, False

    @property
    def width(self) -> float:
        """Seconds of a pulse, rounded to clocks; at most 2^31 - 1 of them."""
        return self._width / self._oneshot.clock

    @width.setter
    def width(self, seconds: float) -> None:
        self._width = self._clocks("width", seconds, Registers.width1.periods)
        self._oneshot.write(Registers.width1.number + self.index, self._width)

    @property
    def filter(self) -> float:
        """Seconds the external trigger must be stable; at most 2^24 - 1 clocks."""
        return self._filter / self._oneshot.clock

    @filter.setter
    def filter(self, seconds: float) -> None:
        self._filter = self._clocks("filter", seconds, Registers.filter1.periods)
        self._oneshot.write(Registers.filter1.number + self.index, self._filter)

    def _clocks(self, name: str, seconds: float, field: BitField) -> int:
        clocks = whole(seconds * self._oneshot.clock)
        if not 0 <= clocks <= field.maximum:
            limit = field.maximum / self._oneshot.clock
            raise ValueError(f"oneshot {self._oneshot.index}: {name} {seconds} s is outside 0..{limit:g} s")
        return clocks

    @property
    def trigger(self) -> OneshotTrigger:
        """What starts a pulse: nothing (the default), software, a pin, a DPLL timer, the rate, a timer."""
        return self._trigger

    @trigger.setter
    def trigger(self, source: OneshotTrigger) -> None:
        self._trigger = OneshotTrigger(source)
        self._oneshot.configure()

    def set_edges(self, *, rise: bool, fall: bool) -> None:
        """Which edges of the source start a pulse; the default is the rising one."""
        self._rise, self._fall = switched(rise), switched(fall)
        self._oneshot.configure()

    @property
    def retriggerable(self) -> bool:
        """Whether a trigger during a pulse starts it anew; else (the default) it is ignored."""
        return self._retriggerable

    @retriggerable.setter
    def retriggerable(self, on: bool) -> None:
        self._retriggerable = switched(on)
        self._oneshot.configure()

    @property
    def dpll_timer(self) -> int:
        """The DPLL timer of trigger DPLL: 0 the reference, 1 to 4."""
        return self._dpll_timer

    @dpll_timer.setter
    def dpll_timer(self, timer: int) -> None:
        if not 0 <= timer <= 4:
            raise ValueError(f"there is no DPLL timer {timer}")
        self._dpll_timer = timer
        self._oneshot.configure()

    @property
    def enable(self) -> bool:
        """Whether triggers are listened to and the pin is driven. Setting it arms the watchdog."""
        return self._enable

    @enable.setter
    def enable(self, on: bool) -> None:
        self._enable = switched(on)
        if on:
            self._oneshot.drive_timer(self.index)
        self._oneshot.configure()
        if not on:
            self._oneshot.let_go_of_timer(self.index)

    def fire(self) -> None:
        """A software trigger: the source goes high and low again."""
        self._oneshot.configure(_field("software_trigger", self.index).mask)
        self._oneshot.configure()

    def reset(self) -> None:
        """End a pulse at once."""
        self._oneshot.configure(_field("reset", self.index).mask)
        self._oneshot.configure()

    @property
    def output(self) -> bool:
        """Whether a pulse is on, as of the last exchange."""
        return bool(_field("output", self.index).get(self._oneshot.state))

    @property
    def external(self) -> bool:
        """The external trigger behind its filter, as of the last exchange."""
        return bool(_field("external", self.index).get(self._oneshot.state))

    def word(self) -> int:
        """The timer's part of the control register."""
        values = {
            "trigger": int(self._trigger),
            "rise": self._rise,
            "fall": self._fall,
            "retrigger": self._retriggerable,
            "enable": self._enable,
            "timer": self._dpll_timer,
        }
        return sum(_field(name, self.index).put(int(value)) for name, value in values.items())


class Oneshot:
    """One instance: two timers, and a rate generator that both may use."""

    def __init__(self, oneshots: Oneshots, index: int) -> None:
        self._all, self.index, self.clock = oneshots, index, oneshots.clock
        self._rate = 0
        self.timers = (OneshotTimer(self, 0), OneshotTimer(self, 1))

    @property
    def rate(self) -> float:
        """Triggers per second of the rate generator, 0 to half the clock."""
        return self._rate * self.clock / 2**32

    @rate.setter
    def rate(self, hertz: float) -> None:
        if not 0 <= hertz <= self.clock / 2:
            raise ValueError(f"oneshot {self.index}: rate {hertz} Hz is outside 0..{self.clock / 2:g} Hz")
        self._rate = round(hertz * 2**32 / self.clock)
        self.write(Registers.rate.number, self._rate)

    @property
    def state(self) -> int:
        """The control register as of the last exchange."""
        return int(self._all.states[self.index])

    def write(self, register: int, word: int) -> None:
        """Write one register."""
        self._all.write(register, word, self.index)

    def configure(self, extra: int = 0) -> None:
        """Write the control register."""
        self.write(_CONTROL.number, sum(timer.word() for timer in self.timers) | extra)

    def _pins(self, timer: int) -> list[PinDescriptor]:
        # some tables of pins leave bit 7 out for this module's outputs
        numbers = (_TRIGGER_PINS[timer], _OUT_PINS[timer])
        return [pin for pin in self._all.pins(self.index) if pin.secondary_pin & 0x7F in numbers]

    def drive_timer(self, timer: int) -> None:
        """Switch one timer's pins to it; arms the watchdog."""
        self._all.drive(self.index, f"oneshot {self.index}", self._pins(timer))

    def let_go_of_timer(self, timer: int) -> None:
        """Drive one timer's pin no more."""
        for pin in self._pins(timer):
            if pin.is_output:
                self._all.board.ioport.configure(pin, output=False)

    def off(self) -> None:
        """End pulses, and write all registers."""
        for timer in self.timers:
            timer._enable = False
        resets = sum(_field("reset", timer.index).mask for timer in self.timers)
        self.configure(resets)
        for timer in self.timers:
            self.write(Registers.width1.number + timer.index, timer._width)
            self.write(Registers.filter1.number + timer.index, timer._filter)
        self.write(Registers.rate.number, self._rate)
        self.configure()

    def __repr__(self) -> str:
        states = ", ".join("on" if timer.enable else "off" for timer in self.timers)
        return f"<Oneshot {self.index} timers {states}>"


class Oneshots(Instances[Oneshot]):
    """The card's pulse timers. All off when the board closes and after a watchdog bite."""

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.ONESHOT)
        self.states: Any = ffi.new("uint32_t[]", self.descriptor.instances)
        self._instances = [Oneshot(self, n) for n in range(self.descriptor.instances)]
        self._off()
        self.cyclic(_CONTROL.number, self.states, write=False, order=Order.OTHERS)
        board.on_restore(self._off)
        board.on_close(self._off, SafeOff.GENERATORS)

    def _off(self) -> None:
        for oneshot in self._instances:
            oneshot.off()
