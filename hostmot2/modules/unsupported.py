"""Modules that are refused, and why: where the sources contradict each other nothing is guessed.

Source: fact sheet registers 2.15, 2.16, 2.22, 5.3, 5.4, 5.5.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NoReturn

from hostmot2 import errors
from hostmot2.registers import Gtag

if TYPE_CHECKING:
    from hostmot2.board import Board


def _refuse(board: Board, gtag: Gtag, why: str) -> NoReturn:
    module = board.module(gtag)
    raise errors.UnsupportedFirmware(
        f"{board.name}: {module.name} version {module.version} is not driven: {why}. Its registers can be "
        "used by board.read and board.write; settling it needs a measurement on a card",
        address=module.base,
        received=module.version,
    )


class Xy2mods:
    """XY2-100 galvanometer interfaces. Raises ModuleMissing or UnsupportedFirmware."""

    def __init__(self, board: Board) -> None:
        _refuse(
            board,
            Gtag.XY2MOD,
            "the one known driver divides positions by their scale but multiplies velocities and "
            "accelerations by it, so what a velocity means cannot be told without a galvanometer",
        )


class Bisses:
    """BiSS encoders. Raises ModuleMissing or UnsupportedFirmware."""

    def __init__(self, board: Board) -> None:
        _refuse(
            board,
            Gtag.BISS,
            "the hardware starts by timer with bit 8 of control1 and by program with bit 9 and reads them "
            "back the other way round, the one known driver has them the other way round when writing",
        )


class Fanucs:
    """Fanuc absolute encoders. Raises ModuleMissing or UnsupportedFirmware."""

    def __init__(self, board: Board) -> None:
        _refuse(
            board,
            Gtag.FANUC,
            "the hardware takes bit rate and frame settings only while bit 24 of control is set, the one "
            "known driver sets bit 7 and writes its control word to those registers",
        )
