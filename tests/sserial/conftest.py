"""Remotes on an emulated card, and the driver on that card."""

import pytest

import hostmot2
from hostmot2.emulator import EmulatedBoard

from .remotes import field_io


@pytest.fixture
def card():
    """A 5I25 with a 7I77's pins and nothing on its channels."""
    with EmulatedBoard("5i25+7i77", clock="virtual") as card:
        for channel in range(card.sserial[0].channels):
            card.sserial[0].detach(channel)
        yield card


@pytest.fixture
def hm2(card):
    with hostmot2.open(card) as board:
        yield board


@pytest.fixture
def field(card):
    """A field I/O remote on channel 0, behind the card's pins."""
    there = field_io()
    card.sserial[0].attach(0, there, through_pins=True)
    return there
