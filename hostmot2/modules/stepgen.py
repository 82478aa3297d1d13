"""Step generators. The tracking is in csrc/stepgen.c, run by each exchange of the board's cycle.

Source: fact sheets registers 2.7 and card_observed 6.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.board import SafeOff
from hostmot2.cycle import Order
from hostmot2.modules.instances import Instances, switched
from hostmot2.registers import Gtag, StepgenMode
from hostmot2.registers import Stepgen as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

_WITH_SWAP = (0x42, 0xC2)
_MASTER_DDS_FULL = 0xFFFFFFFF
_LONGEST = 0x3FFF
_TIMES = {
    "step_length": Registers.pulse_length,
    "step_space": Registers.pulse_idle,
    "direction_setup": Registers.direction_setup,
    "direction_hold": Registers.direction_hold,
}
_EXTRA_CLOCKS = {"step_length": 1, "step_space": 3, "direction_setup": 0, "direction_hold": 0}
"""Clocks the hardware adds: pulses last N + 1, pauses N + 3."""


class Stepgen:
    """One step generator. Readings are those of the board's last exchange.

    Off until `enable` is set: rate 0, pins not driven. Set `scale` and the pulse times first.
    """

    def __init__(self, stepgens: Stepgens, index: int, state: Any) -> None:
        self._all = stepgens
        self._state = state
        self._clocks = dict.fromkeys(_TIMES, _LONGEST)
        self._mode, self._swap = StepgenMode.STEP_DIRECTION, False
        self.index = index
        state.scale = 1.0
        state.clock_hz = stepgens.clock
        state.max_velocity = math.inf
        self._configure()

    def _configure(self) -> None:
        for name, register in _TIMES.items():
            self._all.write(register.number, self._clocks[name], self.index)
        self._all.write(
            Registers.mode.number, int(self._mode) | Registers.mode.swap.put(self._swap), self.index
        )
        pulse, pause = self._clocks["step_length"] + 1, self._clocks["step_space"] + 3
        self._state.max_step_rate = self._all.clock / (pulse + pause)

    @property
    def position(self) -> float:
        """Units, from the hardware's own accumulator; 0 at the first exchange.

        The accumulator does not know of pins that the watchdog let go: behind a bite it holds steps that were
        not made, until acknowledge() stops it. Find the machine's position anew.
        """
        return float(self._state.position)

    @property
    def count(self) -> int:
        """Whole steps made since the first exchange, rounded down."""
        return int(self._state.subcounts >> 16)

    @property
    def velocity(self) -> float:
        """Units per second, as commanded to the hardware."""
        return float(self._state.velocity)

    @property
    def scale(self) -> float:
        """Steps per unit; not 0. Negative turns the direction round."""
        return float(self._state.scale)

    @scale.setter
    def scale(self, steps_per_unit: float) -> None:
        if not math.isfinite(steps_per_unit) or steps_per_unit == 0:
            raise ValueError(f"stepgen {self.index}: scale {steps_per_unit} steps per unit")
        self._state.scale = steps_per_unit

    @property
    def max_velocity(self) -> float:
        """Units per second, > 0; infinity (the default): what the pulse times allow."""
        return float(self._state.max_velocity)

    @max_velocity.setter
    def max_velocity(self, limit: float) -> None:
        if not limit > 0:
            raise ValueError(f"stepgen {self.index}: maximum velocity {limit}")
        self._state.max_velocity = limit

    @property
    def max_acceleration(self) -> float:
        """Units per second squared; 0 (the default): not limited."""
        return float(self._state.max_acceleration)

    @max_acceleration.setter
    def max_acceleration(self, limit: float) -> None:
        if not limit >= 0:
            raise ValueError(f"stepgen {self.index}: maximum acceleration {limit}")
        self._state.max_acceleration = limit

    @property
    def max_step_rate(self) -> float:
        """Steps per second that the pulse times allow."""
        return float(self._state.max_step_rate)

    def set_times(self, **seconds: float) -> None:
        """Set pulse times in seconds: step_length, step_space, direction_setup, direction_hold.

        Each is rounded up to whole clocks and at most 16383 of them. Raises TypeError for other names,
        ValueError for times that cannot be. A step length of 0 would leave the output high for ever.
        """
        clocks = dict(self._clocks)
        for name, time in seconds.items():
            if name not in _TIMES:
                raise TypeError(f"no pulse time {name!r}; there are {', '.join(_TIMES)}")
            if not 0 <= time * self._all.clock < math.inf:
                raise ValueError(f"stepgen {self.index}: {name} {time} s")
            wanted = math.ceil(time * self._all.clock - 1e-6) - _EXTRA_CLOCKS[name]
            clocks[name] = max(wanted, 1 if name in ("step_length", "step_space") else 0)
            if clocks[name] > _LONGEST:
                raise ValueError(
                    f"stepgen {self.index}: {name} {time} s is over {_LONGEST / self._all.clock} s"
                )
        self._clocks = clocks
        self._configure()

    @property
    def mode(self) -> StepgenMode:
        """Step and direction (the default), up and down, or quadrature."""
        return self._mode

    @mode.setter
    def mode(self, mode: StepgenMode) -> None:
        if mode == StepgenMode.TABLE:
            raise ValueError(f"stepgen {self.index}: use set_table for the table mode")
        self._mode = StepgenMode(mode)
        self._configure()

    def set_table(self, patterns: Sequence[int]) -> None:
        """Step through 1 to 16 output patterns (bit n drives output n); selects the table mode."""
        if not 1 <= len(patterns) <= 16:
            raise ValueError(f"stepgen {self.index}: a table has 1 to 16 entries, not {len(patterns)}")
        patterns = [operator.index(pattern) for pattern in patterns]
        for pattern in patterns:
            if not 0 <= pattern <= 0xFFFFFFFF:
                raise ValueError(f"stepgen {self.index}: output pattern {pattern} is outside 0..0xFFFFFFFF")
        for pattern in reversed(patterns):  # the hardware takes the last entry first
            self._all.write(Registers.table_data.number, pattern, self.index)
        self._all.write(Registers.table_length.number, len(patterns) - 1, self.index)
        self._mode = StepgenMode.TABLE
        self._configure()

    def swap_outputs(self, swap: bool = True) -> None:
        """Exchange the step and direction pins. Raises UnsupportedFirmware before version 0x42."""
        if self._all.version not in _WITH_SWAP:
            raise errors.UnsupportedFirmware(
                f"stepgen version {self._all.version:#x} cannot swap step and direction; 0x42 and 0xC2 can"
            )
        self._swap = swap
        self._configure()

    def latch_index(self) -> None:
        """Refused: raises UnsupportedFirmware.

        The published hardware and the drivers in use disagree on the bits of index and probe latching.
        """
        raise errors.UnsupportedFirmware(
            "stepgen index and probe: the published hardware description and drivers in use give the mode "
            "bits differently, so a latched position could be wrong; home with an encoder or an input instead"
        )

    @property
    def velocity_command(self) -> float:
        """Units per second to run at; setting it selects velocity control."""
        return float(self._state.velocity_command)

    @velocity_command.setter
    def velocity_command(self, velocity: float) -> None:
        self._state.velocity_command = velocity
        self._state.position_control = 0

    @property
    def position_command(self) -> float:
        """Units to be at; setting it selects position control. Set it anew before each exchange."""
        return float(self._state.position_command)

    @position_command.setter
    def position_command(self, position: float) -> None:
        self._state.position_command = position
        self._state.position_control = 1

    @property
    def enable(self) -> bool:
        """Whether steps may be made. Setting it drives the pins; clearing it stops at once."""
        return bool(self._state.enable)

    @enable.setter
    def enable(self, on: bool) -> None:
        on = switched(on)
        if on:
            self._all.drive(self.index, f"stepgen {self.index}")
            if not self._state.position_control:
                self._state.position_command = self._state.position
            if not self._state.enable:
                self._state.velocity = self._state.rate = 0  # not what it ran at when it was switched off
        self._state.enable = on
        if not on:
            with suppress(errors.WatchdogBite):  # then the pins are off already
                self._all.write(Registers.rate.number, 0, self.index)

    def __repr__(self) -> str:
        state = "on" if self.enable else "off"
        return f"<Stepgen {self.index} {state} position {self.position:g} velocity {self.velocity:g}>"


class Stepgens(Instances[Stepgen]):
    """The card's step generators. All stop, commands 0, when the board closes and after a watchdog bite."""

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.STEPGEN)
        self.version = self.descriptor.version
        count = self.descriptor.instances
        self._states: Any = ffi.new("hm2_stepgen[]", count)
        self._words: Any = ffi.new("uint32_t[]", 2 * count)
        self._group: Any = ffi.new("hm2_stepgens *")
        self._group.stepgens, self._group.words, self._group.count = self._states, self._words, count
        self._group.rate_address = self.address(Registers.rate.number)
        self._group.accumulator_address = self.address(Registers.accumulator.number)
        self._stop()
        self._instances = [Stepgen(self, n, self._states + n) for n in range(count)]
        self.write(Registers.master_dds.number, _MASTER_DDS_FULL)
        part = ffi.new("hm2_cyclic *")
        lib.hm2_stepgens_part(self._group, part)
        board.cycle.add(part, (self, part), Order.GENERATORS)
        board.on_restore(self._restore, SafeOff.GENERATORS)
        board.on_close(self._stop, SafeOff.GENERATORS)

    def _stop(self) -> None:
        for n in range(self.descriptor.instances):
            self._states[n].enable = self._states[n].velocity = self._states[n].rate = 0
            self.write(Registers.rate.number, 0, n)

    def _restore(self) -> None:
        self._stop()
        for stepgen in self._instances:
            stepgen.velocity_command = 0.0  # what was wanted before a bite is not wanted by itself after it
            stepgen._configure()
        self.write(Registers.master_dds.number, _MASTER_DDS_FULL)
