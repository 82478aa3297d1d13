"""A board opened to look at a card that somebody else drives: nothing is written, whatever is tried."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import hostmot2
from hostmot2.emulator import EmulatedBoard
from hostmot2.errors import CardBusy, ReadOnly
from hostmot2.transports.emulated import transport_of
from tests.write_witness import Witness


@pytest.fixture
def card() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual")


def looked_at(card: EmulatedBoard) -> tuple[Any, Witness]:
    witness = Witness(transport_of(card))
    return hostmot2.Board(witness.transport, read_only=True), witness


def test_every_write_is_refused_in_the_core(card: EmulatedBoard) -> None:
    board, witness = looked_at(card)
    with board:
        for address in (0x0C00, 0x1000, 0x5A00):
            with pytest.raises(ReadOnly):
                board.write(address, 1)
        assert board.read(0x0100) == 0x55AACAFE
    assert witness.written == []


@pytest.mark.parametrize("part", ["ioport", "gpio", "encoders", "leds"])
def test_parts_that_write_when_they_are_made_are_refused(card: EmulatedBoard, part: str) -> None:
    board, witness = looked_at(card)
    with board, pytest.raises(ReadOnly):
        getattr(board, part)[0]
    assert witness.written == []


def test_smart_serial_can_be_looked_at_and_not_started(card: EmulatedBoard) -> None:
    board, witness = looked_at(card)
    with board:
        assert [channel.status.state for channel in board.sserial.channels] == ["stopped"] * 3
        with pytest.raises(ReadOnly):
            board.sserial.start(0x03)
    assert witness.written == []


def test_the_watchdog_is_not_made_to_bite_at_the_end(card: EmulatedBoard) -> None:
    board, witness = looked_at(card)
    with board:
        assert not board.watchdog.armed
        board.cycle.run()
        with pytest.raises(ReadOnly):
            board.watchdog.arm()
    assert witness.written == []


def test_an_engine_on_it_reads_and_writes_nothing(card: EmulatedBoard) -> None:
    board, witness = looked_at(card)
    with board:
        board.watchdog  # noqa: B018 - takes part in the cycle
        with board.engine(rate=1000, style="pipelined") as engine:
            for _ in range(10):
                engine.step()
            assert engine.status.failures == 0
            assert board.counters["words_read"] > 10
    assert witness.written == []


def test_outputs_of_the_program_that_drives_stay_on_when_the_watcher_leaves(card: EmulatedBoard) -> None:
    with hostmot2.open(card) as driver:
        pin = driver.gpio.free[0]
        pin.drive(True)
        with hostmot2.open(card, read_only=True) as watcher:
            watcher.read(0x1000)
        assert card.pin(pin.index).level == "1"  # driven; "H" would be let go
        driver.cycle.run()  # and its watchdog has not bitten


def test_a_pci_card_that_is_driven_can_be_looked_at(card: EmulatedBoard, tmp_path: Path) -> None:
    path = tmp_path / "resource0"
    words = [card.read(address) if address < 0x1000 else 0 for address in range(0, 0x10000, 4)]
    path.write_bytes(b"".join(word.to_bytes(4, "little") for word in words))
    with hostmot2.open(f"pci://{path}"):
        with pytest.raises(CardBusy):
            hostmot2.open(f"pci://{path}")
        with hostmot2.open(f"pci://{path}", read_only=True) as watcher:
            assert watcher.read(0x0100) == 0x55AACAFE
            with pytest.raises(ReadOnly):
                watcher.write(0x1000, 1)
    with pytest.raises(hostmot2.errors.CardNotFound):
        hostmot2.open(f"pci://{tmp_path}/none", read_only=True)


def test_closing_a_dump_is_no_error_whatever_was_used_of_it(tmp_path: Path, card: EmulatedBoard) -> None:
    from hostmot2 import dump

    with hostmot2.open(card) as board:
        (tmp_path / "a.hm2dump").write_text(dump.to_text(dump.take(board)))
    with hostmot2.open(f"dump://{tmp_path}/a.hm2dump") as board:
        assert board.watchdog.armed is False
