"""Field inputs: InM and InMux. Source: fact sheet registers 2.18."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from hostmot2._core import ffi, lib
from hostmot2.cycle import Order
from hostmot2.modules.instances import Instances, switched
from hostmot2.registers import Gtag
from hostmot2.registers import Inm as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

_CONTROL = Registers.control
_COUNTERS = 4
_MODES = (Registers.mpg.mode_0, Registers.mpg.mode_1, Registers.mpg.mode_2, Registers.mpg.mode_3)
_FASTEST = {Gtag.INM: 10e6, Gtag.INMUX: 5e6}
"""Inputs looked at per second, all together."""


class FieldCounter:
    """A hand wheel (MPG) at inputs 2k and 2k + 1."""

    def __init__(self, inputs: FieldInputs, index: int) -> None:
        self._inputs, self.index = inputs, index
        self._zero, self._every_edge = 0, False

    @property
    def count(self) -> int:
        """Counts since the first exchange or the last reset, as of the last exchange."""
        return int(self._inputs._state.counts[self.index]) - self._zero

    def reset(self) -> None:
        """Make the present count 0, in software."""
        self._zero += self.count

    @property
    def every_edge(self) -> bool:
        """Whether it counts every edge (4 per detent cycle); False (the default): once per cycle."""
        return self._every_edge

    @every_edge.setter
    def every_edge(self, on: bool) -> None:
        self._every_edge = switched(on)
        self._inputs._configure()


class FieldInputs:
    """The inputs of one instance, filtered: `inputs[3]`, as of the last exchange."""

    def __init__(self, group: InputInstances, index: int, state: Any) -> None:
        self._group, self.index, self._state = group, index, state
        self._slow = 0
        self._scan_rate, self._fast, self._slow_scans = 20e3, 5, 500
        self.width = _CONTROL.scan_width.get(group.read(_CONTROL.number, index)) + 1
        """The number of inputs that are scanned."""
        self.counters = [FieldCounter(self, k) for k in group.counters_of(index, self.width)]
        """The counters whose two inputs exist."""

    def __len__(self) -> int:
        return self.width

    def __getitem__(self, number: int) -> bool:
        return bool(self._state.filtered >> self._known(number) & 1)

    def __iter__(self) -> Iterator[bool]:
        return (self[n] for n in range(self.width))

    def raw(self, number: int) -> bool:
        """An input before its filter."""
        return bool(self._state.raw >> self._known(number) & 1)

    def is_slow(self, number: int) -> bool:
        """Whether an input has the slow filter."""
        return bool(self._slow >> self._known(number) & 1)

    def set_slow(self, number: int, slow: bool = True) -> None:
        """Give an input the slow filter, or the fast one; the next exchange writes it."""
        mask = 1 << self._known(number)
        self._slow = self._slow | mask if switched(slow) else self._slow & ~mask
        self._group.update()

    def _known(self, number: int) -> int:
        if not 0 <= number < self.width:
            raise IndexError(f"{self._group.descriptor.name} {self.index} has no input {number}")
        return number

    @property
    def scan_rate(self) -> float:
        """Looks at each input per second, as the hardware's divider makes it; the default is 20 kHz.

        Set: what is more than 10 million (InMux: 5 million) looks a second at all inputs together becomes
        that. Raises ValueError for less than the divider can.
        """
        return self._group.clock / (4 * self.width * (self._divider(self._scan_rate) + 1))

    @scan_rate.setter
    def scan_rate(self, hertz: float) -> None:
        self._divider(hertz)
        self._scan_rate = hertz
        self._configure()

    def _divider(self, hertz: float) -> int:
        fastest = _FASTEST[Gtag(self._group.descriptor.gtag)] / self.width
        divider = self._group.clock / (4 * self.width * min(hertz, fastest)) - 1 if hertz > 0 else -1
        if not -0.5 <= divider < _CONTROL.divider.maximum + 0.5:
            slowest = self._group.clock / (4 * self.width * (_CONTROL.divider.maximum + 1))
            raise ValueError(f"scan rate {hertz} Hz is outside {slowest:.0f}..{fastest:.0f} Hz")
        return max(0, round(divider))

    @property
    def fast_scans(self) -> int:
        """Scans an input must be stable behind the fast filter, 0 to 63; the default is 5."""
        return self._fast

    @fast_scans.setter
    def fast_scans(self, scans: int) -> None:
        _CONTROL.fast_scans.put(scans)
        self._fast = scans
        self._configure()

    @property
    def slow_scans(self) -> int:
        """Scans an input must be stable behind the slow filter, 0 to 1023; the default is 500."""
        return self._slow_scans

    @slow_scans.setter
    def slow_scans(self, scans: int) -> None:
        _CONTROL.slow_scans.put(scans)
        self._slow_scans = scans
        self._configure()

    def control_word(self) -> int:
        """The control register; inputs are inverted, which matches existing boards."""
        return (
            _CONTROL.invert.mask
            | _CONTROL.divider.put(self._divider(self._scan_rate))
            | _CONTROL.fast_scans.put(self._fast)
            | _CONTROL.slow_scans.put(self._slow_scans)
        )

    def filter_word(self) -> int:
        """The filter register."""
        return self._slow

    def _configure(self) -> None:
        self._group.write(_CONTROL.number, self.control_word(), self.index)
        modes = sum(_MODES[c.index].put(c.every_edge) for c in self.counters)
        self._group.write(Registers.mpg.number, modes, self.index)

    def __repr__(self) -> str:
        on = " ".join(str(n) for n, level in enumerate(self) if level) or "none"
        return f"<{type(self._group).__name__} {self.index} on: {on}>"


class InputInstances(Instances[FieldInputs]):
    """What InM and InMux have in common. Inputs only: pins are claimed when first used."""

    def __init__(self, board: Board, gtag: int) -> None:
        super().__init__(board, gtag)
        count = self.descriptor.instances
        self._filters: Any = ffi.new("uint32_t[]", count)
        self._states: Any = ffi.new("hm2_field_input[]", count)
        self._instances = [FieldInputs(self, n, self._states + n) for n in range(count)]
        for inputs in self._instances:
            pins = self.pins(inputs.index)
            owner = f"{self.descriptor.name} {inputs.index}"
            board.ioport.claim(pins, owner, after_bite=True)
        self._restore()
        self._join_cycle()
        board.on_restore(self._restore)

    def _join_cycle(self) -> None:
        group: Any = ffi.new("hm2_field_inputs *")
        group.inputs, group.count = self._states, len(self)
        group.filtered_address = self.address(Registers.filtered.number)
        group.raw_address = self.address(Registers.raw.number)
        group.mpg_address = self.address(Registers.mpg.number)
        group.instance_stride = self.descriptor.instance_stride
        part = ffi.new("hm2_cyclic *")
        lib.hm2_field_inputs_part(group, part)
        self.board.cycle.add(part, (group, part, self._states), Order.IOPORT)
        self.cyclic(Registers.filter.number, self._filters, write=True, order=Order.IOPORT)

    def counters_of(self, index: int, width: int) -> list[int]:
        """The counters that exist."""
        return [k for k in range(_COUNTERS) if 2 * k + 1 < width]

    def update(self) -> None:
        """Bring all filters into the words that the next exchange writes."""
        for inputs in self._instances:
            self._filters[inputs.index] = inputs.filter_word()

    def _restore(self) -> None:
        self.update()
        for inputs in self._instances:
            inputs._configure()
        self.board.write(self.address(Registers.filter.number), list(self._filters))


class Inms(InputInstances):
    """The card's InM inputs: each has a pin of its own."""

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.INM)

    def counters_of(self, index: int, width: int) -> list[int]:
        """The counters both of whose inputs have a pin."""
        numbers = {pin.secondary_pin for pin in self.pins(index)}
        return [k for k in range(_COUNTERS) if {2 * k + 1, 2 * k + 2} <= numbers]


class Inmuxes(InputInstances):
    """The card's InMux inputs: one data pin, the card drives the address."""

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.INMUX)
