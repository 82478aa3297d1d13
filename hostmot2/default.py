"""`from hostmot2 import hm2`: a board without ceremony, for scripts and the prompt."""

from __future__ import annotations

import os
import sys
import threading
from typing import Any, cast

from hostmot2.board import Board
from hostmot2.opening import open_board
from hostmot2.parts import PARTS

BOARD_VARIABLE = "HM2_BOARD"
EMULATED = "emu://5i25+7i77"


class DefaultBoard:
    """Opens $HM2_BOARD, else the emulated card, at first use; outputs off and closed at exit.

    Everything is the Board's; after close() the next use opens it again.
    """

    def __init__(self) -> None:
        self._board: Board | None = None
        self._opening = threading.Lock()

    def _opened(self) -> Board:
        with self._opening:
            if self._board is None or self._board.closed:
                url = os.environ.get(BOARD_VARIABLE)
                if not url:
                    url = EMULATED
                    print(
                        f"hostmot2: ${BOARD_VARIABLE} is not set, using the emulated card {url}",
                        file=sys.stderr,
                    )
                self._board = open_board(url)
            return self._board

    def close(self) -> None:
        """Close the board if it has been opened. Idempotent."""
        if self._board is not None:
            self._board.close()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # introspection (doctest, copy, help) must not open a card
            raise AttributeError(name)
        return getattr(self._opened(), name)

    def __enter__(self) -> Board:
        return self._opened().__enter__()

    def __exit__(self, *details: Any) -> None:
        if self._board is not None:
            self._board.__exit__(*details)

    def __dir__(self) -> list[str]:
        return sorted({*dir(Board), *PARTS, *super().__dir__()})

    def __repr__(self) -> str:
        if self._board is None or self._board.closed:
            return "<default board, not open>"
        return repr(self._board)


hm2: Board = cast("Board", DefaultBoard())
