"""What a pin of the emulated card does over time."""

from __future__ import annotations

from hostmot2.emulator.board import EmulatedBoard


def edges(board: EmulatedBoard, pin: int, clocks: int) -> list[tuple[int, str]]:
    """The changes of a pin over so many clocks: (clock, new level)."""
    found, level = [], board.pin(pin).level
    for _ in range(clocks):
        board.advance_clocks(1)
        now = board.pin(pin).level
        if now != level:
            found.append((board.clocks, now))
            level = now
    return found


def high_time(board: EmulatedBoard, pin: int, clocks: int) -> int:
    """For how many of the next clocks a pin is high."""
    high = 0
    for _ in range(clocks):
        high += board.pin(pin).level == "1"
        board.advance_clocks(1)
    return high
