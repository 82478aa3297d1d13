"""The watchdog: lets go of all outputs when the host falls silent.

Source: fact sheets registers 2.2 and card_observed 3.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.board import SafeOff
from hostmot2.cycle import Order
from hostmot2.modules.instances import whole
from hostmot2.registers import Gtag
from hostmot2.registers import Watchdog as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

DEFAULT_TIMEOUT = 0.05
"""Seconds; as long as the watchdogs of smart-serial remotes."""


class Watchdog:
    """The card's watchdog.

    Armed, it must be reloaded within `timeout` seconds, which every exchange of the board's cycle does. When
    it bites, the card stops driving all pins; from then on every write is refused until acknowledge().
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._module = board.module(Gtag.WATCHDOG)
        self._timeout = DEFAULT_TIMEOUT
        self._counting = False  # the card's counter may run, so its status tells of a bite
        self._part = ffi.new("hm2_cyclic *")
        self._state: Any = ffi.new("hm2_watchdog *")
        self._state.board = board.handle
        self._state.status_address = self._address(Registers.status.number)
        self._state.reset_address = self._address(Registers.reset.number)
        lib.hm2_watchdog_part(self._state, self._part)
        board.cycle.add(self._part, self, Order.WATCHDOG)
        board.cycle.after(self._raise_bite)
        board.cycle.watched = True
        board.on_close(self._bite_now, SafeOff.WATCHDOG)

    def _address(self, register: int) -> int:
        return self._module.register_address(register)

    @property
    def timeout(self) -> float:
        """Seconds without a reload until the bite; the default is 0.05.

        Set: more than 0, at most 2^31 periods of ClockLow (64 s on a 5I25). Takes effect at once if armed.
        """
        return self._timeout

    @timeout.setter
    def timeout(self, seconds: float) -> None:
        self._periods(seconds)
        self._timeout = seconds
        if self.armed:
            self._board.write(self._address(Registers.timer.number), self._periods(seconds))

    def _periods(self, seconds: float) -> int:
        periods = whole(seconds * self._module.clock) - 1
        if not 0 <= periods <= Registers.timer.count.maximum:
            limit = (Registers.timer.count.maximum + 1) / self._module.clock
            raise ValueError(f"watchdog timeout {seconds} s is outside 0..{limit:.1f} s")
        return periods

    @property
    def armed(self) -> bool:
        """Whether the watchdog is counting and reloaded by the cycle."""
        return bool(self._state.armed)

    @property
    def has_bitten(self) -> bool:
        """Whether it has bitten since it was armed, as seen by the last exchange or by check()."""
        return bool(self._state.has_bitten)

    def arm(self, timeout: float | None = None) -> None:
        """Start counting. Raises WatchdogBite if an earlier bite has not been acknowledged.

        The timer is loaded before the first reload: a reload before it would bite at once. The status is 1
        after configuration, which is no bite; it is cleared before the timer runs, so that no bite is.
        """
        if timeout is not None:
            self.timeout = timeout
        with self._board.lock:
            self._raise_bite()
            if self.armed:
                return
            if self._counting:
                self.check()
                self._raise_bite()
            else:
                self._board.write(self._address(Registers.status.number), 0)
            self._counting = True  # whatever becomes of the write
            self._board.write(self._address(Registers.timer.number), self._periods(self._timeout))
            self._state.armed = 1

    def relax(self) -> None:
        """Take the longest time there is, for when outputs are off and exchanges end: 64 s on a 5I25.

        Stopping the counter would be a bite. arm() brings the timeout back, and finds a bite meanwhile.
        """
        with self._board.lock:
            if self.armed:
                self._state.armed = 0
                self._board.write(self._address(Registers.timer.number), Registers.timer.count.maximum)

    def feed(self) -> None:
        """Reload the counter now; the cycle does it by itself. Raises WatchdogBite."""
        self._raise_bite()
        if self.armed:
            self._board.write(self._state.reset_address, self._state.reset)

    def check(self) -> bool:
        """Read the status now; a bite shuts the gate for writes. Returns has_bitten."""
        with self._board.lock:
            bitten = self._board.read(self._state.status_address) & Registers.status.has_bitten.mask
            if bitten and self._counting:
                self._state.has_bitten = 1
                self._state.armed = 0
                lib.hm2_board_set_gate(self._board.handle, 1)
        return self.has_bitten

    def confirm(self) -> None:
        """Make sure that it has not bitten: feed it, so that all its time is left, and look.

        Raises WatchdogBite; does nothing while it is not armed.
        """
        self.feed()
        self.check()
        self._raise_bite()

    def acknowledge(self) -> None:
        """Accept a bite: writes are allowed again, the card's configuration is written anew.

        Outputs stay off until they are enabled again; the watchdog stays disarmed until arm(). Without a
        bite nothing is done.
        """
        with self._board.lock:
            if not self.check():
                return
            self._state.has_bitten = 0
            self._counting = False
            lib.hm2_board_set_gate(self._board.handle, 0)
            try:
                self._board.write(self._address(Registers.timer.number), Registers.timer.stopped.mask)
                self._board.write(self._address(Registers.status.number), 0)
                self._board.restore()
            except BaseException:  # half restored is not restored: acknowledge() again
                self._state.has_bitten = 1
                self._counting = True
                lib.hm2_board_set_gate(self._board.handle, 1)
                raise

    def _raise_bite(self) -> None:
        if self._state.has_bitten:
            raise errors.WatchdogBite(
                f"{self._board.name}: the watchdog has bitten: no exchange for {self._timeout * 1e3:g} ms, "
                "the card has let go of all outputs. Find out why, make the machine safe, then call "
                "watchdog.acknowledge() and enable what you need",
                address=self._state.status_address,
            )

    def _bite_now(self) -> None:
        """Make the card let go of its pins within a few clocks, whatever drove them."""
        lib.hm2_board_set_gate(self._board.handle, 0)
        self._state.armed = 0
        self._counting = False
        self._board.write(self._address(Registers.timer.number), 0)

    def __repr__(self) -> str:
        state = "BITTEN" if self.has_bitten else "armed" if self.armed else "off"
        return f"<Watchdog {state}, timeout {self._timeout * 1e3:g} ms>"
