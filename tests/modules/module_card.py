"""A card of one's own for tests of one module: its descriptor and pins, I/O ports, watchdog and LED."""

from __future__ import annotations

import pytest

from hostmot2.board import Board
from hostmot2.emulator.cards import GPIO, CardDescription, ModuleWords, pin
from hostmot2.registers import Gtag

WIDTH = 24
CLOCK_LOW, CLOCK_HIGH = 100_000_000, 200_000_000


def module_card(
    *rows: ModuleWords, pins: tuple[int, ...], clock_low: int = CLOCK_LOW, instance_stride: int = 64
) -> CardDescription:
    """A card with these modules and pins from IO0 on; the rest of the port is GPIO."""
    ports = -(-len(pins) // WIDTH)
    modules = (
        ModuleWords(Gtag.WATCHDOG, 0x0C00, 3),
        ModuleWords(Gtag.IOPORT, 0x1000, 5, instances=ports, multiple=0x1F),
        *rows,
        ModuleWords(Gtag.LED, 0x0200, 1),
    )
    return CardDescription(
        name="module under test",
        board_name="MESATEST",
        modules=modules,
        pins=(*pins, *(GPIO,) * (ports * WIDTH - len(pins))),
        port_width=WIDTH,
        clock_low=clock_low,
        clock_high=CLOCK_HIGH,
        bus="ethernet",
        instance_stride=instance_stride,
    )


def written(board: Board, monkeypatch: pytest.MonkeyPatch) -> dict[int, int]:
    """The last word that the driver itself writes to each address from now on."""
    seen: dict[int, int] = {}
    real = board.write

    def write(address: int, words: int | list[int]) -> None:
        for n, word in enumerate([words] if isinstance(words, int) else words):
            seen[address + 4 * n] = word
        real(address, words)

    monkeypatch.setattr(board, "write", write)
    return seen


__all__ = ["CLOCK_HIGH", "CLOCK_LOW", "GPIO", "ModuleWords", "module_card", "pin", "written"]
