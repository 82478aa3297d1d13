"""Packet UARTs: modes of fact sheet registers 2.13, frames both ways, errors of frames, losses."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.cards import CardDescription
from hostmot2.modules.pktuart import Frame, Parity
from tests.modules.module_card import CLOCK_LOW, ModuleWords, module_card, pin, written

PKT_TX, PKT_RX, TX, RX = 0x1B, 0x1C, 0x6100, 0x6500
DRIVE = 2


def card(version: int) -> CardDescription:
    return module_card(
        ModuleWords(PKT_TX, TX, 4, instances=2, version=version, multiple=0xF),
        ModuleWords(PKT_RX, RX, 4, instances=2, version=version, multiple=0xF),
        pins=(
            *(pin(PKT_TX, number, unit) for unit in (0, 1) for number in (0x81, 0x82, 0x83)),
            pin(PKT_RX, 1),
            pin(PKT_RX, 1, 1),
        ),
    )


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard(card(3), clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


@pytest.mark.parametrize("wrong", [{"inter_frame": 256}, {"drive_delay": 16}, {"drive_delay": "1"}])
def test_a_setup_that_was_refused_changes_nothing(
    board: Board, monkeypatch: pytest.MonkeyPatch, wrong: dict[str, Any]
) -> None:
    uart = board.pktuarts[0]
    words = written(board, monkeypatch)
    with pytest.raises((TypeError, ValueError)):
        uart.setup(9600, **wrong)
    with pytest.raises(ValueError, match="call setup first"):
        uart.send(b"x")
    board.restore()
    assert not [address for address in words if TX <= address < RX + 0x400]


@pytest.mark.parametrize(("version", "bits"), [(0, 20), (1, 20), (2, 24), (3, 24)])
def test_the_rate_by_version(version: int, bits: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with hostmot2.open(EmulatedBoard(card(version), clock="virtual")) as board:
        words = written(board, monkeypatch)
        board.pktuarts[1].setup(115200)
        assert words[TX + 0x204] == words[RX + 0x204] == round(115200 * 2**bits / CLOCK_LOW)


def test_modes(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    words = written(board, monkeypatch)
    uart = board.pktuarts[0]
    uart.setup(19200, parity="odd", two_stop_bits=True, inter_frame=30, drive_delay=5, filter_clocks=0x1234)
    assert words[TX + 0x300] == 0b111 << 17 | 30 << 8 | 1 << 5 | 5
    assert words[RX + 0x300] == 0x34 << 22 | 0b111 << 17 | 30 << 8 | 1 << 3
    assert words[RX + 0x200] >> 24 == 0x12
    uart.setup(19200, parity="even")
    assert words[TX + 0x300] >> 17 == 0b001


def test_what_a_version_cannot_is_refused() -> None:
    with hostmot2.open(EmulatedBoard(card(1), clock="virtual")) as board:
        with pytest.raises(errors.UnsupportedFirmware) as caught:
            board.pktuarts[0].setup(9600, two_stop_bits=True)
        assert (caught.value.expected, caught.value.received) == (3, 1)
        with pytest.raises(ValueError, match="filter"):
            board.pktuarts[0].setup(9600, filter_clocks=256)


def test_a_pair_of_different_versions_is_refused() -> None:
    mixed = card(3)
    modules = tuple(replace(m, version=2) if m.gtag == PKT_RX else m for m in mixed.modules)
    emulated = EmulatedBoard(replace(mixed, modules=modules), clock="virtual")
    with hostmot2.open(emulated) as board, pytest.raises(errors.UnsupportedFirmware, match="receivers 2"):
        _ = board.pktuarts


def test_frames_go_out(board: Board, emulated: EmulatedBoard) -> None:
    uart = board.pktuarts[0]
    uart.setup(1e6)
    frames = [bytes(range(size % 256)) or b"\x01" for size in (1, 2, 3, 4, 5, 8, 255)]
    assert emulated.pin(DRIVE).level == "0"
    for frame in frames:
        uart.send(frame)
    assert emulated.pin(DRIVE).level == "1"
    assert uart.pending == len(frames)
    emulated.advance(10_000.0)
    assert emulated.pktuart(0).received == frames
    assert uart.pending == 0
    assert emulated.pin(DRIVE).level == "0"


@pytest.mark.parametrize(
    ("parity", "bits"), [("none", "0101001011"), ("even", "01010010101"), ("odd", "01010010111")]
)
def test_a_character_on_the_pin(board: Board, emulated: EmulatedBoard, parity: Parity, bits: str) -> None:
    uart = board.pktuarts[0]
    uart.setup(1e6, parity=parity)
    uart.send(b"\xa5")
    emulated.advance(0.5)
    levels = ""
    for _ in bits:
        levels += emulated.pin(0).level
        emulated.advance(1.0)
    assert levels == bits


def test_data_without_a_frame_is_data_but_no_frame() -> None:
    emulated = EmulatedBoard(card(3), clock="virtual")
    emulated.write(TX + 0x200, 1 << 20)
    emulated.write(TX, 0x04030201)
    assert emulated.read(TX + 0x300) == 1 << 21
    emulated.write(TX + 0x100, 4)
    assert emulated.read(TX + 0x300) == 1 << 21 | 1 << 16 | 1 << 7
    emulated.advance(1000.0)
    assert emulated.read(TX + 0x300) == 0


@pytest.mark.parametrize(("version", "bits"), [(0, 10 + 30), (2, 10 + 30), (3, 11 + 4 * 30)])
def test_a_second_stop_bit_and_longer_gaps_came_with_version_3(version: int, bits: int) -> None:
    emulated = EmulatedBoard(card(version), clock="virtual")
    emulated.write(TX + 0x200, 1 << (10 if version < 2 else 14))  # 1024 clocks a bit
    emulated.write(TX + 0x300, 1 << 20 | 1 << 19 | 30 << 8)
    emulated.write(TX, 0x55)
    emulated.write(TX + 0x100, 1)
    emulated.advance_clocks(bits * 1024 - 1)
    assert emulated.read(TX + 0x300) >> 16 & 0x1F == 1
    emulated.advance_clocks(2)
    assert emulated.read(TX + 0x300) >> 16 & 0x1F == 0


def test_a_full_transmitter_is_waited_for(board: Board, emulated: EmulatedBoard) -> None:
    uart = board.pktuarts[0]
    uart.setup(1e6)
    frames = [bytes([n]) * 200 for n in range(40)]
    for frame in frames:
        uart.send(frame)
        board.cycle.run()
    emulated.advance(20_000.0)
    assert emulated.pktuart(0).received == frames
    emulated.write(TX + 0x200, 0)
    for frame in frames[:5]:
        uart.send(frame)
    with pytest.raises(errors.ModuleTimeout):
        uart.send(frames[5])


@pytest.mark.parametrize("frame", [b"", bytes(1024)])
def test_frames_of_impossible_length_are_refused(board: Board, frame: bytes) -> None:
    board.pktuarts[0].setup(1e6)
    with pytest.raises(ValueError, match="1023"):
        board.pktuarts[0].send(frame)


def test_received_frames_are_popped_once(board: Board, emulated: EmulatedBoard) -> None:
    uart = board.pktuarts[1]
    emulated.pktuart(1).send(b"nobody listens")
    uart.setup(1e6)
    frames = [b"a", b"bcde", b"\x01\x03\x00\x00\x00\x0a\xc5\xcd"]
    for frame in frames:
        emulated.pktuart(1).send(frame)
    assert [frame.data for frame in uart.read()] == frames
    assert uart.read() == []


def test_errors_of_a_frame_are_told(board: Board, emulated: EmulatedBoard) -> None:
    uart = board.pktuarts[0]
    uart.setup(1e6)
    emulated.pktuart(0).send(b"one", parity_error=True, longest_gap=12)
    emulated.pktuart(0).send(b"two", start_error=True, overrun=True)
    assert uart.read() == [
        Frame(b"one", parity_error=True, longest_gap=12),
        Frame(b"two", start_error=True, overrun=True),
    ]
    emulated.pktuart(0).send(b"three")
    assert uart.read()[0].is_good


def test_lost_frames_are_told_once(board: Board, emulated: EmulatedBoard) -> None:
    uart = board.pktuarts[0]
    uart.setup(1e6)
    for _ in range(17):
        emulated.pktuart(0).send(b"frame")
    with pytest.raises(errors.DataLost):
        uart.read()
    assert uart.read() == []
    emulated.pktuart(0).send(b"next")
    assert [frame.data for frame in uart.read()] == [b"next"]


def test_silent_at_close(emulated: EmulatedBoard) -> None:
    with hostmot2.open(emulated) as board:
        board.pktuarts[0].setup(9600)
        board.pktuarts[0].send(b"turn on the spindle")
    assert (emulated.read(TX + 0x300), emulated.read(RX + 0x300)) == (0, 0)
    emulated.advance(100_000.0)
    assert emulated.pktuart(0).received == []
    assert emulated.pin(DRIVE).level == "H"


def test_set_up_again_after_a_bite_with_its_pins_off(
    board: Board, emulated: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    board.pktuarts[0].setup(9600)
    emulated.advance(60_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()
    words = written(board, monkeypatch)
    board.watchdog.acknowledge()
    assert words[TX + 0x200] == round(9600 * 2**24 / CLOCK_LOW)
    assert emulated.pin(DRIVE).level == "H"


@pytest.mark.parametrize("call", [lambda uart: uart.send(b"x"), lambda uart: uart.read()])
def test_nothing_before_setup(
    board: Board, monkeypatch: pytest.MonkeyPatch, call: Callable[[Any], object]
) -> None:
    uarts = board.pktuarts
    words = written(board, monkeypatch)
    with pytest.raises(ValueError, match="pktuart 1: call setup first"):
        call(uarts[1])
    assert words == {}


def test_they_print_their_rates(board: Board) -> None:
    assert len(board.pktuarts) == 2
    board.pktuarts[0].setup(9600)
    assert repr(board.pktuarts).splitlines() == ["<Pktuart 0 9602 baud>", "<Pktuart 1 not set up>"]


def test_a_parity_that_is_none_of_the_three_is_refused(board: Board) -> None:
    wrong: Any = "mark"
    with pytest.raises(ValueError, match="parity is one of none, even, odd"):
        board.pktuarts[0].setup(9600, parity=wrong)
    assert board.pktuarts[0].baud == 0
