"""InM and InMux inputs: scan rates, filters and counters of fact sheet registers 2.18."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import hostmot2
from hostmot2._core import ffi, lib
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from tests.modules.module_card import ModuleWords, module_card, pin, written

INM, INMUX = 0x23, 0x1E
CARD = module_card(
    ModuleWords(INM, 0x8500, 5, instances=1, multiple=0x1F),
    ModuleWords(INMUX, 0x8000, 5, instances=1, multiple=0x1F),
    pins=(
        *(pin(INM, 1 + n) for n in range(8) if n != 5),
        pin(INMUX, 1),
        *(pin(INMUX, 0x81 + n) for n in range(4)),
    ),
)
SCAN_US = 50.0


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard(CARD, clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


def test_the_control_words_of_the_sheet(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    words = written(board, monkeypatch)
    inputs = board.inms[0]
    assert inputs.width == 8
    # 100 MHz / (4 * 8 * 20 kHz) - 1 = 155; fast 5, slow 500 scans; inverted
    assert words[0x8500] == 500 << 22 | 5 << 16 | 155 << 6 | 1 << 5
    assert inputs.scan_rate == pytest.approx(100e6 / (32 * 156))
    inputs.scan_rate = 5e6  # at most 10 MHz for all inputs together: 1.25 MHz each
    assert words[0x8500] >> 6 & 0x3FF == 2  # 100 MHz / (4 * 10 MHz) - 1, rounded
    inputs.fast_scans, inputs.slow_scans = 63, 1023
    assert words[0x8500] >> 16 == 1023 << 6 | 63


def test_a_multiplexers_inputs_are_scanned_at_half_that(
    board: Board, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = written(board, monkeypatch)
    assert board.inmuxes[0].width == 16
    board.inmuxes[0].scan_rate = 5e6
    assert words[0x8000] >> 6 & 0x3FF == 4  # 100 MHz / (4 * 5 MHz) - 1


@pytest.mark.parametrize(
    ("name", "value"), [("scan_rate", 0.0), ("scan_rate", 1000.0), ("fast_scans", 64), ("slow_scans", 1024)]
)
def test_what_the_registers_cannot_hold_is_refused(board: Board, name: str, value: float) -> None:
    with pytest.raises(ValueError, match="outside"):
        setattr(board.inms[0], name, value)


def test_a_low_line_is_an_input_that_is_on(board: Board, emulated: EmulatedBoard) -> None:
    inputs = board.inms[0]
    emulated.pin(2).drive(0)
    emulated.advance(10 * SCAN_US)
    board.cycle.run()
    assert [n for n, on in enumerate(inputs) if on] == [2]
    with pytest.raises(IndexError):
        inputs[8]


def test_filters_count_scans(board: Board, emulated: EmulatedBoard) -> None:
    inputs = board.inms[0]
    inputs.set_slow(3)
    board.cycle.run()
    emulated.pin(2).drive(0)
    emulated.pin(3).drive(0)
    emulated.advance(2 * SCAN_US)
    board.cycle.run()
    assert (inputs.raw(2), inputs[2], inputs.raw(3), inputs[3]) == (True, False, True, False)
    emulated.advance(6 * SCAN_US)
    board.cycle.run()
    assert (inputs[2], inputs[3]) == (True, False)
    emulated.advance(480 * SCAN_US)
    board.cycle.run()
    assert not inputs[3]
    emulated.advance(20 * SCAN_US)
    board.cycle.run()
    assert inputs[3]
    assert inputs.is_slow(3)
    assert not inputs.is_slow(2)


def test_a_short_pulse_does_not_pass_the_filter(board: Board, emulated: EmulatedBoard) -> None:
    inputs = board.inms[0]
    emulated.pin(2).drive(0)
    emulated.advance(3 * SCAN_US)
    emulated.pin(2).drive(1)
    emulated.advance(600 * SCAN_US)
    board.cycle.run()
    assert not inputs[2]


def test_a_multiplexed_input_needs_its_address_pins(board: Board, emulated: EmulatedBoard) -> None:
    mux = emulated.inmux(0)
    inputs = board.inmuxes[0]
    mux.drive(5, 0)
    mux.drive(11, 0)
    emulated.advance(10 * SCAN_US)
    board.cycle.run()
    assert [n for n, on in enumerate(inputs) if on] == [5, 11]
    board.ioport.off()  # the multiplexer sees pull-ups: address 15
    mux.drive(15, 0)
    emulated.advance(10 * SCAN_US)
    board.cycle.run()
    assert all(inputs)


class HandWheel:
    """Two contacts that close to ground; a level lasts two scans."""

    def __init__(self, emulated: EmulatedBoard, a: int, b: int) -> None:
        self.emulated, self.pins, self.phase = emulated, (a, b), 0
        self.turn(0)

    def turn(self, edges: int) -> None:
        """Quadrature edges, A first when positive."""
        for _ in range(max(1, abs(edges))):
            self.phase = (self.phase + (edges > 0) - (edges < 0)) % 4
            self.emulated.pin(self.pins[0]).drive(int(self.phase not in (1, 2)))
            self.emulated.pin(self.pins[1]).drive(int(self.phase not in (2, 3)))
            self.emulated.advance(2 * SCAN_US)


def test_hand_wheels_count_beyond_eight_bits(board: Board, emulated: EmulatedBoard) -> None:
    hand, inputs = HandWheel(emulated, 0, 1), board.inms[0]
    assert [counter.index for counter in inputs.counters] == [0, 1, 3], "input 5 has no pin"
    wheel = inputs.counters[0]
    wheel.every_edge = True
    board.cycle.run()
    for _ in range(4):
        hand.turn(100)
        board.cycle.run()
    assert wheel.count == 400
    hand.turn(-90)
    board.cycle.run()
    assert wheel.count == 310
    wheel.reset()
    assert wheel.count == 0
    wheel.every_edge = False
    hand.turn(-40)
    board.cycle.run()
    assert wheel.count == -10


def test_eight_bit_counts_are_extended_over_their_wrap() -> None:
    inputs = ffi.new("hm2_field_input *")
    for word, counts in (
        (0xFF_00_80_FE, [0, 0, 0, 0]),  # where they start is 0
        (0x01_7F_FF_01, [3, 127, 127, 2]),
        (0x82_80_7E_80, [130, 254, 128, -125]),  # 129 up is 127 down
    ):
        inputs.mpg = word
        lib.hm2_field_input_update(inputs)
        assert list(inputs.counts) == counts


def test_settings_are_back_after_a_bite(board: Board, emulated: EmulatedBoard) -> None:
    inputs = board.inms[0]
    inputs.set_slow(0)
    board.watchdog.arm()
    emulated.advance(60_000.0)
    with pytest.raises(hostmot2.errors.WatchdogBite):
        board.cycle.run()
    emulated.write(0x8600, 0)
    board.watchdog.acknowledge()
    assert emulated.read(0x8600) == 1


def test_it_prints_what_is_on(board: Board, emulated: EmulatedBoard) -> None:
    inputs = board.inms[0]
    assert len(inputs) == 8
    assert repr(inputs) == "<Inms 0 on: none>"
    for number in (1, 3):
        emulated.pin(number).drive(0)
    emulated.advance(10 * SCAN_US)
    board.cycle.run()
    assert repr(inputs) == "<Inms 0 on: 1 3>"


def test_text_is_no_switch(board: Board) -> None:
    wrong: Any = "off"
    inputs = board.inms[0]
    with pytest.raises(TypeError, match="True or False"):
        inputs.counters[0].every_edge = wrong
    with pytest.raises(TypeError, match="True or False"):
        inputs.set_slow(1, wrong)
    assert (inputs.counters[0].every_edge, inputs.is_slow(1)) == (False, False)
