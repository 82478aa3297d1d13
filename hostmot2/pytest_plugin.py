"""pytest fixtures for people who test their machine's code: an emulated card in virtual time.

Loaded by pytest in every environment where hostmot2 is installed. The card is a 5I25 with a 7I77, another one
with the marker `@pytest.mark.hm2_card("7i92+7i77")`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.emulator.board import EmulatedBoard

DEFAULT_CARD = "5i25+7i77"
MARKER = "hm2_card"


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker."""
    config.addinivalue_line("markers", f"{MARKER}(spec): the emulated card of the hm2_ fixtures")


@pytest.fixture
def hm2_emulated(request: pytest.FixtureRequest) -> Iterator[EmulatedBoard]:
    """The emulated card; time stands still until `advance(microseconds)`."""
    from hostmot2.emulator.board import EmulatedBoard

    marker = request.node.get_closest_marker(MARKER)
    with EmulatedBoard(marker.args[0] if marker else DEFAULT_CARD, clock="virtual") as board:
        yield board


@pytest.fixture
def hm2_board(hm2_emulated: EmulatedBoard) -> Iterator[Board]:
    """A driver on that card, closed with outputs off after the test."""
    import hostmot2

    with hostmot2.open(hm2_emulated) as board:
        yield board
