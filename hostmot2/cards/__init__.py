"""Daughter cards by name: `hm2.card("7i77")`.

A card is recognised by what its remotes say of themselves, not by where they hang. Other packages add cards
through the entry point group `hostmot2.cards`: a callable that takes the board and returns the list of its
cards, named as in `Board.card`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

from hostmot2.errors import ModuleMissing

if TYPE_CHECKING:
    from hostmot2.board import Board

Finder = Callable[["Board"], Sequence[Any]]

CARDS: dict[str, tuple[str, str]] = {
    "7i77": ("hostmot2.cards.card_7i77", "find"),
    "7i77d": ("hostmot2.cards.card_7i77", "find_7i77d"),
    "8i20": ("hostmot2.cards.card_8i20", "find"),
    "7i64": ("hostmot2.cards.card_7i64", "find"),
}
"""Name: (module, function that finds all cards of that name on a board)."""

ENTRY_POINTS = "hostmot2.cards"


class Cards:
    """The daughter cards of a board, looked for when first asked for."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._found: dict[str, list[Any]] = {}

    @property
    def names(self) -> list[str]:
        """The names of all cards this installation knows."""
        return sorted({*CARDS, *(point.name for point in entry_points(group=ENTRY_POINTS))})

    def all(self, name: str) -> list[Any]:
        """All cards called `name`, in the order of their channels. Raises KeyError for an unknown name."""
        if not isinstance(name, str):
            raise TypeError(f"a card's name is a string such as '7i77', not {type(name).__name__}")
        name = name.lower()
        if not self._found.get(name):  # none there may mean: not yet powered
            self._found[name] = list(self._finder(name)(self._board))
        return self._found[name]

    def __getitem__(self, name: str) -> Any:
        return self.get(name)

    def get(self, name: str, number: int = 0) -> Any:
        """The card called `name`; number 1 is the second of its kind.

        Raises ModuleMissing if it is not there, KeyError for a name this installation does not know.
        """
        cards = self.all(name)
        if 0 <= number < len(cards):
            return cards[number]
        raise ModuleMissing(
            f"{self._board.name}: {len(cards)} {name.upper()} found, number {number} is not there. "
            "`hm2 sserial scan` shows what answers on which channel, and why a channel does not"
        )

    def _finder(self, name: str) -> Finder:
        if name in CARDS:
            module, function = CARDS[name]
            found: Finder = getattr(importlib.import_module(module), function)
            return found
        for point in entry_points(group=ENTRY_POINTS, name=name):
            loaded: Finder = point.load()
            return loaded
        raise KeyError(f"no card {name!r} is known here; there are {', '.join(self.names)}")
