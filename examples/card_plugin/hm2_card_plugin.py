"""A 7I84 for `hm2.card("7i84")`, and a transport that says on stderr what it reads and writes."""

import sys
from collections.abc import Sequence

import hostmot2
from hostmot2.board import Board
from hostmot2.cards.remote_card import RemoteCard, identified
from hostmot2.transports.base import Transport
from hostmot2.transports.host import HostBus


class Card7i84(RemoteCard):
    """A 7I84: 32 inputs, 16 outputs."""

    name = "7I84"

    @property
    def inputs(self) -> object:
        return self.channels[0].inputs["input"]

    @property
    def outputs(self) -> object:
        return self.channels[0].outputs["output"]


def find(board: Board) -> list[Card7i84]:
    """All 7I84 of a board, by the name their remotes give."""
    return [
        Card7i84(board, port, (channel.number,))
        for port in board.sserial
        for channel in identified(port)
        if channel.name == "7I84"
    ]


class LoggedBus(HostBus):
    """Words at addresses of another board, each access on stderr."""

    def __init__(self, url: str) -> None:
        self.under = hostmot2.open(url)

    def read(self, address: int, count: int) -> Sequence[int]:
        words = self.under.read_words(address, count)
        print(f"read  {address:04X}", *(f"{word:08X}" for word in words), file=sys.stderr)
        return words

    def write(self, address: int, words: Sequence[int]) -> None:
        print(f"write {address:04X}", *(f"{word:08X}" for word in words), file=sys.stderr)
        self.under.write(address, list(words))

    def close(self) -> None:
        self.under.close()


def open_transport(url: str) -> Transport:
    """The card behind logged:URL."""
    bus = LoggedBus(url.partition(":")[2])
    return bus.transport(url, model=bus.under.name)
