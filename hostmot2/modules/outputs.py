"""Field outputs: SSR (relays behind transformers) and OutM. Source: fact sheet registers 2.17."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from hostmot2.board import SafeOff
from hostmot2.cycle import Order
from hostmot2.modules.instances import CommandedInstances, switched
from hostmot2.registers import Gtag, Outm, Ssr, SsrPin

if TYPE_CHECKING:
    from hostmot2.board import Board

_LOWEST, _HIGHEST, _DEFAULT = 25e3, 25e6, 1e6
"""Hz, of the SSR carrier."""


class FieldOutputs:
    """The outputs of one instance, by number; `outputs[3] = True`. The next exchange writes it.

    Nothing conducts and no pin is driven until `enable` is set.
    """

    def __init__(self, group: OutputInstances, index: int) -> None:
        self._group, self.index = group, index
        self._bits = self._inverted = 0
        self._enable = False
        first, reference = int(SsrPin.OUT_0), int(SsrPin.AC_REFERENCE)  # OutM's outputs have the same
        numbers = {p.secondary_pin for p in group.pins(index)}
        self._numbers = sorted(n - first for n in numbers if first <= n < first + 32 and n != reference)

    def __len__(self) -> int:
        return len(self._numbers)

    def __iter__(self) -> Iterator[bool]:
        return (self[n] for n in self._numbers)

    @property
    def numbers(self) -> tuple[int, ...]:
        """The outputs that have a pin."""
        return tuple(self._numbers)

    def __getitem__(self, number: int) -> bool:
        return bool(self._bits >> self._known(number) & 1)

    def __setitem__(self, number: int, on: bool) -> None:
        mask = 1 << self._known(number)
        self._bits = self._bits | mask if switched(on) else self._bits & ~mask
        self._group.update()

    def invert(self, number: int, on: bool = True) -> None:
        """Make True mean off for one output, and so off mean on; acts while enabled."""
        mask = 1 << self._known(number)
        self._inverted = self._inverted | mask if switched(on) else self._inverted & ~mask
        self._group.update()

    def is_inverted(self, number: int) -> bool:
        """Whether True means off."""
        return bool(self._inverted >> self._known(number) & 1)

    def _known(self, number: int) -> int:
        if number not in self._numbers:
            raise IndexError(f"{self._group.descriptor.name} {self.index} has no output {number}")
        return number

    @property
    def enable(self) -> bool:
        """Whether the outputs are on. Setting it arms the watchdog, clearing it turns all off at once."""
        return self._enable

    @enable.setter
    def enable(self, on: bool) -> None:
        self._enable = switched(on)
        self._group.update()
        if not self._enable:
            self._group.write_now()
        self._group.switch(self.index, self._enable)

    def forget(self) -> None:
        """What it was told to put out is not wanted any more."""
        self._bits = 0

    def word(self) -> int:
        """The data register."""
        return (self._bits ^ self._inverted) if self._enable else 0

    def __repr__(self) -> str:
        states = " ".join(f"{n}={'on' if self[n] else 'off'}" for n in self._numbers)
        name = type(self._group).__name__.removesuffix("s")
        return f"<{name} {self.index} {'enabled' if self._enable else 'off'} {states}>"


class OutputInstances(CommandedInstances[FieldOutputs]):
    """What SSR and OutM have in common: one data word per instance."""

    def __init__(self, board: Board, gtag: int) -> None:
        super().__init__(board, gtag, Outm.data)
        self._instances = [FieldOutputs(self, n) for n in range(self.descriptor.instances)]
        self._off()
        # behind the I/O ports, whose directions must be there first
        self.join_cycle(Order.OTHERS)
        board.on_restore(self._restore)
        board.on_close(self._off, SafeOff.GENERATORS)

    def switch(self, instance: int, on: bool) -> None:
        """Drive the pins of one instance, or let go of them."""
        if on:
            self.write_now()
            self.drive(instance, f"{self.descriptor.name} {instance}")
        else:
            self.let_go(instance)

    def _off(self) -> None:
        for outputs in self._instances:
            outputs._enable = False
        self.update()
        self.write_now()


class Outms(OutputInstances):
    """The card's OutM outputs. All off when the board closes and after a watchdog bite."""

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.OUTM)


class Ssrs(OutputInstances):
    """The card's solid state relays: an output conducts while its bit is set and the carrier runs.

    The carrier runs only while an instance is enabled. All off when the board closes and after a bite.
    """

    def __init__(self, board: Board) -> None:
        self._divider = 0
        self._running: set[int] = set()
        super().__init__(board, Gtag.SSR)
        self.frequency = _DEFAULT

    @property
    def frequency(self) -> float:
        """Hz of the carrier through the transformers, as the hardware makes it; the default is 1 MHz.

        Set: 25 kHz to 25 MHz; what is more than a quarter of ClockLow becomes that. Raises ValueError.
        """
        return self.clock / (self._divider + 2) / 2

    @frequency.setter
    def frequency(self, hertz: float) -> None:
        if not _LOWEST <= hertz <= _HIGHEST:
            raise ValueError(f"SSR carrier of {hertz} Hz: not within {_LOWEST:.0f} to {_HIGHEST:.0f} Hz")
        divider = round(self.clock / (2 * hertz)) - 2
        self._divider = max(0, min(divider, Ssr.rate.divider.maximum))
        for instance in range(len(self)):
            self._write_rate(instance)

    def _off(self) -> None:
        super()._off()
        self._running.clear()
        for instance in range(len(self)):
            self._write_rate(instance)

    def _write_rate(self, instance: int) -> None:
        rate = Ssr.rate.divider.put(self._divider) | Ssr.rate.enable.mask
        self.write(Ssr.rate.number, rate if instance in self._running else 0, instance)

    def switch(self, instance: int, on: bool) -> None:
        """Drive the pins of one instance, or let go of them; the carrier runs in between."""
        if on:
            super().switch(instance, True)
            self._running.add(instance)
            self._write_rate(instance)
        else:
            self._running.discard(instance)
            self._write_rate(instance)
            super().switch(instance, False)
