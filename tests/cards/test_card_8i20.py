"""8I20 and 7I64 as cards."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.cards.errors import CardFault
from hostmot2.emulator import catalog
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.plant import couple_pm_motor


def board_with(name: str) -> EmulatedBoard:
    emulated = EmulatedBoard("5i25+7i77", clock="virtual")
    emulated.sserial[0].attach(2, catalog.remote(name), through_pins=True)
    return emulated


def test_current_angle_and_what_the_drive_reports() -> None:
    emulated = board_with("8i20")
    with hostmot2.open(emulated) as board:
        drive = board.card("8i20")
        drive.start()
        assert drive.current == 0.0
        assert drive.max_current == pytest.approx(7.5)
        drive.angle = 1.25
        drive.current = 2.0
        drive.exchange()
        drive.exchange()
        remote = emulated.sserial[0].remote(2)
        assert remote.get("angle") == pytest.approx(0.25 * 65535, abs=2)
        assert remote.get("qsetpoint") == pytest.approx(2.0 / 7.5 * 32767, abs=2)
        assert drive.bus_voltage == pytest.approx(320.0)
        with pytest.raises(ValueError, match="nan"):
            drive.current = float("nan")


def test_a_fault_is_named_and_no_current_is_commanded_into_it() -> None:
    emulated = board_with("8i20")
    with hostmot2.open(emulated) as board:
        drive = board.card("8i20")
        drive.start()
        emulated.sserial[0].remote(2).fault_word = 0x0104
        drive.exchange()
        drive.exchange()
        assert drive.fault_bits == ["over temperature", "bus under voltage"]
        with pytest.raises(CardFault, match="over temperature"):
            drive.current = 1.0
        emulated.sserial[0].remote(2).fault_word = 0
        drive.clear_fault()
        drive.exchange()
        drive.current = 1.0


def test_commutation_from_an_encoder_turns_the_motor() -> None:
    emulated = board_with("8i20")
    motor = couple_pm_motor(emulated, channel=2)
    with hostmot2.open(emulated) as board:
        drive, encoder = board.card("8i20"), board.encoders[0]
        encoder.scale = 4000.0
        drive.start()
        drive.current = 1.0
        for _ in range(600):
            emulated.advance(150.0)
            drive.exchange()
            drive.angle = encoder.position * 4
        assert motor.turns > 1.0


def test_a_7i64_moves_bits_and_volts() -> None:
    emulated = board_with("7i64")
    with hostmot2.open(emulated) as board:
        card = board.card("7i64")
        card.start()
        card.outputs[23] = True
        emulated.sserial[0].remote(2).set("input", 0x800001)
        card.exchange()
        card.exchange()
        assert emulated.sserial[0].remote(2).get("output") == 1 << 23
        assert [n for n, on in enumerate(card.inputs) if on] == [0, 23]


@pytest.fixture
def running() -> Iterator[tuple[Any, Any]]:
    """A started drive, and the emulated remote it is."""
    emulated = board_with("8i20")
    with hostmot2.open(emulated) as board:
        drive = board.card("8i20")
        drive.start()
        yield drive, emulated.sserial[0].remote(2)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_an_angle_that_is_none_is_refused_and_the_last_one_stays(
    running: tuple[Any, Any], wrong: float
) -> None:
    drive, remote = running
    drive.angle = 0.25
    with pytest.raises(ValueError, match=f"8I20: angle {wrong}"):
        drive.angle = wrong
    assert drive.angle == 0.25
    drive.exchange()
    drive.exchange()
    assert remote.get("angle") == pytest.approx(0.25 * 65535, abs=2)


def test_what_the_drive_tells_of_itself(running: tuple[Any, Any]) -> None:
    drive, remote = running
    remote.set("Status", 0x0080)  # a bit without a name
    remote.set_raw("Temperature", 4123)
    drive.exchange()
    drive.exchange()
    assert drive.status_word == 0x0280
    assert drive.status_bits == ["bit 7", "PID on"]
    assert drive.card_temperature == 4123


def test_it_prints_current_bus_and_faults(running: tuple[Any, Any]) -> None:
    drive, remote = running
    drive.exchange()
    drive.exchange()
    assert repr(drive) == "<8I20 channel 2 +0.00 A, bus 320.0 V, no fault>"
    remote.fault_word = 0x0100
    drive.exchange()
    drive.exchange()
    assert repr(drive) == "<8I20 channel 2 +0.00 A, bus 320.0 V, bus under voltage>"
    drive.stop()
    assert repr(drive) == "<8I20 channel 2 stopped>"


def test_the_analog_inputs_of_a_7i64() -> None:
    emulated = board_with("7i64")
    with hostmot2.open(emulated) as board:
        card = board.card("7i64")
        assert repr(card) == "<7I64 channel 2 stopped>"
        card.start()
        remote = emulated.sserial[0].remote(2)
        remote.set("analog0", 1.5)
        remote.set("analog1", 3.3)
        card.exchange()
        card.exchange()
        assert card.analog_inputs == pytest.approx((1.5, 3.3), abs=0.01)
        assert repr(card) == "<7I64 channel 2 running>"


@pytest.mark.parametrize("number", [1, -1])
def test_a_card_that_is_not_there_is_missing_by_its_number(number: int) -> None:
    said = f"1 8I20 found, number {number} is not there"
    with hostmot2.open(board_with("8i20")) as board, pytest.raises(errors.ModuleMissing, match=said):
        board.cards.get("8i20", number)
