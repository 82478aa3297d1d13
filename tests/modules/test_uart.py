"""UARTs: rates of fact sheet registers 2.12, bytes both ways, FIFOs that pop, losses that are told."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from tests.modules.module_card import CLOCK_LOW, ModuleWords, module_card, pin
from tests.modules.waveform import edges

UART_TX, UART_RX, TX, RX = 0x09, 0x0A, 0x6100, 0x6500
CARD = module_card(
    ModuleWords(UART_TX, TX, 4, instances=2, strides=0x10, multiple=0xF),
    ModuleWords(UART_RX, RX, 4, instances=2, strides=0x10, multiple=0xF),
    pins=(
        *(pin(UART_TX, number, unit) for unit in (0, 1) for number in (0x81, 0x82)),
        pin(UART_RX, 1),
        pin(UART_RX, 1, 1),
    ),
    instance_stride=0x10,
)


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard(CARD, clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


def test_rates_and_modes(board: Board, emulated: EmulatedBoard) -> None:
    uart = board.uarts[1]
    uart.setup(115200, drive_delay=7, half_duplex=True)
    rate = round(115200 * 2**20 / CLOCK_LOW)
    assert emulated.read(TX + 0x210) == emulated.read(RX + 0x210) == rate
    assert emulated.read(TX + 0x310) == 0x27
    assert emulated.read(RX + 0x310) == 0x04
    assert uart.baud == pytest.approx(115200, rel=1e-3)
    uart.setup(9600, auto_drive=False)
    assert emulated.read(TX + 0x310) == 0x40


def test_a_setup_that_was_refused_changes_nothing(board: Board) -> None:
    uart = board.uarts[0]
    with pytest.raises(ValueError, match="16 is outside"):
        uart.setup(9600, drive_delay=16)
    assert (uart.is_set_up, uart.baud) == (False, 0.0)


@pytest.mark.parametrize("baud", [0, 50, 200e6, float("nan"), float("inf")])
def test_speeds_the_clock_cannot_make_are_refused(board: Board, baud: float) -> None:
    with pytest.raises(ValueError, match="baud"):
        board.uarts[0].setup(baud)


def test_nothing_before_setup(board: Board, emulated: EmulatedBoard) -> None:
    with pytest.raises(ValueError, match="setup"):
        board.uarts[0].send(b"x")
    with pytest.raises(ValueError, match="setup"):
        board.uarts[0].read()
    assert emulated.pin(0).level == "H"


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 63, 64, 65, 300])
def test_bytes_go_out_whole_and_in_order(board: Board, emulated: EmulatedBoard, size: int) -> None:
    uart = board.uarts[1]
    uart.setup(1e6)
    data = bytes(n * 7 & 0xFF for n in range(size))
    uart.send(data)
    emulated.advance(10 * 65 + 10)
    assert emulated.uart(1).received == data
    assert emulated.uart(1).received == b"", "taken"
    assert uart.pending == 0


def test_a_byte_on_the_pin(board: Board, emulated: EmulatedBoard) -> None:
    board.uarts[0].setup(1e6)
    assert (emulated.pin(0).level, emulated.pin(1).level) == ("1", "0")
    board.uarts[0].send(b"\x55")
    assert emulated.pin(1).level == "1", "the driver is enabled"
    start = emulated.clocks
    changes = edges(emulated, 0, 1100)
    assert [round((clock - start) / 100) for clock, _ in changes] == [1, 2, 3, 4, 5, 6, 7, 8, 9]
    assert (emulated.pin(0).level, emulated.pin(1).level) == ("1", "0")


@pytest.mark.parametrize("size", [1, 3, 4, 6, 15, 16])
def test_received_bytes_are_popped_once(board: Board, emulated: EmulatedBoard, size: int) -> None:
    uart = board.uarts[0]
    uart.setup(1e6)
    data = bytes(range(1, size + 1))
    emulated.uart(0).send(data)
    emulated.advance(10.0 * size - 5)
    assert uart.read() == data[:-1], "the last is still on its way"
    emulated.advance(10.0)
    assert uart.read() == data[-1:]
    assert uart.read() == b""


def test_reading_a_part(board: Board, emulated: EmulatedBoard) -> None:
    uart = board.uarts[0]
    uart.setup(1e6)
    emulated.uart(0).send(b"abcdefg")
    emulated.advance(100.0)
    assert (uart.read(5), uart.read(5)) == (b"abcde", b"fg")


def test_lost_bytes_are_told_once(board: Board, emulated: EmulatedBoard) -> None:
    uart = board.uarts[0]
    uart.setup(1e6)
    emulated.uart(0).send(bytes(20))
    emulated.advance(300.0)
    with pytest.raises(errors.DataLost) as caught:
        uart.read()
    assert caught.value.index == 0
    assert uart.read() == bytes(16)


def test_a_transmitter_that_hangs_is_an_error(board: Board, emulated: EmulatedBoard) -> None:
    uart = board.uarts[0]
    uart.setup(1e6)
    emulated.write(TX + 0x200, 0)
    with pytest.raises(errors.ModuleTimeout):
        uart.send(bytes(100))


def test_silent_at_close(emulated: EmulatedBoard) -> None:
    with hostmot2.open(emulated) as board:
        board.uarts[0].setup(9600)
        board.uarts[0].send(bytes(60))
    assert (emulated.read(TX + 0x100), emulated.read(TX + 0x300)) == (0, 0)
    emulated.advance(100_000.0)
    assert emulated.uart(0).received == b""
    assert emulated.pin(0).level == "H"


def test_set_up_again_after_a_bite_with_its_pins_off(board: Board, emulated: EmulatedBoard) -> None:
    uart = board.uarts[0]
    uart.setup(115200)
    emulated.advance(60_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()
    emulated.write(TX + 0x200, 0)
    board.watchdog.acknowledge()
    assert emulated.read(TX + 0x200) == round(115200 * 2**20 / CLOCK_LOW)
    assert emulated.pin(0).level == "H"


def test_a_transmitter_alone_sends_and_cannot_read() -> None:
    card = module_card(
        ModuleWords(UART_TX, TX, 4, instances=1, strides=0x10, multiple=0xF),
        pins=(pin(UART_TX, 0x81),),
        instance_stride=0x10,
    )
    with hostmot2.open(EmulatedBoard(card, clock="virtual")) as board:
        uart = board.uarts[0]
        uart.setup(9600)
        uart.send(b"x")
        with pytest.raises(errors.ModuleMissing, match="uart 0 has no receiver"):
            uart.read()


def test_they_print_their_rates(board: Board) -> None:
    assert len(board.uarts) == 2
    board.uarts[1].setup(115200)
    assert repr(board.uarts).splitlines() == ["<Uart 0 not set up>", "<Uart 1 115204 baud>"]
