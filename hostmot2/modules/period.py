"""Period meters. Source: fact sheet registers 2.20."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hostmot2._core import ffi
from hostmot2.cycle import Order
from hostmot2.modules.instances import Instances, switched, whole
from hostmot2.registers import Gtag
from hostmot2.registers import Period as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

_MODE = Registers.mode


class Period:
    """One meter. Readings are those of the last exchange; None while the signal is too slow or not there."""

    def __init__(self, periods: Periods, index: int) -> None:
        self._all, self.index = periods, index
        self._averages, self._invert, self._filter, self._minimum = 1, False, 0, 1.0

    @property
    def valid(self) -> bool:
        """Whether there is a signal above `minimum_frequency`."""
        return bool(_MODE.valid.get(self._all.modes[self.index]))

    @property
    def input(self) -> bool:
        """The level behind filter and inversion."""
        return bool(_MODE.input.get(self._all.modes[self.index]))

    @property
    def period(self) -> float | None:
        """Seconds between rising edges, the mean over `averages` of them."""
        return self._seconds(self._all.periods[self.index])

    @property
    def width(self) -> float | None:
        """Seconds the signal is high, the mean over `averages` periods."""
        return self._seconds(self._all.widths[self.index])

    def _seconds(self, clocks: int) -> float | None:
        return int(clocks) / self._all.clock / self._averages if self.valid else None

    @property
    def frequency(self) -> float | None:
        """Hz."""
        period = self.period
        return 1.0 / period if period else None

    @property
    def duty(self) -> float | None:
        """The part of a period the signal is high, 0 to 1."""
        period, width = self.period, self.width
        return width / period if period and width is not None else None

    @property
    def averages(self) -> int:
        """Periods a reading is the mean of, 1 to 4096; the default is 1."""
        return self._averages

    @averages.setter
    def averages(self, periods: int) -> None:
        _MODE.averages.put(periods - 1)
        self._averages = periods
        self._all.configure(self)

    @property
    def minimum_frequency(self) -> float:
        """Hz below which the reading is not valid; the default is 1.

        Not less than the 32-bit counter allows: clock * averages / 2^32.
        """
        return self._all.clock * self._averages / self.limit_word()

    @minimum_frequency.setter
    def minimum_frequency(self, hertz: float) -> None:
        if not 0 < hertz <= self._all.clock:
            raise ValueError(
                f"period {self.index}: minimum frequency {hertz} Hz is outside 0..{self._all.clock}"
            )
        self._minimum = hertz
        self._all.configure(self)

    @property
    def filter(self) -> float:
        """Seconds a level must last to be seen; at most 65535 clocks."""
        return self._filter / self._all.clock

    @filter.setter
    def filter(self, seconds: float) -> None:
        clocks = whole(seconds * self._all.clock)
        if not 0 <= clocks <= _MODE.filter.maximum:
            limit = _MODE.filter.maximum / self._all.clock
            raise ValueError(f"period {self.index}: filter {seconds} s is outside 0..{limit:g} s")
        self._filter = clocks
        self._all.configure(self)

    @property
    def invert(self) -> bool:
        """Whether the signal is measured upside down."""
        return self._invert

    @invert.setter
    def invert(self, on: bool) -> None:
        self._invert = switched(on)
        self._all.configure(self)

    def mode_word(self) -> int:
        """The mode register."""
        return (
            _MODE.polarity.put(self._invert)
            | _MODE.averages.put(self._averages - 1)
            | _MODE.filter.put(self._filter)
        )

    def limit_word(self) -> int:
        """The limit register."""
        clocks = round(self._all.clock / self._minimum * self._averages)
        return min(clocks, (1 << Registers.limit.width) - 1)

    def __repr__(self) -> str:
        frequency = self.frequency
        return f"<Period {self.index} {'no signal' if frequency is None else f'{frequency:g} Hz'}>"


class Periods(Instances[Period]):
    """The card's period meters."""

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.PERIOD)
        count = self.descriptor.instances
        self.modes: Any = ffi.new("uint32_t[]", count)
        self.periods: Any = ffi.new("uint32_t[]", count)
        self.widths: Any = ffi.new("uint32_t[]", count)
        self._instances = [Period(self, n) for n in range(count)]
        for meter in self._instances:
            board.ioport.claim(self.pins(meter.index), f"period {meter.index}")
        self._restore()
        for register, words in (
            (Registers.mode, self.modes),
            (Registers.period, self.periods),
            (Registers.width, self.widths),
        ):
            self.cyclic(register.number, words, write=False, order=Order.OTHERS)
        board.on_restore(self._restore)

    def configure(self, meter: Period) -> None:
        """Write one meter's settings; its reading is not valid until measured anew."""
        self.write(_MODE.number, meter.mode_word(), meter.index)
        self.write(Registers.limit.number, meter.limit_word(), meter.index)
        self.modes[meter.index] = 0

    def _restore(self) -> None:
        for meter in self._instances:
            self.configure(meter)
