"""Quadrature encoders, plain and multiplexed.

Counting, velocity and index logic are in csrc/encoder.c and csrc/encoder_index.c, run by each exchange of
the board's cycle. Source: fact sheets registers 2.4 and card_observed 4 and 5.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, overload

from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.cycle import Order
from hostmot2.idrom import HostMot2Warning, ModuleDescriptor
from hostmot2.registers import Encoder as Registers
from hostmot2.registers import Gtag

if TYPE_CHECKING:
    from hostmot2.board import Board

_CONTROL = Registers.control
_PROBE_BITS = _CONTROL.probe_polarity.mask | _CONTROL.latch_on_probe.mask
_WITH_PROBE = (0x83, 0x84)
_WITH_SKEW = (4, 0x84)
_DIVIDE_BY_ONE = 0xFFF

TIMESTAMP_RATE = 2e6
"""Hz; the 16-bit stamps then wrap every 33 ms."""
FILTER_RATE = 25e6
"""Hz, of plain encoders."""
MUX_RATE = 8e6
"""Hz: filter ticks of multiplexed encoders; each pair's wires are switched at half of it."""


class Encoder:
    """One encoder. Readings are those of the board's last exchange.

    Set `scale` (counts per unit) to get position and velocity in your units.
    """

    def __init__(self, module: EncoderModule, index: int, state: Any) -> None:
        self._module = module
        self._state = state
        self.index = index
        state.scale = 1.0
        state.velocity_timeout = 0.5
        state.settings = _CONTROL.filter.mask
        state.readable = 0xFFFF if module.has_probe else 0xFFFF & ~_PROBE_BITS

    @property
    def count(self) -> int:
        """Counts since the first exchange, the last zero() or the last index, 64 bits."""
        return int(self._state.raw_count - self._state.zero)

    @property
    def raw_count(self) -> int:
        """Counts, never zeroed; starts at the hardware counter's value."""
        return int(self._state.raw_count)

    @property
    def position(self) -> float:
        """count / scale, in units."""
        return float(self._state.position)

    @property
    def position_interpolated(self) -> float:
        """The position carried on at the velocity since the last count, in units."""
        return float(self._state.interpolated)

    @property
    def velocity(self) -> float:
        """Units per second, from the times of the counts; 0 after velocity_timeout without a count."""
        return float(self._state.velocity)

    @property
    def scale(self) -> float:
        """Counts per unit; not 0. Negative turns the direction round. The default is 1."""
        return float(self._state.scale)

    @scale.setter
    def scale(self, counts_per_unit: float) -> None:
        if counts_per_unit == 0 or counts_per_unit != counts_per_unit:
            raise ValueError(
                f"encoder {self.index}: scale {counts_per_unit} counts per unit makes no position"
            )
        self._state.scale = counts_per_unit

    @property
    def velocity_timeout(self) -> float:
        """Seconds without a count after which the velocity is 0; the default is 0.5."""
        return float(self._state.velocity_timeout)

    @velocity_timeout.setter
    def velocity_timeout(self, seconds: float) -> None:
        if not seconds > 0:
            raise ValueError(f"encoder {self.index}: velocity timeout {seconds} s")
        self._state.velocity_timeout = seconds

    @property
    def inputs(self) -> tuple[bool, bool, bool]:
        """A, B and index after the filter; index also after polarity and gating."""
        word = self._state.control
        return bool(word & 1), bool(word & 2), bool(word & 4)

    def zero(self) -> None:
        """Make the present count 0. The hardware counter is not touched."""
        with self._module.board.lock:
            lib.hm2_encoder_zero(self._state)

    @property
    def quad_error(self) -> bool:
        """Whether A and B have changed together since the first exchange or the last clear_quad_error().

        Not a reliable sign of too high a speed: overspeeding mostly loses counts in silence.
        """
        return bool(self._state.quad_error)

    def clear_quad_error(self) -> None:
        """Forget a quadrature error; a new one is reported again."""
        self._state.quad_error = 0

    def latch_index(self, *, zero: bool = True) -> None:
        """Latch the count at the next index, and with `zero` make it count 0.

        The next exchanges arm the hardware; `latching` falls and `events` grows when the index has come. No
        lost reply or write loses or invents an index.
        """
        self._state.request = lib.HM2_ENCODER_INDEX if zero else lib.HM2_ENCODER_LATCH

    def latch_probe(self) -> None:
        """Latch the count at the next edge of the probe input. Raises UnsupportedFirmware without probe."""
        if not self._module.has_probe:
            raise errors.UnsupportedFirmware(
                f"encoder {self.index}: encoders of version {self._module.version} have no probe input"
            )
        self._state.request = lib.HM2_ENCODER_PROBE

    def cancel_latch(self) -> None:
        """Withdraw latch_index() or latch_probe()."""
        self._state.request = lib.HM2_ENCODER_NONE

    @property
    def latching(self) -> bool:
        """Whether an index or probe event is awaited."""
        return bool(self._state.request != lib.HM2_ENCODER_NONE)

    @property
    def events(self) -> int:
        """Index and probe events so far."""
        return int(self._state.events)

    @property
    def latched_count(self) -> int:
        """The count at the last index or probe event, relative to count 0 of now."""
        return int(self._state.latched - self._state.zero)

    @property
    def latched_position(self) -> float:
        """latched_count / scale, in units."""
        return self.latched_count / self.scale

    def _setting(self, mask: int) -> bool:
        return bool(self._state.settings & mask)

    def _set(self, mask: int, on: bool) -> None:
        self._state.settings = self._state.settings | mask if on else self._state.settings & ~mask

    @property
    def filter(self) -> bool:
        """True: an input must hold for 15 filter ticks (the default), False: for 3."""
        return self._setting(_CONTROL.filter.mask)

    @filter.setter
    def filter(self, slow: bool) -> None:
        self._set(_CONTROL.filter.mask, slow)

    @property
    def counter_mode(self) -> bool:
        """True: A counts rising edges, B gives the direction; False (the default): quadrature."""
        return self._setting(_CONTROL.counter_mode.mask)

    @counter_mode.setter
    def counter_mode(self, on: bool) -> None:
        self._set(_CONTROL.counter_mode.mask, on)

    @property
    def index_active_high(self) -> bool:
        """True: the index is a rising edge; False (the default): a falling one."""
        return self._setting(_CONTROL.index_polarity.mask)

    @index_active_high.setter
    def index_active_high(self, on: bool) -> None:
        self._set(_CONTROL.index_polarity.mask, on)

    @property
    def index_gate(self) -> str:
        """ "none", "low" or "high": the index counts only while A and B are both low or both high."""
        if not self._setting(_CONTROL.ab_gate_index.mask):
            return "none"
        return "high" if self._setting(_CONTROL.ab_mask_polarity.mask) else "low"

    @index_gate.setter
    def index_gate(self, gate: str) -> None:
        if gate not in ("none", "low", "high"):
            raise ValueError(f"index gate {gate!r}: one of none, low, high")
        self._set(_CONTROL.ab_gate_index.mask, gate != "none")
        self._set(_CONTROL.ab_mask_polarity.mask, gate == "high")

    @property
    def index_mask(self) -> str:
        """ "none", "low" or "high": the index counts only at that level of the mask input."""
        if not self._setting(_CONTROL.use_index_mask.mask):
            return "none"
        return "high" if self._setting(_CONTROL.index_mask_polarity.mask) else "low"

    @index_mask.setter
    def index_mask(self, level: str) -> None:
        if level not in ("none", "low", "high"):
            raise ValueError(f"index mask {level!r}: one of none, low, high")
        self._set(_CONTROL.use_index_mask.mask, level != "none")
        self._set(_CONTROL.index_mask_polarity.mask, level == "high")

    @property
    def probe_rising(self) -> bool:
        """Whether the probe latches at a rising edge; needs firmware with probe."""
        return self._setting(_CONTROL.probe_polarity.mask)

    @probe_rising.setter
    def probe_rising(self, on: bool) -> None:
        self._set(_CONTROL.probe_polarity.mask, on)

    @property
    def max_count_rate(self) -> float:
        """Counts per second up to which no count is lost, with ideal signals."""
        return self._module.max_count_rate(slow=self.filter, counter_mode=self.counter_mode)

    def check_speed(self, units_per_second: float) -> bool:
        """Whether that speed can be counted; warns with HostMot2Warning if not."""
        rate, limit = abs(units_per_second * self.scale), self.max_count_rate
        if rate <= limit:
            return True
        warnings.warn(
            f"encoder {self.index}: {units_per_second:g} units/s are {rate:.0f} counts/s, more than the "
            f"{limit:.0f} that its filter and multiplexer can follow: counts would be lost in silence. "
            "Turn the filter off, raise the multiplex rate or use fewer counts per unit",
            HostMot2Warning,
            stacklevel=2,
        )
        return False

    def __repr__(self) -> str:
        return (
            f"<Encoder {self.index} count {self.count} position {self.position:g} velocity {self.velocity:g}"
            f"{' QUAD ERROR' if self.quad_error else ''}>"
        )


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
        divider = round(self._descriptor.clock / rate) - 2 if rate > 0 else -2
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

        Rule of thumb: 20 ns plus 3 ns per foot of cable. Raises UnsupportedFirmware where firmware has none.
        """
        return self._skew / self._descriptor.clock

    @skew.setter
    def skew(self, seconds: float) -> None:
        clocks = round(seconds * self._descriptor.clock)
        if not self.has_skew and clocks:
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
        """Ticks per second of the timestamps velocity is measured with; the default is 2 MHz.

        Above 2 MHz the stamps resolve better and wrap sooner: exchanges must then come faster.
        """
        return 1.0 / float(self._group.timebase.seconds_per_tick)

    @timestamp_rate.setter
    def timestamp_rate(self, rate: float) -> None:
        divider = int(self._descriptor.clock / rate - 2) if rate > 0 else -1
        if not 0 <= divider <= 0x7FFF:
            raise ValueError(f"timestamp rate {rate:g} Hz is outside 0..{self._descriptor.clock / 2:g} Hz")
        with self.board.lock:
            self._timestamp_divider = divider
            self.board.write(self._address(Registers.timestamp_divider.number), divider)
            self._group.timebase.seconds_per_tick = (divider + 2) / self._descriptor.clock
            self._group.timebase.valid = 0

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
