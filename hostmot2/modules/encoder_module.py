"""All encoders of a card, and the settings that the encoders of one module share.

Source: fact sheets registers 2.4 and card_observed 4 and 5.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, overload

from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.cycle import Order
from hostmot2.idrom import ModuleDescriptor
from hostmot2.modules.encoder import Encoder
from hostmot2.modules.instances import whole
from hostmot2.registers import Encoder as Registers
from hostmot2.registers import Gtag

if TYPE_CHECKING:
    from hostmot2.board import Board

_WITH_PROBE = (0x83, 0x84)
_WITH_SKEW = (4, 0x84)
_DIVIDE_BY_ONE = 0xFFF

TIMESTAMP_RATE = 2e6
"""Hz; the 16-bit stamps then wrap every 33 ms, or 31 where the clock makes it 2.08 MHz (5I25)."""
FILTER_RATE = 25e6
"""Hz, of plain encoders."""
MUX_RATE = 8e6
"""Hz: filter ticks of multiplexed encoders; each pair's wires are switched at half of it."""


class EncoderModule:
    """The settings that all encoders of one module share."""

    def __init__(self, board: Board, descriptor: ModuleDescriptor, first: int) -> None:
        self.board = board
        self._descriptor = descriptor
        self.multiplexed = descriptor.gtag == Gtag.MUXED_ENCODER
        self.version = descriptor.version
        self.has_probe = descriptor.version in _WITH_PROBE
        self.has_skew = self.multiplexed and descriptor.version in _WITH_SKEW
        self._states: Any = ffi.new("hm2_encoder[]", descriptor.instances)
        self._words: Any = ffi.new("uint32_t[]", 1 + 2 * descriptor.instances)
        self._part: Any = ffi.new("hm2_cyclic *")
        self._group = self._new_group()
        self._claim_pins()
        self.encoders = [Encoder(self, first + n, self._states + n) for n in range(descriptor.instances)]
        self._divider, self._skew, self._timer = self._divider_for(self._default_rate()), 0, 0
        self._has_timer_select = self._find_timer_select()
        self.timestamp_rate = TIMESTAMP_RATE
        self._write_filter()
        board.on_restore(self._restore)
        board.cycle.add(self._part, self, Order.ENCODERS)

    def _new_group(self) -> Any:
        group: Any = ffi.new("hm2_encoders *")
        group.encoders, group.words, group.count = self._states, self._words, self._descriptor.instances
        group.count_address = self._address(Registers.count.number)
        group.control_address = self._address(Registers.control.number)
        group.timestamp_address = self._address(Registers.timestamp_count.number)
        group.instance_stride = self._descriptor.instance_stride
        lib.hm2_encoders_part(group, self._part)
        return group

    def _claim_pins(self) -> None:
        """Inputs are read from the pads as they are; the multiplexer's select lines must be driven."""
        for pin in self.board.pins:
            if pin.secondary_gtag == self._descriptor.gtag:
                self.board.ioport.take([pin], pin.module)
            elif self.multiplexed and pin.secondary_gtag == Gtag.MUXED_ENCODER_SELECT:
                self.board.ioport.claim([pin], pin.module, after_bite=True)

    def _address(self, register: int) -> int:
        return self._descriptor.register_address(register)

    def _default_rate(self) -> float:
        return MUX_RATE if self.multiplexed else min(FILTER_RATE, float(self._descriptor.clock))

    def _divider_for(self, rate: float) -> int:
        divider = whole(self._descriptor.clock / rate) - 2 if rate > 0 else -2
        if divider == -1:
            return _DIVIDE_BY_ONE
        if not 0 <= divider <= 0x7FF:
            clock = self._descriptor.clock
            raise ValueError(f"filter rate {rate:g} Hz is outside {clock / 0x801:.0f}..{clock} Hz")
        return divider

    @property
    def filter_rate(self) -> float:
        """Filter ticks per second (multiplexed: twice the rate at which a pair's wires are switched).

        Set: ClockLow / 2049 to ClockLow; rounded to a whole number of clocks per tick.
        """
        return self._descriptor.clock / (1 if self._divider & 0x800 else self._divider + 2)

    @filter_rate.setter
    def filter_rate(self, rate: float) -> None:
        self._divider = self._divider_for(rate)
        self._write_filter()

    @property
    def skew(self) -> float:
        """Seconds by which sampling of multiplexed inputs is delayed (cable); 0 to 15 periods of ClockLow.

        Rule of thumb: 20 ns plus 3 ns per foot of cable; rounded down to clocks. Longer than the multiplexer
        and its cable really take, it swaps the two encoders of each pair. Raises UnsupportedFirmware where
        firmware has none, ValueError.
        """
        return self._skew / self._descriptor.clock

    @skew.setter
    def skew(self, seconds: float) -> None:
        periods = seconds * self._descriptor.clock
        clocks = math.floor(periods + 1e-6) if 0 <= periods < math.inf else -1
        if not self.has_skew and periods:
            raise errors.UnsupportedFirmware(
                f"encoders of version {self.version} cannot delay sampling; 4 and 0x84 can"
            )
        if not 0 <= clocks <= 15:
            raise ValueError(f"skew {seconds} s is outside 0..{15 / self._descriptor.clock:.2e} s")
        self._skew = clocks
        self._write_filter()

    def _write_filter(self) -> None:
        word = self._divider | (self._skew << 28 if self.has_skew else 0)
        self.board.write(self._address(Registers.filter_rate.number), word)

    @property
    def timestamp_rate(self) -> float:
        """Ticks per second of the timestamps velocity is measured with; the default is about 2 MHz.

        Set: ClockLow / 32769 to ClockLow / 2; rounded to what the divider can. Above 2 MHz the stamps
        resolve better and wrap sooner: exchanges must then come faster.
        """
        return 1.0 / float(self._group.timebase.seconds_per_tick)

    @timestamp_rate.setter
    def timestamp_rate(self, rate: float) -> None:
        ticks = self._descriptor.clock / rate if rate > 0 else 0.0
        divider = math.floor(ticks - 2) if ticks < math.inf else -1
        if not 0 <= divider <= 0x7FFF:
            clock = self._descriptor.clock
            raise ValueError(
                f"timestamp rate {rate:g} Hz is outside {clock / 0x8001:.0f}..{clock / 2:.0f} Hz"
            )
        with self.board.lock:
            self.board.write(self._address(Registers.timestamp_divider.number), divider)
            self._timestamp_divider = divider
            self._group.timebase.seconds_per_tick = (divider + 2) / self._descriptor.clock
            self._group.timebase.valid = 0
            for n in range(self._descriptor.instances):  # the times of their last counts were in other ticks
                self._states[n].moving, self._states[n].velocity = 0, 0.0

    def _find_timer_select(self) -> bool:
        """Look for the optional register without touching a neighbour's.

        Without HM2DPLL there are no timers; with generation A addresses other modules lie there.
        """
        address = self._address(Registers.timer_select.number)
        modules = self.board.modules
        if not any(module.gtag == Gtag.DPLL for module in modules):
            return False
        for module in modules:
            if module.base <= address < module.base + 0x100 * module.num_registers:
                return False
        self.board.write(address, 0)
        return bool(self.board.read(address) == 0)

    @property
    def timer(self) -> int | None:
        """The DPLL timer (0: reference, 1 to 4) at which counts are sampled, or None: at each read.

        Raises UnsupportedFirmware where the firmware has no timer selection.
        """
        word = self._timer
        return Registers.timer_select.timer.get(word) if word else None

    @timer.setter
    def timer(self, number: int | None) -> None:
        if not self._has_timer_select:
            raise errors.UnsupportedFirmware("this firmware's encoders cannot be sampled by a DPLL timer")
        if number is not None and not 0 <= number <= 4:
            raise ValueError(f"DPLL timer {number} is outside 0..4")
        select = Registers.timer_select
        self._timer = 0 if number is None else select.enable.mask | select.timer.put(number)
        self.board.write(self._address(select.number), self._timer)

    def max_count_rate(self, *, slow: bool = True, counter_mode: bool = False) -> float:
        """Counts per second up to which none is lost, for ideal signals.

        A plain input needs N/2 ticks per edge (N: 3, slow filter 15); a multiplexed one 2 or 8 ticks, and in
        counter mode four times as long per count. Source: card_observed 4 and 5.
        """
        multiplexed, plain = (8.0, 7.5) if slow else (2.0, 1.5)
        ticks = multiplexed if self.multiplexed else plain
        return self.filter_rate / (ticks * (4 if counter_mode else 1))

    def _restore(self) -> None:
        self._write_filter()
        self.board.write(self._address(Registers.timestamp_divider.number), self._timestamp_divider)
        if self._has_timer_select:
            self.board.write(self._address(Registers.timer_select.number), self._timer)


class Encoders(Sequence[Encoder]):
    """All encoders of the card, plain ones and multiplexed ones, in the order of their modules."""

    def __init__(self, board: Board) -> None:
        self.modules: list[EncoderModule] = []
        self._encoders: list[Encoder] = []
        for descriptor in board.modules:
            if descriptor.gtag in (Gtag.ENCODER, Gtag.MUXED_ENCODER):
                module = EncoderModule(board, descriptor, len(self._encoders))
                self.modules.append(module)
                self._encoders += module.encoders
        if not self.modules:
            board.module(Gtag.ENCODER)  # raises ModuleMissing

    def __len__(self) -> int:
        return len(self._encoders)

    @overload
    def __getitem__(self, index: int) -> Encoder: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Encoder]: ...
    def __getitem__(self, index: int | slice) -> Encoder | Sequence[Encoder]:
        return self._encoders[index]

    def __repr__(self) -> str:
        return "\n".join(map(repr, self._encoders))
