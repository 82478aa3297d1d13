"""A newly configured FPGA: registers as at a power-up (card observed, SSLBP observed 2), wires as before."""

from __future__ import annotations

import struct
from dataclasses import replace

import pytest

from hostmot2 import flash_layout
from hostmot2.emulator import EmulatedBoard, EmulatedRemote
from hostmot2.emulator.cards import card
from hostmot2.emulator.ethernet import EthernetCard, EthernetDescription

SPEC = "7i92+7i77+7i76"
COMMAND, DATA, CS = 0x5B00, 0x5C00, 0x5D00
RATE, ACCUMULATOR, MASTER = 0x2000, 0x2100, 0x2900
COUNT, CONTROL, DIVIDER = 0x3600, 0x3700, 0x3800
TIMER, STATUS = 0x0C00, 0x0D00


def configure(board: EmulatedBoard) -> None:
    """The FPGA reloads, as a client asks for it."""
    engine = EthernetCard(EthernetDescription("7I92", reload_us=0), board)
    words = flash_layout.xilinx_reload_words(0)
    assert engine.process(b"".join(struct.pack("<HHH", 0xD901, 0x1E, word) for word in words)) is None
    assert engine.image == "user"


@pytest.fixture
def board() -> EmulatedBoard:
    board = EmulatedBoard(SPEC, clock="virtual")
    board.advance(400)
    return board


@pytest.mark.parametrize("timer", [0x80000000, 1_000_000])
def test_the_watchdog_stands_and_its_status_is_1(board: EmulatedBoard, timer: int) -> None:
    board.write(TIMER, timer)
    board.write(STATUS, 0)
    assert board.read(STATUS) == 0
    configure(board)
    assert (board.read(TIMER), board.read(STATUS)) == (0x80000000, 1)
    board.write(STATUS, 0)
    board.advance(100_000)
    assert (board.read(TIMER), board.read(STATUS)) == (0x80000000, 0)
    board.write(0x0E00, 0x5A000000)  # a reload latch never written: bites three edges later
    board.advance_clocks(3)
    assert board.read(STATUS) == 1


@pytest.mark.parametrize("pending", [0x0801, 0x0901, 0x1001, 0x1101, 0x4800])
def test_a_smart_serial_port_starts_anew_whatever_it_was_doing(board: EmulatedBoard, pending: int) -> None:
    """A STOP ALL written over a pending command hangs; a processor that is configured anew knows of none."""
    remote = EmulatedRemote(name="7I84", receive_size=5, transmit_size=4)
    board.sserial[0].attach(3, remote)
    board.write(COMMAND, 0x0908)
    board.advance(2000)
    board.write(COMMAND, pending)
    board.advance(1)
    configure(board)
    assert [board.read(register) for register in (COMMAND, DATA, CS + 12)] == [0, 0, 0]
    board.advance(300)
    assert [board.read(register) for register in (COMMAND, DATA, CS + 12)] == [0, 0xAA, 0xC100]
    board.write(COMMAND, 0x0908)
    board.advance(2000)
    assert (board.read(COMMAND), board.read(DATA)) == (0, 0)
    assert board.sserial[0].remote(3) is remote


def test_all_memory_of_a_smart_serial_processor_is_new(board: EmulatedBoard) -> None:
    """What a reset keeps, a reload does not: blocks of channels 3.. and words written over the program."""
    crc_of_channel_3 = 0x70 + 3 * 0x32 + 0x1E
    board.write(DATA, 0xFF)
    board.write(COMMAND, 0xA000 | crc_of_channel_3)
    board.advance(10)
    board.write(COMMAND, 0x4123)
    board.write(DATA, 0x5678)
    configure(board)
    board.advance(300)
    board.write(COMMAND, 0x2000 | crc_of_channel_3)
    board.advance(10)
    assert (board.read(COMMAND), board.read(DATA)) == (0, 0)
    for address, word in ((0x123, 0), (0x7FF, 0xABCD)):
        board.write(COMMAND, 0x4000 | address)
        assert board.read(DATA) == word


def test_nothing_steps_until_the_master_rate_is_written_again(board: EmulatedBoard) -> None:
    board.write(MASTER, 0xFFFFFFFF)
    board.write(RATE, 0x10000000)
    board.write(0x2500, 5)
    board.advance(100)
    assert board.read(ACCUMULATOR) != 0
    configure(board)
    board.advance(100)
    assert (board.read(MASTER), board.read(ACCUMULATOR)) == (0, 0)
    board.write(MASTER, 0xFFFFFFFF)
    board.advance(100)
    assert board.read(ACCUMULATOR) == 0, "the rate is 0, too"


def test_encoders_count_from_0_with_the_settings_of_a_power_up(board: EmulatedBoard) -> None:
    fresh = EmulatedBoard(SPEC, clock="virtual")
    fresh.advance(400)
    board.encoder_input(1).run(2000.0, 8)  # the select pin floats: the odd encoder
    board.write(CONTROL + 4, 0x0800)
    board.write(DIVIDER, 48)
    board.write(0x3A00, 0xFFF)
    board.advance(50)
    assert board.read(COUNT + 4) & 0xFFFF == 8
    board.write(0x3A00, 0x7FF)  # the slowest filter: its countdown is not waited for
    board.advance_clocks(5)
    configure(board)
    board.advance_clocks(300)
    assert board.read(COUNT + 4) & 0xFFFF == 0
    assert board.read(CONTROL + 8) == fresh.read(CONTROL + 8) == 0x8003, "open lines rise together"
    assert board.read(CONTROL + 4) & 0xFFF8 == fresh.read(CONTROL + 4) & 0x7FF8
    assert board.read(DIVIDER) == 0
    board.encoder_input(1).run(2000.0, -3)
    board.advance(50)
    assert board.read(COUNT + 4) & 0xFFFF == 0xFFFD


def test_the_idrom_is_that_of_the_firmware_and_locked(board: EmulatedBoard) -> None:
    before = board.read(0x400, 256)
    board.write(0x0800, 1)
    board.write(0x0420, 0x12345678)
    configure(board)
    assert board.read(0x0800) == 0
    assert board.read(0x400, 256) == before
    board.write(0x0420, 0x12345678)
    assert board.read(0x400, 256) == before


def test_outputs_float_and_what_drives_inputs_goes_on(board: EmulatedBoard) -> None:
    board.write(0x1000, 0)
    board.write(0x1100, 0x1FFFF)
    board.write(0x1400, 0x1)
    board.pin(20).drive(0)
    configure(board)
    assert [board.read(0x1100 + 4 * port) for port in (0, 1)] == [0, 0]
    assert board.read(0x1000) == 0x1FFFF
    assert board.read(0x1004) == 0x1FFF7
    board.write(0x1100, 1)
    assert board.pin(0).level == "0", "neither latch nor inversion is left"


def test_an_interrupt_is_off() -> None:
    board = EmulatedBoard(replace(card(SPEC), bus="pci"), clock="virtual")
    board.write(0x0A00, 3)
    assert board.interrupt
    configure(board)
    assert not board.interrupt
    assert board.read(0x0A00) == 0
