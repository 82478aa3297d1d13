"""The cycle engine: a thread in C that exchanges everything with the card at a fixed rate, without Python.

`hm2.engine(rate=1000)` makes one, `for frame in hm2.cycle(rate=1000)` runs one for as long as the loop.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from hostmot2.engine.axis import Axis
from hostmot2.engine.engine import Engine
from hostmot2.engine.facts import EngineStatus, Event, EventKind, Off
from hostmot2.engine.frame import Frame
from hostmot2.engine.options import RealTimeWarning

if TYPE_CHECKING:
    from hostmot2.board import Board

__all__ = [
    "Axis",
    "Engine",
    "EngineStatus",
    "Engines",
    "Event",
    "EventKind",
    "Frame",
    "Off",
    "RealTimeWarning",
]


class Engines:
    """Makes the engines of a board: `hm2.engine(rate=1000)`. One may run at a time."""

    def __init__(self, board: Board) -> None:
        self._board = board

    def __call__(self, rate: float = 1000.0, **options: Any) -> Engine:
        """An engine for everything that is in use on the board now; see Engine for the options."""
        return Engine(self._board, rate, **options)

    def loop(self, rate: float, *, seconds: float | None = None, **options: Any) -> Iterator[Frame]:
        """The frames of an engine that runs as long as the loop over them."""
        with self(rate, **options) as engine:
            yield from engine.frames(seconds)
