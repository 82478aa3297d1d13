"""hostmot2.open: from a URL or an emulated card to a Board."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hostmot2.board import Board
from hostmot2.boards import BoardFacts
from hostmot2.transports import open_transport

if TYPE_CHECKING:
    from hostmot2.emulator import EmulatedBoard


def open_board(
    card: str | EmulatedBoard,
    *,
    strict: bool = True,
    board: BoardFacts | None = None,
    read_only: bool = False,
) -> Board:
    """Open a card and read what it contains; nothing is written, outputs stay as they are.

    card: a URL (emu://, pci://, udp://, dump://, or a scheme that another package provides), or an
    EmulatedBoard. strict=False uses what can be used of a card whose IDROM has modules of a form this driver
    does not know, instead of refusing it. board: ports and connectors of a card that is not in the board
    table (hostmot2/boards.py) or not as it says; its port count and width are then checked. read_only=True
    looks at a card that another program may be driving: every write is refused with ReadOnly, closing writes
    nothing, and a PCI card is not locked. Parts that write when they are made cannot be used then.

    Raises TransportError if the card cannot be reached, IdromError if its description is broken, ValueError
    for a URL that cannot be.
    """
    if isinstance(card, str):
        transport = open_transport(card, read_only=read_only)
        return Board(transport, strict=strict, board=board, read_only=read_only)
    if not hasattr(card, "handle"):
        raise TypeError(f"a card is a URL or an EmulatedBoard, not {type(card).__name__}")
    from hostmot2.transports.emulated import transport_of  # the emulator is loaded only when wanted

    return Board(transport_of(card), strict=strict, board=board, read_only=read_only)
