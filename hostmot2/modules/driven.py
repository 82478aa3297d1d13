"""Whether somebody else drives a card now, seen by the one thing every driver does: it feeds the watchdog."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from hostmot2.errors import CardBusy
from hostmot2.registers import Gtag
from hostmot2.registers import Watchdog as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

LOOK_SECONDS = 0.1
LOOKS = 50


def is_driven(board: Board) -> bool:
    """Whether the card's watchdog is fed by another program. Reads only; takes LOOK_SECONDS at most.

    A counter that is not running, or only runs down, is nobody's. Raises TransportError.
    """
    module = next((m for m in board.modules if m.gtag == Gtag.WATCHDOG), None)
    if module is None or board.virtual_time:
        return False
    address = module.register_address(Registers.timer.number)
    before = board.read(address)
    for _ in range(LOOKS):
        if before & Registers.timer.stopped.mask:
            return False
        time.sleep(LOOK_SECONDS / LOOKS)
        now = board.read(address)
        if now > before:
            return True
        before = now
    return False


def raise_if_driven(board: Board) -> None:
    """Before a card is taken over: CardBusy if another program drives it."""
    if is_driven(board):
        raise CardBusy(
            f"{board.name} at {board.url} is driven by another program: somebody feeds its watchdog. "
            "End that program first, or only look: `hm2 monitor` without --start. What a program of hostmot2 "
            "drives it can record and show itself: hostmot2.recording, hostmot2.live"
        )
