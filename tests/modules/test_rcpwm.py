"""Servo pulses: widths and rates of fact sheet registers 2.21, and no pulse unless enabled."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from tests.modules.module_card import ModuleWords, module_card, pin, written
from tests.modules.waveform import edges

BASE, RCPWM = 0x9D00, 0x2C
CARD = module_card(
    ModuleWords(RCPWM, BASE, 2, instances=3, multiple=1), pins=tuple(pin(RCPWM, 0x81, n) for n in range(3))
)


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard(CARD, clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


def test_the_sheets_numbers(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    words = written(board, monkeypatch)
    servo = board.rcpwms[1]
    assert board.rcpwms.frequency == 50.0
    servo.enable = True
    assert words[BASE + 4] == 9374  # 1.5 ms * 100e6 / 16000 - 1
    board.rcpwms.frequency = 400.0
    assert words[BASE + 0x100] == 249_998  # 100e6 / 400 - 2


def test_a_value_that_is_no_number_is_refused_at_once(board: Board) -> None:
    servo: Any = board.rcpwms[0]
    for wrong in ("0.5", None):
        with pytest.raises(TypeError):
            servo.value = wrong
    servo.enable = True
    assert (servo.value, servo.width) == (0.0, 0.0015)


def test_the_text_off_does_not_switch_on(board: Board) -> None:
    servo: Any = board.rcpwms[0]
    with pytest.raises(TypeError, match="True or False"):
        servo.enable = "off"
    assert servo.enable is False


def test_enabling_behind_a_bite_does_not_resume(board: Board, emulated: EmulatedBoard) -> None:
    servo = board.rcpwms[0]
    servo.value, servo.enable = 1.0, True
    emulated.advance(100_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()
    board.watchdog.acknowledge()
    servo.enable = True
    assert (servo.value, servo.width) == (0.0, 0.0015)


def test_pulses_on_the_pin(board: Board, emulated: EmulatedBoard) -> None:
    board.rcpwms.frequency = 1000.0
    servo = board.rcpwms[0]
    servo.offset, servo.scale, servo.value = 20e-6, 10e-6, 2.0
    servo.enable = True
    rises = [clock for clock, level in edges(emulated, 0, 250_000) if level == "1"]
    falls = [clock for clock, level in edges(emulated, 0, 150_000) if level == "0"]
    assert rises[1] - rises[0] == 100_000
    assert (falls[-1] - rises[0]) % 100_000 == 4000  # 40 us


def test_a_value_is_written_by_the_next_exchange_and_limited_to_the_hardwares(
    board: Board, emulated: EmulatedBoard
) -> None:
    servo = board.rcpwms[0]
    servo.enable = True
    servo.value = 1e9
    assert servo.width == pytest.approx(65536 * 16 / 100e6)
    servo.value = float("nan")
    assert servo.width == 0.0
    servo.value = -1e9
    assert servo.width == 0.0
    servo.value = 1.0
    assert servo.width == pytest.approx(0.002)
    board.cycle.run()
    emulated.advance(20_000.0)
    start = emulated.clocks
    changes = edges(emulated, 0, 10)
    emulated.advance(1_900.0)
    assert emulated.pin(0).level == "1", (start, changes)
    emulated.advance(200.0)
    assert emulated.pin(0).level == "0"


@pytest.mark.parametrize("hertz", [0.0, 0.001, 1001.0, float("nan")])
def test_rates_outside_the_sheets_range_are_refused(board: Board, hertz: float) -> None:
    with pytest.raises(ValueError, match="servo pulses"):
        board.rcpwms.frequency = hertz


def test_only_an_enabled_servos_pin_is_driven(board: Board, emulated: EmulatedBoard) -> None:
    board.rcpwms[1].enable = True
    assert [emulated.pin(n).level for n in range(3)] == ["H", "1", "H"]
    assert board.watchdog.armed
    board.rcpwms[1].enable = False
    assert emulated.pin(1).level == "H"


def test_off_at_close(emulated: EmulatedBoard) -> None:
    with hostmot2.open(emulated) as board:
        board.rcpwms[0].enable = True
    assert emulated.pin(0).level == "H"


def test_a_bite_leaves_it_off_until_enabled_again(board: Board, emulated: EmulatedBoard) -> None:
    board.rcpwms[0].enable = True
    emulated.advance(60_000.0)
    assert emulated.pin(0).level == "H"
    with pytest.raises(hostmot2.errors.WatchdogBite):
        board.cycle.run()
    board.watchdog.acknowledge()
    assert emulated.pin(0).level == "H"
    assert not board.rcpwms[0].enable
    board.rcpwms[0].enable = True
    emulated.advance(1_000.0)
    assert emulated.pin(0).level in "01"


@pytest.mark.parametrize("name", ["scale", "offset"])
def test_a_setting_that_is_no_number_is_refused(board: Board, name: str) -> None:
    servo = board.rcpwms[2]
    before = getattr(servo, name)
    with pytest.raises(ValueError, match=f"rcpwm 2: {name} inf"):
        setattr(servo, name, float("inf"))
    assert getattr(servo, name) == before


def test_a_fast_clock_cannot_pulse_as_slowly_as_the_sheet_allows() -> None:
    card = replace(CARD, clock_low=200_000_000)
    with hostmot2.open(EmulatedBoard(card, clock="virtual")) as board:
        with pytest.raises(ValueError, match=r"0\.02 Hz: the slowest here is 0\.0466 Hz"):
            board.rcpwms.frequency = 0.02
        assert board.rcpwms.frequency == 50.0
        board.rcpwms.frequency = 0.0466 + 0.0001


def test_it_prints_width_and_state(board: Board) -> None:
    assert repr(board.rcpwms[1]) == "<Rcpwm 1 off 0 ms>"
    board.rcpwms[1].enable = True
    assert repr(board.rcpwms).splitlines()[1] == "<Rcpwm 1 on 1.5 ms>"
