"""Mailbox rules of SSLBP 1.43 that the recordings do not hold (sserial.md 1, 2, SSLBP observed)."""

from __future__ import annotations

import pytest

from tests.emulator.sslbp_host import (
    BLOCK,
    COMMAND,
    CS,
    DATA,
    DOIT,
    IF0,
    READ,
    RESET,
    SETUP,
    START,
    STOP,
    STOP_ALL,
    STRIDE,
    WRITE,
    Host,
    chatters,
)

US = pytest.approx


def running(channels: int = 4) -> Host:
    host = Host(channels)
    host.attach(0)
    host.result(STOP_ALL)
    assert host.result(START | 1) == 0
    assert host.result(DOIT | 1) == 0
    return host


def recover(host: Host) -> None:
    """The way out of everything that hangs."""
    assert host.command(STOP | 0xFF, 100) is not None
    host.board.advance(2)  # its doorbell is still served, and what is written meanwhile is lost
    assert host.result(STOP_ALL) == 0xAA


def test_everything_is_zero_until_the_firmware_has_initialised_itself() -> None:
    host = Host()
    host.board = type(host.board)("5i25+7i77", clock="virtual", sserial_channels=4)
    assert [host.read(register) for register in (COMMAND, DATA, CS, IF0)] == [0, 0, 0, 0]
    host.board.advance(122.0)
    assert host.read(DATA) == 0xAA
    assert [host.cs(channel) for channel in range(4)] == [0xC100] * 4


def test_a_stop_all_right_after_power_up_is_swallowed() -> None:
    host = Host()
    host.board = type(host.board)("5i25+7i77", clock="virtual", sserial_channels=4)
    host.board.advance(5.0)
    host.begin(STOP_ALL)
    assert host.finish() == US(16.5, abs=3)
    host.board.advance(200)
    assert host.read(DATA) == 0xAA


@pytest.mark.parametrize(
    ("channels", "stop_all", "missing", "exist"),
    [(2, 31, 0xFC, 0x03), (3, 45.7, 0xF8, 0x07), (4, 60.7, 0xF0, 0x0F), (8, 120, 0x00, 0xFF)],
)
def test_stop_takes_its_time_per_channel(channels: int, stop_all: float, missing: int, exist: int) -> None:
    host = Host(channels)
    assert stop_all - 3 < (host.command(STOP_ALL) or 0) < stop_all + 5
    assert host.read(DATA) == 0xAA
    assert host.local(0x49) == exist
    assert host.local(0x07) == channels
    assert host.result(STOP | 0xFF) == missing


def test_channels_are_initialised_after_the_command_register_cleared() -> None:
    host = running()
    before = host.cs(), host.read(IF0)
    host.begin(STOP_ALL)
    while host.read(COMMAND):
        host.board.advance(0.02)
    assert (host.cs(), host.read(IF0)) == before
    host.board.advance(1.5)
    assert (host.cs(), host.inputs()) == (0xC100, (0, 0, 0))


def test_an_individual_stop_is_done_when_it_clears_and_leaves_the_others_running() -> None:
    host = Host()
    host.attach(0)
    host.attach(2, receive_size=5, transmit_size=4)
    host.result(STOP_ALL)
    assert host.result(START | 5) == 0
    assert host.result(DOIT | 5) == 0
    assert host.result(STOP | 1) == 0
    assert (host.cs(0), host.inputs(0)) == (0xC100, (0, 0, 0))
    assert host.cs(2) == 0x420000
    assert host.result(DOIT | 4) == 0


@pytest.mark.parametrize("command", [0x0A00, 0x0B01, 0x0001, 0x8066])
def test_unknown_commands_leave_ff(command: int) -> None:
    host = Host()
    assert host.command(command, 5) is not None
    assert host.read(DATA) == 0xFF


def test_zero_is_an_unknown_command_too() -> None:
    host = Host()
    assert host.read(DATA) == 0xAA
    host.begin(0)
    assert host.read(COMMAND) == 0
    host.board.advance(5)
    assert host.read(DATA) == 0xFF


@pytest.mark.parametrize("command", [0x1101, 0x3066])
def test_doit_with_other_bits_never_completes(command: int) -> None:
    host = running()
    assert host.command(command, 2000) is None
    recover(host)


@pytest.mark.parametrize("first", [DOIT | 1, START | 4])
def test_stop_all_while_busy_hangs(first: int) -> None:
    host = running()
    host.begin(first)
    host.board.advance(5)
    host.begin(STOP_ALL)
    assert host.finish(2000) is None
    assert host.read(COMMAND) == STOP_ALL
    host.begin(STOP_ALL)
    assert host.finish(500) is None, "repeating it does not help"
    assert host.cs() == 0x420000, "nothing is stopped"
    recover(host)
    host.board.advance(5)
    assert host.cs() == 0xC100


@pytest.mark.parametrize("way_out", [0x2003, 0x0801, 0x0901])
def test_any_command_with_a_low_byte_ends_the_hang_and_is_swallowed(way_out: int) -> None:
    host = running()
    host.begin(DOIT | 1)
    host.board.advance(5)
    host.begin(STOP_ALL)
    assert host.finish(500) is None
    assert host.command(way_out, 10) is not None
    host.board.advance(5)
    assert host.read(DATA) in (0xF0, 0xFF)
    assert host.cs() == 0x420000
    assert host.result(STOP_ALL) == 0xAA


@pytest.mark.parametrize("second", [DOIT | 1, READ | 3, START | 4])
def test_a_command_while_busy_is_lost_and_hides_the_result(second: int) -> None:
    host = running()
    host.begin(DOIT | 1)
    host.board.advance(20)
    host.begin(second)
    assert host.read(COMMAND) == second
    assert host.finish() is not None
    host.board.advance(5)
    assert host.read(DATA) == 0xFF
    assert host.cs(2) == 0xC100


def test_an_individual_stop_while_busy_only_aborts_the_command() -> None:
    host = running()
    host.result(STOP_ALL)
    host.result(START | 1)
    host.result(DOIT | 1)
    host.begin(DOIT | 1)
    host.board.advance(20)
    host.begin(STOP | 1)
    took = host.finish()
    assert took is not None
    assert took < 5
    assert host.read(DATA) == 0xF0, "what the last executed stop left over"
    host.board.advance(100)
    assert host.cs() == 0x420000


def test_stop_all_during_stop_all_is_harmless() -> None:
    host = running()
    host.begin(STOP_ALL)
    host.board.advance(20)
    host.begin(STOP_ALL)
    took = host.finish()
    assert took is not None
    assert took < 45
    host.board.advance(20)
    assert host.cs() == 0xC100


def test_bit_31_ignores_a_write_busy_or_not() -> None:
    host = running()
    host.begin(0x80001001)
    assert host.read(COMMAND) == 0
    host.begin(0x7FFF1001)
    host.begin(0x80000800)
    assert host.read(COMMAND) == 0x1001
    assert host.finish() == US(85, abs=4)
    assert host.read(DATA) == 0


@pytest.mark.parametrize("release", [0x0001, 0x0800, 0x0901, 0x1001, 0x2003, 0x0000])
def test_what_releases_the_reset_is_swallowed(release: int) -> None:
    host = running()
    host.begin(RESET | 0x123)
    host.board.advance(1)
    assert host.read(COMMAND) == 0x4123
    host.begin(release)
    if release:
        assert host.finish() == US(21.7, abs=1)
    else:
        host.board.advance(21.9)
    host.board.advance(0.5)
    assert host.read(DATA) == 0xAA
    assert host.cs() == 0x420000, "stale until the initialisation is over"
    host.board.advance(100)
    assert (host.cs(), host.inputs()) == (0xC100, (0, 0, 0))
    assert host.local(0x03) == 43
    assert host.result(START | 1) == 0


def test_a_command_right_behind_the_reset_hangs_and_can_be_written_again() -> None:
    host = Host()
    host.begin(RESET)
    host.begin(1)
    while host.read(COMMAND):
        host.board.advance(0.01)
    host.begin(READ | 3)
    assert host.finish(500) is None
    host.begin(READ | 3)
    assert (host.finish() or 9) < 4
    assert host.read(DATA) == 43


@pytest.mark.parametrize("later", [1.0, 30.0, 50.0])
def test_a_command_a_microsecond_behind_the_reset_is_served_after_the_initialisation(later: float) -> None:
    host = Host()
    host.begin(RESET)
    host.begin(1)
    assert host.finish() is not None
    host.board.advance(later)
    host.begin(READ | 3)
    assert host.finish() == US(60.4 - later, abs=3)
    assert host.read(DATA) == 43


def test_in_reset_the_rom_is_read_and_written_and_registers_are_kept() -> None:
    host = running()
    host.begin(RESET | 0x7FF)
    assert host.read(DATA) == 0xABCD
    host.begin(0xE066)
    assert host.read(COMMAND) == 0xE066, "bit 14 makes it a reset, not a local write"
    host.write(DATA, 0xFFFF1234)
    assert host.read(DATA) == 0x1234
    host.begin(0x80000000)
    host.board.advance(100)
    assert host.read(COMMAND) == 0xE066, "no release"
    assert host.cs() == 0x420000
    host.write(IF0, 0x04030201)
    host.begin(1)
    host.finish()
    host.board.advance(100)
    host.result(START | 1)
    host.result(DOIT | 1)
    assert host.port.remote(0).outputs[:4] == bytes([1, 2, 3, 4])  # type: ignore[union-attr]


def test_reset_works_during_a_start_and_out_of_a_hang() -> None:
    host = running()
    for begin in ((START | 2,), (DOIT | 1, STOP_ALL)):
        for command in begin:
            host.begin(command)
            host.board.advance(3)
        host.begin(RESET)
        host.begin(1)
        assert host.finish(100) is not None
        host.board.advance(100)
        assert host.cs() == 0xC100
        assert host.result(START | 1) == 0
        assert host.result(DOIT | 1) == 0


def test_reset_keeps_memory_from_100_on() -> None:
    host = Host(8)
    for address in (0x66, 0x8E, 0xC0, 0xF2, 0x124, 0x1A0):
        host.write_local(address, 0x5A)
    host.write_local(BLOCK + 3 * STRIDE + 0x2A, 115200, 4)
    host.begin(RESET)
    host.begin(1)
    host.finish()
    host.board.advance(200)
    assert [host.local(a) for a in (0x66, 0x8E, 0xC0, 0xF2, 0x124, 0x1A0)] == [0, 0, 0, 0, 0x5A, 0x5A]
    assert host.local(BLOCK + 3 * STRIDE + 0x2A, 4) == 2500000


def test_local_variables() -> None:
    host = Host()
    assert [host.local(a) for a in range(8)] == [0x12, 8, 1, 43, 0x70, 0x32, 0xD8, 4]
    assert bytes(host.local(a) for a in range(8, 16)) == b"8I207I64"
    assert host.local(0x230, 4) == 100_000_000
    assert host.local(0x234) == 4
    assert host.local(0x48) == 0xFF
    assert host.local(0x4E) == 0x20
    assert host.local(0x3FF) == 0
    assert [host.variable(offset) for offset in (0x13, 0x1B)] == [0xC1, 20]
    assert host.variable(0x2A, 3, 4) == 2500000


def test_id_bytes_can_be_overwritten_until_reset() -> None:
    host = Host()
    host.write_local(0x02, 7)
    assert host.local(0x02) == 7
    host.begin(RESET)
    host.begin(1)
    host.finish()
    host.board.advance(100)
    assert host.local(0x02) == 1


def test_a_local_write_takes_the_low_byte_of_data_which_stays() -> None:
    host = Host()
    host.write(DATA, 0xABCDEF5A)
    for address in (0x66, 0x67):
        host.command(WRITE | address)
    assert host.local(0x66, 2) == 0x5A5A


def test_local_access_does_not_disturb_process_data() -> None:
    host = running()
    for _ in range(3):
        assert host.local(0x03) == 43
        assert host.result(DOIT | 1) == 0
    assert host.cs() == 0x420000


def test_start_in_setup_sets_ticks_and_start_type() -> None:
    host = Host()
    host.attach(0)
    host.result(SETUP | 1)
    assert [host.local(a) for a in (0x47, 0x63, 0x64)] == [0x0F, 6, 250]
    assert host.local(0x61, 2) == 20000 - 2
    host.result(STOP_ALL)
    host.result(START | 1)
    assert [host.local(a) for a in (0x47, 0x63, 0x64)] == [0x09, 200, 200]
    assert host.local(0x61, 2) == 200 - 2
    assert chatters(host.cs()) == 0x3A0000
