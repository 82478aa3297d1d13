"""EmulatedBoard itself: clocks, pins, LEDs, strictness, bounds."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hostmot2 import HostMot2Error
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.board import UNDRIVEN
from hostmot2.emulator.cards import card


def test_virtual_time_stands_still_until_advanced() -> None:
    board = EmulatedBoard(clock="virtual")
    board.read(0x100, 64)
    board.write(0x1000, [1, 2])
    assert (board.now_us, board.clocks) == (0.0, 0)
    board.advance(1.0)
    assert board.now_us == 1.0
    assert board.clocks == 33  # the first edge after 15 ns, one every 30 ns
    board.advance_clocks(100)
    assert board.clocks == 133


@pytest.mark.parametrize(("name", "clocks"), [("5i25+7i77", 33), ("6i25+7i77", 67), ("7i92+7i77", 100)])
def test_clock_low_is_the_cards_own(name: str, clocks: int) -> None:
    board = EmulatedBoard(name, clock="virtual")
    board.advance(1.0)
    assert board.clocks == clocks


def test_real_time_passes_by_itself_and_cannot_be_pushed() -> None:
    board = EmulatedBoard(clock="real")
    board.read(0x100)
    before = board.now_us
    board.advance(1e9)
    assert board.now_us < before + 1e8
    for _ in range(100_000):
        board.read(0x100)
        if board.now_us > before:
            return
    raise AssertionError("time stood still")


def test_pins_are_driven_from_outside_and_float_without() -> None:
    board = EmulatedBoard(clock="virtual")
    pin = board.pin(20)
    assert pin.level == "H"
    pin.drive(0)
    assert pin.level == "0"
    assert board.read(0x1004) == 0x1FFF7
    board.write(0x1004, 0x8)
    board.write(0x1104, 0x8)
    assert pin.level == "X"
    assert board.read(0x1004) == 0x1FFF7  # outside is the stronger
    pin.drive(None)
    assert pin.level == "1"
    with pytest.raises(IndexError):
        board.pin(34)
    with pytest.raises(ValueError, match="0, 1 or None"):
        pin.drive(2)


def test_led_n_is_bit_31_minus_n() -> None:
    board = EmulatedBoard("7i76e", clock="virtual")
    board.write(0x0200, 0xA000_0000)
    assert board.leds == [True, False, True, False]


def test_what_nobody_decodes_reads_as_undriven_and_is_refused_when_strict() -> None:
    loose, strict = EmulatedBoard(clock="virtual"), EmulatedBoard(clock="virtual", strict=True)
    assert loose.read(0x9000) == UNDRIVEN == 0xDEADBEEF
    loose.write(0x9000, 1)
    with pytest.raises(HostMot2Error, match="undecoded read") as caught:
        strict.read(0x1000, 3)
    assert caught.value.address == 0x1008
    with pytest.raises(HostMot2Error, match="undecoded write"):
        strict.write(0x9000, 1)


def test_accesses_outside_the_register_file_are_the_callers_mistake() -> None:
    board = EmulatedBoard(clock="virtual")
    for address, count in ((0x10000, 1), (0xFFFC, 2), (0x102, 1), (0x100, 0)):
        with pytest.raises(ValueError, match=r"emulated card|count"):
            board.read(address, count)
    with pytest.raises(ValueError, match="emulated card"):
        board.write(0x10000, 0)


def test_encoders_report_and_take_positions() -> None:
    board = EmulatedBoard(clock="virtual")
    encoder = board.encoder_input(3)
    encoder.set_rate(1000.0)
    board.advance(1500.0)
    assert encoder.position == 1
    encoder.set_rate(-1000.0)  # half a count is on the way
    board.advance(499.0)
    assert encoder.position == 1
    board.advance(2.0)
    assert encoder.position == 0
    encoder.position = 1000
    assert encoder.position == 1000
    encoder.run(edge_period_ns=1000.0, counts=-10)
    board.advance(5.5)
    assert encoder.position == 995
    for bad in (lambda: encoder.run(0.0, 1), lambda: encoder.set_rate(1e12), lambda: encoder.set(2, 0, 0)):
        with pytest.raises(ValueError, match="encoder"):
            bad()
    with pytest.raises(IndexError):
        board.encoder_input(6)


def test_no_fraction_of_a_count_is_lost_over_many_changes_of_rate() -> None:
    board = EmulatedBoard(clock="virtual")
    encoder = board.encoder_input(0)
    for turn in range(10_000):
        encoder.set_rate(1000.0 + turn % 7)
        board.advance(10.0)
    exact = sum(1000.0 + turn % 7 for turn in range(10_000)) * 10e-6
    assert abs(encoder.position - exact) < 1


def test_a_closed_board_is_refused() -> None:
    with EmulatedBoard(clock="virtual") as board:
        pin = board.pin(0)
    with pytest.raises(ValueError, match="closed"):
        board.read(0x100)
    with pytest.raises(ValueError, match="closed"):
        pin.drive(0)
    board.close()


def test_sserial_b_has_seven_registers_of_interface_data() -> None:
    facts = card("5i25+7i77")
    modules = tuple(
        replace(m, gtag=0xC6, base=0xA000, registers=10, multiple=0x3FC) if m.gtag == 0xC1 else m
        for m in facts.modules
    )
    pins = tuple((p & ~0xFF00) | 0xC600 if p >> 8 & 0xFF == 0xC1 else p for p in facts.pins)
    board = EmulatedBoard(replace(facts, modules=modules, pins=pins), clock="virtual", strict=True)
    assert board.sserial[0].channels == 3
    board.advance(1000.0)
    assert board.read(0xA900) == 0
