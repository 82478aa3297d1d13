"""The card's user LEDs. Source: fact sheet registers 2.3."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hostmot2.board import SafeOff
from hostmot2.registers import Gtag
from hostmot2.registers import Led as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

DEFAULT_COUNT = 2
"""LEDs of a board that is not in the board table: every known board has at least two."""


class Leds:
    """The LEDs CR01, CR02, ... as a sequence of booleans: `hm2.leds[0] = True`.

    The register can only be written, so what is shown is what was last set. Off after close.
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._address = board.module(Gtag.LED).register_address(Registers.data.number)
        facts = board.inventory.board
        self._states = [False] * (facts.leds if facts else DEFAULT_COUNT)
        self._write()
        board.on_restore(self._write)
        board.on_close(self.off, SafeOff.LEDS)

    def _write(self) -> None:
        self._board.write(self._address, sum(1 << 31 - n for n, lit in enumerate(self._states) if lit))

    def off(self) -> None:
        """All off."""
        self._states = [False] * len(self._states)
        self._write()

    def __len__(self) -> int:
        return len(self._states)

    def __getitem__(self, index: int) -> bool:
        return self._states[index]

    def __setitem__(self, index: int, lit: bool) -> None:
        self._states[index] = bool(lit)
        self._write()

    def __repr__(self) -> str:
        lit = " ".join(f"CR{n + 1:02}={'on' if lit else 'off'}" for n, lit in enumerate(self._states))
        return f"<Leds {lit}>"
