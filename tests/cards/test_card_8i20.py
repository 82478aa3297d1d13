"""8I20 and 7I64 as cards."""

from __future__ import annotations

import pytest

import hostmot2
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
