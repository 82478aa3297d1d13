"""Pulse timers: widths, filters, rates and triggers of fact sheet registers 2.19."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import pytest

import hostmot2
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.cards import CardDescription
from hostmot2.registers import OneshotTrigger
from tests.modules.module_card import CLOCK_LOW, ModuleWords, module_card, pin
from tests.modules.waveform import edges, high_time

ONESHOT, BASE, DPLL = 0xC7, 0x9000, 0x1A
CONTROL = BASE + 0x500
TRIGGER_1, TRIGGER_2, OUT_1, OUT_2 = range(4)
CARD = module_card(
    ModuleWords(DPLL, 0x7000, 7),
    ModuleWords(ONESHOT, BASE, 6, instances=1, multiple=0x3F),
    pins=tuple(pin(ONESHOT, number) for number in (0x01, 0x02, 0x83, 0x84)),
)


@pytest.fixture
def emulated() -> EmulatedBoard:
    board = EmulatedBoard(CARD, clock="virtual")
    board.pin(TRIGGER_1).drive(0)
    return board


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


def test_the_sheets_numbers(board: Board, emulated: EmulatedBoard) -> None:
    oneshot = board.oneshots[0]
    oneshot.timers[0].width, oneshot.timers[1].width = 0.0015, 0.25
    oneshot.timers[0].filter, oneshot.timers[1].filter = 1e-6, 0.1
    oneshot.rate = 1000.0
    assert [emulated.read(BASE + 0x100 * n) for n in range(5)] == [
        150_000,
        25_000_000,
        100,
        10_000_000,
        round(1000 * 2**32 / CLOCK_LOW),
    ]
    for timer in oneshot.timers:
        with pytest.raises(ValueError, match="outside"):
            timer.width = 2**31 / CLOCK_LOW
        with pytest.raises(ValueError, match="outside"):
            timer.filter = 2**24 / CLOCK_LOW
        with pytest.raises(ValueError, match="outside"):
            timer.width = -1.0
        with pytest.raises(ValueError, match="outside"):
            timer.filter = float("inf")
    with pytest.raises(ValueError, match="rate"):
        oneshot.rate = CLOCK_LOW


def test_the_control_word(board: Board, emulated: EmulatedBoard) -> None:
    first, second = board.oneshots[0].timers
    first.trigger, first.retriggerable, first.dpll_timer = OneshotTrigger.EXTERNAL, True, 3
    first.set_edges(rise=True, fall=True)
    second.trigger = OneshotTrigger.TIMER_1
    second.set_edges(rise=False, fall=True)
    assert emulated.read(CONTROL) & ~0x03000300 == 0x0015_303A


def test_the_text_off_does_not_switch_on(board: Board) -> None:
    timer: Any = board.oneshots[0].timers[0]
    with pytest.raises(TypeError, match="True or False"):
        timer.enable = "off"
    assert timer.enable is False


def test_a_software_trigger_makes_one_pulse(board: Board, emulated: EmulatedBoard) -> None:
    timer = board.oneshots[0].timers[0]
    timer.trigger, timer.width = OneshotTrigger.SOFTWARE, 200 / CLOCK_LOW
    timer.fire()
    emulated.advance_clocks(10)
    assert emulated.pin(OUT_1).level == "H", "off until enabled"
    timer.enable = True
    timer.fire()
    assert high_time(emulated, OUT_1, 1000) == 200
    board.cycle.run()
    assert not timer.output
    timer.fire()
    board.cycle.run()
    assert timer.output
    timer.reset()
    assert emulated.pin(OUT_1).level == "0"


@pytest.mark.parametrize("retriggerable", [False, True])
def test_triggers_during_a_pulse(board: Board, emulated: EmulatedBoard, retriggerable: bool) -> None:
    timer = board.oneshots[0].timers[0]
    timer.trigger, timer.width = OneshotTrigger.SOFTWARE, 200 / CLOCK_LOW
    timer.retriggerable, timer.enable = retriggerable, True
    timer.fire()
    emulated.advance_clocks(150)
    timer.fire()
    assert high_time(emulated, OUT_1, 1000) == (200 if retriggerable else 50)


@pytest.mark.parametrize(("rise", "fall", "pulses"), [(True, False, 1), (False, True, 1), (True, True, 2)])
def test_an_external_trigger_is_filtered(
    board: Board, emulated: EmulatedBoard, rise: bool, fall: bool, pulses: int
) -> None:
    timer = board.oneshots[0].timers[0]
    timer.trigger, timer.width, timer.filter = OneshotTrigger.EXTERNAL, 1e-6, 1e-6
    timer.set_edges(rise=rise, fall=fall)
    timer.enable = True
    emulated.pin(TRIGGER_1).drive(1)
    emulated.advance_clocks(90)
    emulated.pin(TRIGGER_1).drive(0)
    assert high_time(emulated, OUT_1, 1000) == 0, "shorter than the filter"
    emulated.pin(TRIGGER_1).drive(1)
    high = high_time(emulated, OUT_1, 1000)
    board.cycle.run()
    assert timer.external
    emulated.pin(TRIGGER_1).drive(0)
    assert high + high_time(emulated, OUT_1, 1000) == 100 * pulses


def test_a_rate_and_a_chain(board: Board, emulated: EmulatedBoard) -> None:
    oneshot = board.oneshots[0]
    first, second = oneshot.timers
    oneshot.rate = 100e3
    first.trigger, first.width = OneshotTrigger.RATE, 2e-6
    second.trigger, second.width = OneshotTrigger.TIMER_1, 3e-6
    second.set_edges(rise=False, fall=True)
    first.enable = second.enable = True
    emulated.advance(100.0)
    changes = edges(emulated, OUT_1, 5000)
    rises = [clock for clock, level in changes if level == "1"]
    assert {b - a for a, b in itertools.pairwise(rises)} <= {999, 1000, 1001}
    assert high_time(emulated, OUT_1, 100_000) == pytest.approx(100 * 200, abs=200)
    assert high_time(emulated, OUT_2, 100_000) == pytest.approx(100 * 300, abs=300)
    while emulated.pin(OUT_1).level == "0":
        emulated.advance_clocks(1)
    while emulated.pin(OUT_1).level == "1":
        emulated.advance_clocks(1)
    assert emulated.pin(OUT_2).level == "1", "the second starts as the first ends"


def test_a_dpll_timer_triggers(board: Board, emulated: EmulatedBoard) -> None:
    board.dpll.frequency = 10_000.0
    timer = board.oneshots[0].timers[0]
    timer.trigger, timer.width, timer.dpll_timer = OneshotTrigger.DPLL, 10e-6, 0
    timer.enable = True
    emulated.advance(1000.0)
    rises = [clock for clock, level in edges(emulated, OUT_1, 40_000) if level == "1"]
    assert len(rises) in (3, 4)
    assert {round((b - a) / 10_000) for a, b in itertools.pairwise(rises)} == {1}


def test_off_at_close(emulated: EmulatedBoard) -> None:
    with hostmot2.open(emulated) as board:
        timer = board.oneshots[0].timers[0]
        timer.trigger, timer.width, timer.enable = OneshotTrigger.SOFTWARE, 1.0, True
        timer.fire()
        assert emulated.pin(OUT_1).level == "1"
    assert emulated.pin(OUT_1).level == "H"
    assert emulated.read(CONTROL) & 0x01400140 == 0


def test_off_behind_a_bite(board: Board, emulated: EmulatedBoard) -> None:
    timer = board.oneshots[0].timers[0]
    timer.trigger, timer.width, timer.enable = OneshotTrigger.SOFTWARE, 1.0, True
    timer.fire()
    emulated.advance(60_000.0)
    with pytest.raises(hostmot2.errors.WatchdogBite):
        board.cycle.run()
    board.watchdog.acknowledge()
    assert not timer.enable
    assert emulated.pin(OUT_1).level == "H"
    timer.enable = True
    assert emulated.pin(OUT_1).level == "0", "the old pulse is over"


@pytest.mark.parametrize("number", [-1, 5, 8])
def test_a_dpll_timer_that_is_not_there_is_refused(
    board: Board, emulated: EmulatedBoard, number: int
) -> None:
    timer = board.oneshots[0].timers[0]
    timer.dpll_timer = 4
    before = emulated.read(CONTROL)
    with pytest.raises(ValueError, match=f"no DPLL timer {number}"):
        timer.dpll_timer = number
    assert timer.dpll_timer == 4
    assert emulated.read(CONTROL) == before


def test_a_disabled_timers_pin_is_driven_no_more(board: Board, emulated: EmulatedBoard) -> None:
    first, second = board.oneshots[0].timers
    first.enable = second.enable = True
    assert (emulated.pin(OUT_1).level, emulated.pin(OUT_2).level) == ("0", "0")
    first.enable = False
    assert (emulated.pin(OUT_1).level, emulated.pin(OUT_2).level) == ("H", "0")
    assert repr(board.oneshots[0]) == "<Oneshot 0 timers off, on>"
    first.enable = True
    assert emulated.pin(OUT_1).level == "0"


SOFTWARE, FROM_DPLL, FROM_RATE = 1, 3, 4
ANY_EDGE, ENABLE, RESET, OUTPUT, FIRE, TIMER_7 = 0x18, 0x40, 0x80, 0x100, 0x400, 0x7000
WITHOUT_DPLL = module_card(
    ModuleWords(ONESHOT, BASE, 6, instances=1, multiple=0x3F),
    pins=tuple(pin(ONESHOT, number) for number in (0x01, 0x02, 0x83, 0x84)),
)


@pytest.mark.parametrize(
    ("card", "control", "fires"),
    [
        (CARD, SOFTWARE, True),
        (CARD, SOFTWARE | RESET, False),
        (CARD, FROM_DPLL, True),
        (CARD, FROM_DPLL | TIMER_7, False),  # the DPLL has no such timer
        (WITHOUT_DPLL, SOFTWARE, True),
        (WITHOUT_DPLL, FROM_DPLL, False),
        (CARD, FROM_RATE, False),  # of 0
    ],
)
def test_what_shows_no_edge_starts_nothing(card: CardDescription, control: int, fires: bool) -> None:
    emulated = EmulatedBoard(card, clock="virtual")
    if card is CARD:
        emulated.write(0x7000, 0x346D_C5D6)  # what 10 kHz need with this prescaler
        emulated.write(0x7200, 0x0200_0000)
        emulated.write(0x7300, 0x07D0_002A)
    emulated.write(BASE, CLOCK_LOW // 10)  # for 0.1 s
    emulated.write(CONTROL, control | ANY_EDGE | ENABLE)
    emulated.advance(500.0)
    emulated.write(CONTROL, control | ANY_EDGE | ENABLE | FIRE)
    emulated.advance(10_000.0)
    assert bool(emulated.read(CONTROL) & OUTPUT) is fires
