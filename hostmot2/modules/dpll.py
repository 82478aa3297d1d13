"""HM2DPLL: a clock on the card that follows the host's cycle, for sampling at an exact moment.

Source: fact sheets registers 2.8 and card_observed 8.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from hostmot2._core import ffi, lib
from hostmot2.cycle import Order
from hostmot2.registers import Dpll as Registers
from hostmot2.registers import Gtag

if TYPE_CHECKING:
    from hostmot2.board import Board

_SETTLE_CYCLES = 100
"""Exchanges at the start in which the phase is set rather than followed."""
_DEFAULT_LIMIT = 0x400000
_DEFAULT_TIME_CONSTANT = 2000


class Dpll:
    """The card's DPLL. Each exchange's reading of the sync register is its phase reference.

    Reading that register moves the loop, so nothing but the cycle reads it. Set `frequency` to the rate of
    your exchanges. Timer times are relative to the exchange: negative is before it.
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._module = board.module(Gtag.DPLL)
        self._state: Any = ffi.new("hm2_dpll *")
        self._timers = [0.0] * 4
        self._limit, self._time_constant = _DEFAULT_LIMIT, _DEFAULT_TIME_CONSTANT
        control1 = Registers.control1
        self.accumulator_bits = control1.accumulator_size.get(board.read(self._address(control1.number)))
        """Width of the phase accumulator."""
        self._frequency = 1000.0
        self._join_cycle()
        self._restore()
        board.on_restore(self._restore)

    def _address(self, register: int) -> int:
        return self._module.register_address(register)

    def _join_cycle(self) -> None:
        state = self._state
        state.sync_address = self._address(Registers.sync.number)
        state.phase_address = self._address(Registers.phase.number)
        state.control0_address = self._address(Registers.control0.number)
        part: Any = ffi.new("hm2_cyclic *")
        lib.hm2_dpll_part(state, part)
        self._board.cycle.add(part, state, Order.DPLL)

    @property
    def frequency(self) -> float:
        """Hz: the rate of the exchanges. Setting it starts the loop anew."""
        return self._frequency

    @frequency.setter
    def frequency(self, hertz: float) -> None:
        prescale, base = self._rates(hertz)
        if not 1 <= prescale <= 255 or not 0 < base <= 0xFFFFFFFF:
            raise ValueError(f"DPLL frequency {hertz} Hz cannot be made from {self._module.clock} Hz")
        self._frequency = hertz
        self._restore()

    def _rates(self, hertz: float) -> tuple[int, int]:
        full = 2.0**self.accumulator_bits
        ratio = 2**30 * self._module.clock / (full * hertz) if hertz > 0 else 0.0
        if not 0 < ratio < math.inf:
            return 0, 0
        prescale = max(1, int(ratio))
        return prescale, int(hertz * full * prescale / self._module.clock)

    @property
    def phase_error(self) -> float:
        """Seconds between the card's cycle and the last exchange."""
        raw = int(self._state.sync)
        return (raw - (1 << 32) if raw >> 31 else raw) / float(1 << 32) / self._frequency

    def set_timer(self, number: int, seconds: float) -> None:
        """Let timer 1 to 4 come `seconds` after the exchange; negative: before it. Less than one period.

        Raises ValueError.
        """
        index = self._index(number)
        if not abs(seconds) * self._frequency < 1:
            raise ValueError(
                f"DPLL timer {number}: {seconds} s is not within one period of {self._frequency} Hz"
            )
        self._timers[index] = seconds
        self._write_timers()

    def timer(self, number: int) -> float:
        """Seconds after the exchange at which timer 1 to 4 comes. Raises ValueError for another number."""
        return self._timers[self._index(number)]

    def _index(self, number: int) -> int:
        if not 1 <= number <= 4:
            raise ValueError(f"DPLL timer {number} is outside 1..4")
        return number - 1

    def _write_timers(self) -> None:
        words = [int(-seconds * self._frequency * 65536) & 0xFFFF for seconds in self._timers]
        self._board.write(self._address(Registers.timer_12.number), words[0] | words[1] << 16)
        self._board.write(self._address(Registers.timer_34.number), words[2] | words[3] << 16)

    def _write_control0(self) -> None:
        prescale, _ = self._rates(self._frequency)
        control0 = Registers.control0
        self._state.control0 = control0.prescale.put(prescale) | control0.limit.put(self._limit)
        self._board.write(self._address(control0.number), self._state.control0)

    def _restore(self) -> None:
        _, base = self._rates(self._frequency)
        self._board.write(self._address(Registers.base_rate.number), base)
        self._write_control0()
        control1 = Registers.control1
        self._board.write(self._address(control1.number), control1.filter_prescale.put(self._time_constant))
        self._write_timers()
        self._state.settling = _SETTLE_CYCLES

    def __repr__(self) -> str:
        return f"<Dpll {self._frequency:g} Hz, phase error {self.phase_error * 1e6:.1f} us>"
