"""SSR and OutM outputs: carrier of fact sheet registers 2.17, bits on pins, off unless enabled."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from tests.modules.module_card import ModuleWords, module_card, pin
from tests.modules.waveform import edges

SSR, OUTM = 0xC3, 0x2D
CARD = module_card(
    ModuleWords(SSR, 0x7D00, 2, instances=2, multiple=3),
    ModuleWords(OUTM, 0xB000, 1, instances=2, multiple=1),
    pins=(
        *(pin(SSR, 0x81 + n, 1) for n in range(4)),
        pin(SSR, 0xA0, 1),
        *(pin(OUTM, 0x81 + n, 1) for n in range(3)),
        pin(SSR, 0x81),
    ),
)
FIRST_SSR, REFERENCE, FIRST_OUTM = 0, 4, 5
GROUPS = [("ssrs", FIRST_SSR, 0x7D04), ("outms", FIRST_OUTM, 0xB004)]


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard(CARD, clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


def levels(emulated: EmulatedBoard, first: int, count: int) -> str:
    return "".join(emulated.pin(first + n).level for n in range(count))


@pytest.mark.parametrize("group", ["ssrs", "outms"])
def test_the_text_off_does_not_switch_on(board: Board, group: str) -> None:
    outputs: Any = getattr(board, group)[1]
    for assign in (
        lambda: setattr(outputs, "enable", "off"),
        lambda: outputs.__setitem__(0, "off"),
        lambda: outputs.invert(0, b"0"),
    ):
        with pytest.raises(TypeError, match="True or False"):
            assign()
    assert (outputs.enable, outputs[0], outputs.is_inverted(0)) == (False, False, False)


@pytest.mark.parametrize(("name", "first", "address"), GROUPS)
def test_enabling_behind_a_bite_does_not_resume(
    board: Board, emulated: EmulatedBoard, name: str, first: int, address: int
) -> None:
    outputs = getattr(board, name)[1]
    outputs.invert(1)
    outputs[0], outputs.enable = True, True
    assert emulated.read(address) == 0b11
    emulated.advance(100_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()
    board.watchdog.acknowledge()
    outputs.enable = True
    assert (outputs[0], outputs.is_inverted(1), emulated.read(address)) == (False, True, 0b10)


@pytest.mark.parametrize(("hertz", "divider"), [(25e3, 1998), (1e6, 48), (2e6, 23), (25e6, 0)])
def test_the_carriers_divider(board: Board, emulated: EmulatedBoard, hertz: float, divider: int) -> None:
    board.ssrs.frequency = hertz
    assert emulated.read(0x7E04) == 0, "no carrier while off"
    board.ssrs[1].enable = True
    assert emulated.read(0x7E04) == 0x1000 | divider
    assert emulated.read(0x7E00) == 0, "the other instance stays off"
    assert board.ssrs.frequency == pytest.approx(hertz)


@pytest.mark.parametrize("hertz", [0.0, 24e3, 26e6, float("nan")])
def test_other_carriers_are_refused(board: Board, hertz: float) -> None:
    with pytest.raises(ValueError, match="SSR carrier"):
        board.ssrs.frequency = hertz


def test_the_carrier_is_on_the_reference_pin(board: Board, emulated: EmulatedBoard) -> None:
    board.ssrs[1].enable = True
    changes = [clock for clock, _ in edges(emulated, REFERENCE, 1000)]
    assert {b - a for a, b in pairwise(changes)} == {50}


def test_relays_conduct_only_while_enabled(board: Board, emulated: EmulatedBoard) -> None:
    relays = board.ssrs[1]
    assert relays.numbers == (0, 1, 2, 3)
    relays[0] = relays[2] = True
    board.cycle.run()
    assert levels(emulated, FIRST_SSR, 4) == "HHHH"
    relays.enable = True
    assert levels(emulated, FIRST_SSR, 4) == "1010"
    relays[2] = False
    relays[3] = True
    board.cycle.run()
    assert levels(emulated, FIRST_SSR, 4) == "1001"
    relays.enable = False
    assert emulated.read(0x7D04) == 0
    assert emulated.read(0x7E04) == 0
    assert levels(emulated, FIRST_SSR, 5) == "HHHHH"


def test_inverted_outputs(board: Board, emulated: EmulatedBoard) -> None:
    outputs = board.outms[1]
    outputs.invert(1)
    board.cycle.run()
    assert emulated.read(0xB004) == 0, "inverted or not, off is off"
    outputs[0] = True
    outputs.enable = True
    assert levels(emulated, FIRST_OUTM, 3) == "110"
    assert list(outputs) == [True, False, False]
    assert outputs.is_inverted(1)


def test_outputs_without_a_pin_do_not_exist(board: Board) -> None:
    for outputs, number in ((board.outms[1], 3), (board.ssrs[1], 31), (board.ssrs[0], 1)):
        with pytest.raises(IndexError, match="no output"):
            outputs[number] = True


@pytest.mark.parametrize(
    ("group", "first", "data"), [("ssrs", FIRST_SSR, 0x7D04), ("outms", FIRST_OUTM, 0xB004)]
)
def test_off_at_close(emulated: EmulatedBoard, group: str, first: int, data: int) -> None:
    with hostmot2.open(emulated) as board:
        outputs = getattr(board, group)[1]
        outputs[0] = True
        outputs.enable = True
        assert emulated.pin(first).level == "1"
    assert emulated.pin(first).level == "H"
    assert emulated.read(data) == 0


@pytest.mark.parametrize(
    ("group", "first", "data"), [("ssrs", FIRST_SSR, 0x7D04), ("outms", FIRST_OUTM, 0xB004)]
)
def test_off_behind_a_bite(board: Board, emulated: EmulatedBoard, group: str, first: int, data: int) -> None:
    outputs = getattr(board, group)[1]
    outputs[0] = True
    outputs.enable = True
    emulated.advance(60_000.0)
    assert emulated.pin(first).level == "H"
    with pytest.raises(hostmot2.errors.WatchdogBite):
        board.cycle.run()
    board.watchdog.acknowledge()
    assert not outputs.enable
    board.cycle.run()
    assert emulated.pin(first).level == "H"
    assert emulated.read(data) == 0
    outputs.enable = True
    outputs[0] = True
    board.cycle.run()
    assert emulated.pin(first).level == "1"


def test_they_print_what_is_wanted_and_whether_it_is_out(board: Board) -> None:
    outputs = board.outms[1]
    outputs[1] = True
    assert repr(outputs) == "<Outm 1 off 0=off 1=on 2=off>"
    outputs.enable = True
    assert repr(outputs) == "<Outm 1 enabled 0=off 1=on 2=off>"
