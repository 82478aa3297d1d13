"""A pad of an emulated card, seen and driven from outside."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hostmot2._core import lib

if TYPE_CHECKING:
    from hostmot2.emulator.board import EmulatedBoard

_LEVELS = {
    lib.HM2_LEVEL_LOW: "0",
    lib.HM2_LEVEL_HIGH: "1",
    lib.HM2_LEVEL_FLOATING: "H",
    lib.HM2_LEVEL_CONTENTION: "X",
}


class EmulatedPin:
    """One pad of the card, seen and driven from outside."""

    def __init__(self, board: EmulatedBoard, number: int) -> None:
        self._board = board
        self.number = number

    def drive(self, level: int | None) -> None:
        """Drive the pad with 0 or 1 from outside, or let go (None)."""
        if level not in (0, 1, None):
            raise ValueError(f"a pin is driven with 0, 1 or None, not {level!r}")
        lib.hm2_emulator_pin_drive(
            self._board.handle, self.number, lib.HM2_LEVEL_RELEASE if level is None else level
        )

    @property
    def level(self) -> str:
        """The pad: "0", "1", "H" (floating, pulled up) or "X" (card and outside drive against each other)."""
        return _LEVELS[lib.hm2_emulator_pin_level(self._board.handle, self.number)]

    def __repr__(self) -> str:
        return f"<pin IO{self.number} {self.level}>"
