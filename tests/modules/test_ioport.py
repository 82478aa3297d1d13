"""GPIO: pads, latches, directions, and who may drive which pin."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


def test_the_text_off_does_not_switch_on(board: Board) -> None:
    gpio: Any = board.gpio[17]
    gpio.drive(False)
    for switch in (gpio.set, gpio.drive):
        with pytest.raises(TypeError, match="True or False"):
            switch("off")
    assert not board.ioport.latch(gpio.descriptor)


def test_only_pins_without_a_function_are_free(board: Board) -> None:
    assert [pin.index for pin in board.gpio.free] == list(range(17, 34))
    with pytest.raises(errors.PinInUse, match="sserial"):
        board.gpio[1].drive(True)


def test_a_released_pin_is_free_and_a_taken_one_is_not(board: Board) -> None:
    pin = board.pins[8]
    board.ioport.release([pin])
    board.ioport.claim([board.pins[20]], "test")
    with pytest.raises(errors.PinInUse, match="test"):
        board.gpio[20].drive(True)
    with pytest.raises(errors.PinInUse, match="test"):
        board.ioport.claim([board.pins[20]], "other")


def test_pads_show_what_the_outside_drives(board: Board, emulated: EmulatedBoard) -> None:
    assert board.gpio[17].level is True, "open inputs are pulled up"
    emulated.pin(17).drive(0)
    assert board.gpio[17].level is False


@pytest.mark.parametrize(
    ("level", "open_drain", "invert", "pad"),
    [
        (False, False, False, "0"),
        (True, False, False, "1"),
        (False, False, True, "1"),
        (True, False, True, "0"),
        (False, True, False, "0"),
        (True, True, False, "H"),
        (False, True, True, "H"),
        (True, True, True, "0"),
    ],
)
def test_outputs_follow_the_rule_of_the_port(
    board: Board, emulated: EmulatedBoard, level: bool, open_drain: bool, invert: bool, pad: str
) -> None:
    board.gpio[33].drive(level, open_drain=open_drain, invert=invert)
    assert emulated.pin(33).level == pad
    board.gpio[33].let_go()
    assert emulated.pin(33).level == "H"


def test_a_pin_is_never_driven_with_the_wrong_level_on_the_way(board: Board, emulated: EmulatedBoard) -> None:
    seen: list[str] = []
    write = board.write

    def watched(address: int, words: object) -> None:
        write(address, words)  # type: ignore[arg-type]
        seen.append(emulated.pin(25).level)

    board.write = watched  # type: ignore[method-assign]
    board.gpio[25].drive(True, invert=True)
    assert "1" not in seen
    assert seen[-1] == "0"


def test_set_reaches_the_pin_with_the_next_exchange(board: Board, emulated: EmulatedBoard) -> None:
    board.gpio[17].drive(False)
    board.gpio[17].set(True)
    assert emulated.pin(17).level == "0"
    board.cycle.run()
    assert emulated.pin(17).level == "1"
    board.cycle.run()
    assert board.ioport.level(board.pins[17]) is True


def test_leds_are_lit_from_bit_31_down(board: Board, emulated: EmulatedBoard) -> None:
    board.leds[0] = True
    assert "CR01=on CR02=off" in repr(board.leds)
    assert len(board.leds) == 2


def test_what_the_port_holds_can_be_asked(board: Board) -> None:
    pin = board.gpio[17]
    ports, place = board.ioport, pin.descriptor
    assert (ports.is_output(place), ports.is_open_drain(place)) == (False, False)
    pin.drive(True, open_drain=True)
    assert (ports.is_output(place), ports.is_open_drain(place), ports.latch(place)) == (True, True, True)
    pin.set(False)
    assert ports.latch(place) is False
    pin.let_go()
    assert (ports.is_output(place), ports.is_open_drain(place)) == (False, False)
    assert len(board.gpio) == len(board.pins) == 34
