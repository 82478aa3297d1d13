"""Resolvers. Turns are counted in csrc/resolver.c by each exchange. Source: fact sheet registers 2.10."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.cycle import Order
from hostmot2.modules.instances import Instances, switched
from hostmot2.registers import Gtag, ResolverExcitation
from hostmot2.registers import Resolver as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

_CHANNELS = 6
_TURN = 2.0**32
_COMMAND_TIMEOUT = 1.0
_LOOK_EVERY = 1e-4
_DIVIDERS = {
    10: (ResolverExcitation.KHZ_10, 5000),
    5: (ResolverExcitation.KHZ_5, 10000),
    2.5: (ResolverExcitation.KHZ_2_5, 20000),
}
"""By nominal kHz: the command and the clocks of a period."""


class Resolver:
    """One resolver. Readings are those of the last exchange."""

    def __init__(self, resolvers: Resolvers, index: int, state: Any) -> None:
        self._all, self.index, self._state = resolvers, index, state
        self._scale = 1.0
        state.index_divisor = 1

    @property
    def angle(self) -> float:
        """The electrical angle, 0 to 1 turn."""
        return int(self._state.turns & 0xFFFFFFFF) / _TURN

    @property
    def count(self) -> int:
        """Position in 2^-24 electrical turns since the zero."""
        return int(self._state.turns - self._state.zero) >> 8

    @property
    def position(self) -> float:
        """Units: electrical turns since the zero times `scale`; at the start the absolute angle."""
        return int(self._state.turns - self._state.zero) / _TURN * self._scale

    @property
    def velocity(self) -> float:
        """Units per second, as the hardware measures it."""
        word = int(self._all.words[1 + self.index])
        per_period = (word - (1 << 32) if word >> 31 else word) / _TURN
        return per_period * self._all.excitation * self._scale

    @property
    def scale(self) -> float:
        """Units per electrical turn; not 0."""
        return self._scale

    @scale.setter
    def scale(self, units: float) -> None:
        if not math.isfinite(units) or units == 0:
            raise ValueError(f"resolver {self.index}: scale {units} units per turn")
        self._scale = units

    @property
    def flag(self) -> bool:
        """The resolver's bit in the status register, as it is.

        The register's description calls it "valid", LinuxCNC reports it as "error": the sources disagree, so
        nothing is concluded from it here. See which it is on your card by unplugging a resolver.
        """
        return bool(self._all.words[0] >> self.index & 1)

    def reset(self) -> None:
        """Make the present position 0."""
        self._state.zero = self._state.turns

    @property
    def index_enable(self) -> bool:
        """Set: the next pass through angle 0 becomes position 0 and clears this."""
        return bool(self._state.index_enable)

    @index_enable.setter
    def index_enable(self, on: bool) -> None:
        self._state.index_enable = switched(on)

    @property
    def index_divisor(self) -> int:
        """Electrical turns between two indexes (pole pairs), 1 to 1000; the default is 1."""
        return int(self._state.index_divisor)

    @index_divisor.setter
    def index_divisor(self, turns: int) -> None:
        if not 1 <= turns <= 1000:
            raise ValueError(f"resolver {self.index}: index divisor {turns} is outside 1..1000")
        self._state.index_divisor = turns

    def __repr__(self) -> str:
        return f"<Resolver {self.index} position {self.position:g} angle {self.angle:.6f}>"


class Resolvers(Instances[Resolver]):
    """The card's six resolvers. Raises UnsupportedFirmware for more than one module's worth.

    The excitation is switched on when they are first used; it turns nothing.
    """

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.RESOLVER)
        if self.descriptor.instances != 1:
            raise errors.UnsupportedFirmware(
                f"{board.name}: {self.descriptor.instances} resolver modules, but the channels of one are as "
                "far apart as the modules: where the second lies is not known",
                expected=1,
                received=self.descriptor.instances,
            )
        self.words: Any = ffi.new("uint32_t[]", 1 + 2 * _CHANNELS)
        self._states: Any = ffi.new("hm2_resolver[]", _CHANNELS)
        self._instances = [Resolver(self, n, self._states + n) for n in range(_CHANNELS)]
        board.ioport.claim(self.pins(0), "resolver", after_bite=True)
        self._nominal: float = 5
        self._excite()
        self._join_cycle()
        board.on_restore(self._excite)

    def _join_cycle(self) -> None:
        group: Any = ffi.new("hm2_resolvers *")
        group.resolvers, group.words, group.count = self._states, self.words, _CHANNELS
        group.status_address = self.address(Registers.status.number)
        group.velocity_address = self.address(Registers.velocity.number)
        group.position_address = self.address(Registers.position.number)
        part = ffi.new("hm2_cyclic *")
        lib.hm2_resolvers_part(group, part)
        self.board.cycle.add(part, (group, part, self._states, self.words), Order.ENCODERS)

    @property
    def excitation(self) -> float:
        """Hz of the excitation, as the card's clock makes it."""
        return self.clock / _DIVIDERS[self._nominal][1]

    @property
    def excitation_khz(self) -> float:
        """Nominal excitation: 10, 5 (the default) or 2.5 kHz. Setting it waits for the signal processor.

        Raises ModuleTimeout if it does not answer within a second.
        """
        return self._nominal

    @excitation_khz.setter
    def excitation_khz(self, kilohertz: float) -> None:
        if kilohertz not in _DIVIDERS:
            raise ValueError(f"the excitation is 10, 5 or 2.5 kHz, not {kilohertz}")
        old, self._nominal = self._nominal, kilohertz
        try:
            self._excite()
        except errors.HostMot2Error:
            self._nominal = old
            raise

    def _excite(self) -> None:
        self._await_idle()
        self.write(Registers.command.number, int(_DIVIDERS[self._nominal][0]))
        self._await_idle()

    def _await_idle(self) -> None:
        deadline = self.board.now_ns() + round(_COMMAND_TIMEOUT * 1e9)
        while (command := self.read(Registers.command.number)) != 0:
            if self.board.now_ns() > deadline:
                raise errors.ModuleTimeout(
                    f"resolver: command 0x{command:X} is not done after {_COMMAND_TIMEOUT:g} s",
                    address=self.address(Registers.command.number),
                    expected=0,
                    received=command,
                )
            self.board.pause(_LOOK_EVERY)
