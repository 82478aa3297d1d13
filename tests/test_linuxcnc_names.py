"""The names that the page for LinuxCNC users gives exist: each is looked up on an emulated card."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from modules.module_card import ModuleWords as Words
from modules.module_card import module_card, pin

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator import EmulatedBoard
from hostmot2.registers import Gtag

PAGE = Path(__file__).parent.parent / "docs" / "explanation" / "coming-from-linuxcnc.md"
EXPRESSION = re.compile(r"`((?:hm2|card)\.[^`]*)`")

PARTS = module_card(
    Words(Gtag.ENCODER, 0x3000, 5, instances=2, version=3, multiple=3),
    Words(Gtag.PWMGEN, 0x4100, 5, instances=2, clock=2, multiple=3),
    Words(Gtag.TP_PWM, 0x4600, 4, instances=2, clock=2, multiple=3),
    Words(Gtag.RESOLVER, 0x3C00, 5, multiple=0x1F),
    Words(Gtag.SSI, 0x6900, 4, instances=2, multiple=3),
    Words(Gtag.DPLL, 0x7000, 7),
    Words(Gtag.SSR, 0x7D00, 2, instances=2, multiple=3),
    Words(Gtag.INMUX, 0x8000, 5, multiple=0x1F),
    Words(Gtag.INM, 0x8500, 5, multiple=0x1F),
    Words(Gtag.RCPWM, 0x9D00, 2, instances=2, multiple=1),
    Words(Gtag.OUTM, 0xB000, 1, instances=2, multiple=1),
    Words(Gtag.ONESHOT, 0xC000, 6, multiple=0x3F),
    Words(Gtag.PERIOD, 0xC800, 4, instances=2, multiple=0xF),
    pins=(
        *(pin(Gtag.INM, 1 + n) for n in range(8)),
        pin(Gtag.INMUX, 1),
        *(pin(Gtag.INMUX, 0x81 + n) for n in range(4)),
        *(pin(Gtag.SSR, 0x81 + n, 1) for n in range(4)),
        *(pin(Gtag.OUTM, 0x81 + n, 1) for n in range(4)),
    ),
)
CARDS = ("5i25+7i77", "7i76e", PARTS)


def rows() -> Iterator[tuple[str, str]]:
    """HAL names and what the page has for them."""
    for line in PAGE.read_text().splitlines():
        if line.startswith("| ") and not line.startswith("| HAL"):
            hal, here = line.strip("| ").split(" | ", 1)
            yield hal, here


EXPRESSIONS = sorted({found for _, here in rows() for found in EXPRESSION.findall(here)})


@pytest.fixture(scope="module")
def boards() -> Iterator[list[Board]]:
    opened = [hostmot2.open(EmulatedBoard(card, clock="virtual")) for card in CARDS]
    opened[0].card("7i77").start()
    yield opened
    for board in opened:
        board.close()


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_a_name_of_the_page_exists(expression: str, boards: list[Board]) -> None:
    call = expression.endswith("()")
    problems = []
    for board in boards:
        names = {"hm2": board} if expression.startswith("hm2") else {"card": boards[0].card("7i77")}
        try:
            found = eval(expression.removesuffix("()"), names)
        except (errors.ModuleMissing, IndexError) as problem:
            problems.append(f"{board.name}: {problem}")
            continue
        assert callable(found) or not call
        return
    pytest.fail(f"on none of the cards: {problems}")


def test_every_row_has_a_name_or_says_that_there_is_none() -> None:
    silent = [hal for hal, here in rows() if not here.startswith("- ") and here != "-" and "`" not in here]
    assert silent == ["`stepgen.NN.control-type`"]
    assert len(list(rows())) > 90
