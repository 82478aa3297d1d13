"""Modules whose sources contradict each other are refused, and the refusal says in what."""

from __future__ import annotations

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.emulator.board import EmulatedBoard
from tests.modules.module_card import ModuleWords, module_card, pin

CARD = module_card(
    ModuleWords(0x18, 0x4A00, 4, instances=2, multiple=0x07),
    ModuleWords(0x19, 0x1500, 3, instances=2, multiple=0x1F),
    ModuleWords(0x2B, 0x9200, 11, instances=1, multiple=0x1FF),
    pins=(*(pin(tag, 0x81) for tag in (0x18, 0x19, 0x2B)), *(pin(tag, 0x82) for tag in (0x18, 0x19, 0x2B))),
)


@pytest.mark.parametrize(
    ("name", "base", "text"),
    [("bisses", 0x4A00, "bit 8"), ("fanucs", 0x1500, "bit 24"), ("xy2mods", 0x9200, "multiplies velocities")],
)
def test_the_refusal_says_what_disagrees(name: str, base: int, text: str) -> None:
    with hostmot2.open(EmulatedBoard(CARD, clock="virtual")) as board:
        with pytest.raises(errors.UnsupportedFirmware, match=text) as caught:
            getattr(board, name)
        assert caught.value.address == base


@pytest.mark.parametrize("name", ["bisses", "fanucs", "xy2mods", "tp_pwms", "uarts", "bspis"])
def test_a_card_without_it_says_so(name: str) -> None:
    with hostmot2.open(EmulatedBoard(clock="virtual")) as board, pytest.raises(errors.ModuleMissing):
        getattr(board, name)


def test_the_rest_of_the_card_works_and_their_pins_stay_let_go() -> None:
    emulated = EmulatedBoard(CARD, clock="virtual")
    with hostmot2.open(emulated) as board:
        board.gpio[10].drive(True)
        board.cycle.run()
        assert emulated.pin(10).level == "1"
        assert {emulated.pin(n).level for n in range(6)} == {"H"}


@pytest.mark.parametrize("name", ["encoders", "sserial", "stepgens", "dpll", "resolvers"])
def test_a_card_without_the_usual_modules_says_so_too(name: str) -> None:
    emulated = EmulatedBoard(CARD, clock="virtual")
    with hostmot2.open(emulated) as board, pytest.raises(errors.ModuleMissing, match="TEST"):
        getattr(board, name)
