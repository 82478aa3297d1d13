"""Period meters: numbers of fact sheet registers 2.20 against signals with known edges."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import hostmot2
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from tests.modules.module_card import CLOCK_LOW, ModuleWords, module_card, pin, written

PERIOD, BASE = 0xC8, 0x9600
CARD = module_card(
    ModuleWords(PERIOD, BASE, 4, instances=2, multiple=0xF), pins=(pin(PERIOD, 1), pin(PERIOD, 1, 1))
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
    meter = board.periods[1]
    meter.averages, meter.filter, meter.invert = 16, 1e-6, True
    meter.minimum_frequency = 10.0
    assert words[BASE + 4] == 100 << 16 | 15 << 4 | 1
    assert words[BASE + 0x304] == CLOCK_LOW / 10 * 16
    assert words[BASE + 0x300] == CLOCK_LOW


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("averages", 0),
        ("averages", 4097),
        ("filter", 0.001),
        ("filter", -1.0),
        ("filter", float("inf")),
        ("minimum_frequency", 0.0),
    ],
)
def test_settings_that_do_not_fit_change_nothing(board: Board, name: str, value: float) -> None:
    meter = board.periods[0]
    before = getattr(meter, name)
    with pytest.raises(ValueError, match="outside"):
        setattr(meter, name, value)
    assert getattr(meter, name) == before


def test_the_counter_bounds_the_minimum_frequency(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    words = written(board, monkeypatch)
    meter = board.periods[0]
    meter.averages = 64
    assert words[BASE + 0x300] == 0xFFFFFFFF
    assert meter.minimum_frequency == pytest.approx(CLOCK_LOW * 64 / 2**32)
    meter.averages = 1
    assert meter.minimum_frequency == 1.0


def test_no_signal_no_value(board: Board, emulated: EmulatedBoard) -> None:
    emulated.advance(1000.0)
    board.cycle.run()
    meter = board.periods[0]
    assert not meter.valid
    assert (meter.period, meter.width, meter.frequency, meter.duty) == (None, None, None, None)


@pytest.mark.parametrize("averages", [1, 7, 64])
@pytest.mark.parametrize(("hertz", "duty"), [(12_345.0, 0.25), (1000.0, 0.5), (1.5e6, 0.6)])
def test_period_and_duty(
    board: Board, emulated: EmulatedBoard, averages: int, hertz: float, duty: float
) -> None:
    meter = board.periods[0]
    meter.averages = averages
    emulated.period(0).run(hertz, duty)
    emulated.advance((2 * averages + 2) * 1e6 / hertz)
    board.cycle.run()
    assert meter.frequency == pytest.approx(hertz, rel=2 * hertz / CLOCK_LOW / averages)
    assert meter.duty == pytest.approx(duty, abs=2 * hertz / CLOCK_LOW)


@pytest.mark.parametrize("hertz", [31_415.9, 27_182.8, 33_333.3, 99_990.0, 123_456.7])
def test_looking_often_or_seldom_shows_the_same(emulated: EmulatedBoard, hertz: float) -> None:
    """The sums of windows that nobody looked at in between."""
    other = EmulatedBoard(CARD, clock="virtual")
    for card in (emulated, other):
        card.write(BASE, 6 << 4 | 20 << 16)
        card.write(BASE + 0x300, CLOCK_LOW)
        card.period(0).run(hertz, 0.37)
        card.advance(3.0)
    for _ in range(200):
        other.advance(57.0)
        other.sync()
    emulated.advance(200 * 57.0)
    assert emulated.read(BASE) & 2
    assert [emulated.read(BASE + r) for r in (0, 0x100, 0x200)] == [
        other.read(BASE + r) for r in (0, 0x100, 0x200)
    ]


def test_a_signal_that_stops_is_no_longer_valid(board: Board, emulated: EmulatedBoard) -> None:
    meter = board.periods[0]
    meter.minimum_frequency = 100.0
    emulated.period(0).run(1000.0)
    emulated.advance(5000.0)
    board.cycle.run()
    assert meter.valid
    emulated.period(0).stop()
    emulated.advance(9000.0)
    board.cycle.run()
    assert meter.valid, "not yet too slow"
    emulated.advance(2000.0)
    board.cycle.run()
    assert meter.frequency is None


def test_pulses_shorter_than_the_filter_are_not_seen(board: Board, emulated: EmulatedBoard) -> None:
    meter = board.periods[0]
    meter.filter = 10e-6
    emulated.period(0).run(10_000.0, 0.05)
    emulated.advance(1000.0)
    board.cycle.run()
    assert not meter.valid
    emulated.period(0).run(10_000.0, 0.2)
    emulated.advance(1000.0)
    board.cycle.run()
    assert meter.width == pytest.approx(20e-6, abs=1e-8)


def test_inverted_and_by_hand(board: Board, emulated: EmulatedBoard) -> None:
    meter = board.periods[1]
    meter.invert = True
    for _ in range(3):
        emulated.pin(1).drive(0)
        emulated.advance(30.0)
        emulated.pin(1).drive(1)
        emulated.advance(70.0)
    board.cycle.run()
    assert meter.period == pytest.approx(100e-6)
    assert meter.width == pytest.approx(30e-6)
    assert not meter.input


def test_it_prints_a_frequency_or_that_there_is_none(board: Board, emulated: EmulatedBoard) -> None:
    meter = board.periods[1]
    assert repr(meter) == "<Period 1 no signal>"
    emulated.period(1).run(1000.0)
    for _ in range(5):
        emulated.advance(2000.0)
        board.cycle.run()
    assert repr(meter) == "<Period 1 1000 Hz>"


def test_text_turns_nothing_upside_down(board: Board) -> None:
    wrong: Any = "off"
    with pytest.raises(TypeError, match="True or False"):
        board.periods[0].invert = wrong
    assert board.periods[0].invert is False
