"""One quadrature encoder, plain or multiplexed.

Counting, velocity and index logic are in csrc/encoder.c and csrc/encoder_index.c, run by each exchange of
the board's cycle. Source: fact sheets registers 2.4 and card_observed 4 and 5.
"""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any

from hostmot2 import errors
from hostmot2._core import lib
from hostmot2.idrom import HostMot2Warning
from hostmot2.modules.instances import switched
from hostmot2.registers import Encoder as Registers

if TYPE_CHECKING:
    from hostmot2.modules.encoder_module import EncoderModule

_CONTROL = Registers.control
_PROBE_BITS = _CONTROL.probe_polarity.mask | _CONTROL.latch_on_probe.mask


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
        """Units per second, from the times of the counts; 0 after velocity_timeout without a count.

        The 16-bit stamps wrap every 33 ms (see timestamp_rate): with exchanges further apart than that an
        axis that counts less often than it is read looks faster than it is.
        """
        return float(self._state.velocity)

    @property
    def scale(self) -> float:
        """Counts per unit; not 0. Negative turns the direction round. The default is 1."""
        return float(self._state.scale)

    @scale.setter
    def scale(self, counts_per_unit: float) -> None:
        if not math.isfinite(counts_per_unit) or counts_per_unit == 0:
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
        self._state.settings = self._state.settings | mask if switched(on) else self._state.settings & ~mask

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
