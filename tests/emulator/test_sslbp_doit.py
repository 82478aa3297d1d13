"""Process data, errors and counters on SSLBP 1.43: what the recordings do not hold (sserial.md 2.3, 3)."""

from __future__ import annotations

import pytest

from hostmot2.emulator import EmulatedRemote
from tests.emulator.sslbp_host import (
    COMMAND,
    CS,
    DATA,
    DOIT,
    IF0,
    SETUP,
    START,
    STOP,
    STOP_ALL,
    Host,
    chatters,
)

US = pytest.approx
KEPT = 0x44332211


def running(channels: int = 4, doit: bool = True, **what: object) -> tuple[Host, EmulatedRemote]:
    host = Host(channels)
    remote = host.attach(0, **what)
    host.result(STOP_ALL)
    assert host.result(START | 1) == 0
    if doit:
        assert host.result(DOIT | 1) == 0
        assert host.command(DOIT | 1) is not None
    return host, remote


# -- the bits of DATA


def test_doit_bits_of_channels_that_were_never_started() -> None:
    host = Host()
    host.attach(0)
    assert host.result(DOIT | 0x01) == 0, "no start at all: not ready, masked"
    assert host.result(DOIT | 0xF0) == 0xF0, "channels that do not exist"
    host.result(STOP_ALL)
    assert host.result(DOIT | 0x0F) == 0
    host.result(START | 1)
    assert host.result(DOIT | 0x04) == 0x04, "some start was done since"
    assert host.result(DOIT | 0x80) == 0x80
    assert host.result(DOIT | 0x05) == 0x04


def test_doit_bits_of_channels_that_failed_to_start_or_were_stopped() -> None:
    host = Host()
    host.attach(0)
    host.attach(2, receive_size=5, transmit_size=4)
    assert host.result(START | 3) == 2
    assert host.result(DOIT | 3) == 0, "failed to start"
    assert host.cs(1) == 0x0001E188
    assert host.result(START | 4) == 0
    assert host.result(STOP | 4) == 0
    assert host.result(DOIT | 4) == 0, "individually stopped"
    assert host.result(START | 1) == 0
    assert host.result(DOIT | 4) == 4, "after a start that did not name it"


def test_doit_bits_of_missing_channels_named_by_the_last_start() -> None:
    host = Host(2)
    host.attach(0)
    host.attach(1)
    assert host.result(STOP | 0xFF) == 0xFC
    assert host.result(DOIT | 0xFF) == 0xFC
    assert host.result(START | 0x83) == 0x80
    assert host.command(DOIT | 0x80) == US(4, abs=2)
    assert host.read(DATA) == 0
    assert host.result(DOIT | 0xFF) == 0x7C


def test_doit_of_nothing_is_quick() -> None:
    host, _ = running()
    host.board.advance(50)
    assert (host.command(DOIT) or 9) < 5
    assert host.read(DATA) == 0


def test_two_channels_take_the_time_of_the_longer() -> None:
    host, _ = running()
    host.attach(2, receive_size=5, transmit_size=4)
    host.result(START | 4)
    host.result(DOIT | 5)
    assert host.command(DOIT | 1) == US(85, abs=3)
    assert host.command(DOIT | 4) == US(60, abs=3)
    assert host.command(DOIT | 5) == US(85, abs=3)
    assert [host.cs(0), host.cs(2)] == [0x420000] * 2


# -- errors while running


def test_no_answer_times_out_keeps_the_inputs_and_is_only_flagged_at_the_21st() -> None:
    host, remote = running()
    remote.inputs = bytes(8)
    remote.inject(skip=23)
    for n in range(1, 24):
        assert host.command(DOIT | 1) == US(124.5, abs=4)
        assert host.read(DATA) == 1
        assert host.cs() == (0x422008 if n <= 20 else 0x422088)
        assert host.read(IF0) == KEPT
        assert host.variable(0x17) == min(n, 20)
    assert host.result(DOIT | 1) == 0
    assert (host.cs(), host.read(IF0)) == (0x422088, 0), "sticky until a stop"
    host.result(STOP | 1)
    assert host.variable(0x17) == 0
    assert host.result(START | 1) == 0
    assert chatters(host.cs()) == 0x3A0000


def test_a_wrong_crc_fails_the_doit_right_behind_too() -> None:
    host, remote = running()
    remote.inject(bad_crc=1)
    assert host.command(DOIT | 1) == US(84, abs=4)
    assert (host.read(DATA), host.cs()) == (1, 0x432001)
    host.port.take_line_bytes()
    assert host.command(DOIT | 1) == US(39, abs=4)
    assert (host.read(DATA), host.cs()) == (1, 0x422009)
    assert host.port.take_line_bytes() == [], "nothing was sent"
    assert host.result(DOIT | 1) == 0


def test_a_wrong_crc_is_over_after_a_while() -> None:
    host, remote = running()
    remote.inject(bad_crc=1)
    assert host.result(DOIT | 1) == 1
    host.board.advance(300)
    assert host.cs() == 0x422009
    assert host.result(DOIT | 1) == 0
    assert (host.variable(0x14), host.variable(0x17)) == (1, 1)


def test_an_answer_two_bytes_short_is_a_timeout() -> None:
    host, remote = running()
    remote.inject(truncate=2)
    assert host.command(DOIT | 1) == US(124.5, abs=4)
    assert (host.read(DATA), host.cs()) == (1, 0x422008)
    assert host.result(DOIT | 1) == 0


def test_a_surplus_byte_shows_at_the_next_doit_whose_answer_the_one_after_takes() -> None:
    host, remote = running()
    remote.inject(extra=1)
    assert host.result(DOIT | 1) == 0
    host.board.advance(4)
    assert host.command(DOIT | 1) == US(4.4, abs=2)
    assert (host.read(DATA), host.cs()) == (1, 0x432010)
    host.port.take_line_bytes()
    assert host.command(DOIT | 1) == US(80, abs=4)
    assert host.read(DATA) == 0
    assert sum(b.to_remote and b.value == 0xBD for b in host.port.take_line_bytes()) <= 1
    assert host.cs() == 0x422010


def test_surplus_bytes_with_time_between_the_doits() -> None:
    host, remote = running()
    for _ in range(3):
        remote.inject(extra=2)
        assert host.result(DOIT | 1) == 0
        host.board.advance(200)
        assert host.command(DOIT | 1) == US(3.7, abs=2)
        assert (host.read(DATA), host.cs()) == (1, 0x432010)
        host.board.advance(200)
        assert host.result(DOIT | 1) == 0
        host.board.advance(200)
    assert host.cs() == 0x422010
    assert (host.variable(0x18), host.variable(0x17)) == (3, 0)


def test_a_surplus_byte_beside_a_slower_channel_reads_as_success() -> None:
    host, remote = running()
    host.attach(2, receive_size=13, transmit_size=12)
    host.result(START | 4)
    host.result(DOIT | 4)
    remote.inject(extra=1)
    assert host.result(DOIT | 5) == 0
    host.board.advance(50)
    assert host.result(DOIT | 5) == 0
    assert host.cs() & 0xFF == 0x10


def test_a_low_stop_bit() -> None:
    host, remote = running()
    for _ in range(3):
        remote.inject(framing_break=1)
        assert host.result(DOIT | 1) == 1
        assert host.cs() in (0x432020, 0x432028)
        assert host.read(IF0) == KEPT
        host.board.advance(300)
        assert host.cs() == 0x422028
    assert host.result(DOIT | 1) == 0
    assert (host.variable(0x19), host.variable(0x17)) == (3, 3)


def test_a_remote_40_us_slower_than_at_chatter_still_works() -> None:
    host, remote = running()
    remote.turnaround_us = 36.0
    assert host.command(DOIT | 1) == US(115, abs=4)
    assert (host.read(DATA), host.cs()) == (0, 0x420000)


def test_answers_later_than_the_timeout_are_taken_out_of_phase() -> None:
    host, remote = running()
    remote.turnaround_us = 120.0
    results = [host.result(DOIT | 1) for _ in range(8)]
    assert results[0] == 1
    assert 0 in results, "a late answer is accepted by a later DOIT"
    assert host.cs() & 0x08


def test_the_inputs_are_taken_when_the_frame_is_sent() -> None:
    host, remote = running()
    host.write(IF0, 0x11111111)
    host.begin(DOIT | 1)
    host.board.advance(20)
    host.write(IF0, 0x22222222)
    assert host.finish() is not None
    assert remote.outputs[:4] == b"\x11" * 4


def test_faults_of_the_remote_do_not_count() -> None:
    host, remote = running()
    remote.fault = 0x08
    for _ in range(25):
        assert host.result(DOIT | 1) == 0
        assert host.cs() == 0x08422140
    assert (host.variable(0x1A), host.variable(0x25)) == (0, 8)
    remote.fault = 0
    host.result(DOIT | 1)
    assert host.cs() == 0x00422140


# -- chatter


def test_chatter_sends_zeros_until_the_first_doit() -> None:
    host, remote = running(doit=False)
    host.write(IF0, 0xFFFFFFFF)
    host.port.take_line_bytes()
    host.board.advance(1000)
    sent = [b for b in host.port.take_line_bytes() if b.to_remote]
    starts = [b.start_us for b in sent if b.value == 0xBD]
    assert {b.value for b in sent} == {0xBD, 0x00, 0xBB}
    assert starts[1] - starts[0] == US(82.5, abs=0.5)
    assert remote.outputs == bytes(6)
    assert host.read(IF0) == 0x12345678, "still the unit number"
    took = host.command(DOIT | 1)
    assert took is not None
    assert 80 <= took <= 170
    host.port.take_line_bytes()
    host.board.advance(1000)
    assert host.port.take_line_bytes() == []


def test_channels_not_named_keep_chattering() -> None:
    host, _ = running(doit=False)
    host.attach(2, receive_size=5, transmit_size=4)
    host.result(START | 4)
    host.result(DOIT | 1)
    host.port.take_line_bytes()
    host.board.advance(500)
    assert {b.channel for b in host.port.take_line_bytes()} == {2}
    assert chatters(host.cs(2)) == 0x3A0000


def test_faults_in_chatter_show_at_the_first_doit_only() -> None:
    host, remote = running(doit=False)
    remote.fault = 4
    host.board.advance(500)
    assert chatters(host.cs()) == 0x3A0000
    assert host.result(DOIT | 1) == 0
    assert host.cs() == 0x04422140


def test_the_run_timeout_is_loaded_by_the_first_doit() -> None:
    host, _ = running(doit=False)
    assert host.variable(0x23) == 200
    host.result(DOIT | 1)
    assert host.variable(0x23) == host.variable(0x30) + 20
    assert host.variable(0x30) in (39, 40)


def test_a_doit_that_meets_a_lost_chatter_answer_fails_and_the_next_works() -> None:
    host, remote = running(doit=False)
    host.board.advance(300)
    host.write(IF0, 0x04030201)
    remote.inject(skip=1)
    host.board.advance(90)
    took = host.command(DOIT | 1)
    assert took is not None
    assert 100 < took < 410
    assert host.read(DATA) == 1
    assert remote.outputs == bytes(6)
    assert chatters(host.cs()) == 0x3A2008
    assert host.result(DOIT | 1) == 0
    assert remote.outputs[:4] == bytes([1, 2, 3, 4])


def test_a_remote_that_vanishes_in_chatter_kills_it_for_good() -> None:
    host, remote = running(doit=False)
    remote.alive = False
    host.board.advance(8700)
    assert host.cs() == 0x003B2088
    host.port.take_line_bytes()
    remote.alive = True
    assert (host.command(DOIT | 1) or 999) <= 420
    assert host.read(DATA) == 1
    assert host.command(START | 1) == US(18, abs=3)
    assert host.read(DATA) == 0
    host.board.advance(2000)
    assert host.port.take_line_bytes() == []
    assert host.cs() == 0x003B2088
    host.result(STOP | 1)
    assert host.result(START | 1) == 0
    assert host.result(DOIT | 1) == 0


def test_an_answer_on_its_way_during_an_individual_stop_is_surplus() -> None:
    host, _ = running(doit=False)
    while not any(b.to_remote and b.value == 0xBB for b in host.port.take_line_bytes()):
        host.board.advance(0.5)
    host.board.advance(15)
    assert host.result(STOP | 1) == 0
    assert host.result(START | 1) == 0
    assert chatters(host.cs()) == 0x3A2010


# -- setup mode


def test_setup_access_times_and_results() -> None:
    host = Host()
    host.attach(0, memory={0x310 + i: i + 1 for i in range(8)})
    assert host.command(SETUP | 1) == US(1744, abs=6)
    for header, time, low, high in (
        (0x44, 35, 0x01, 0),
        (0x45, 40, 0x0201, 0),
        (0x46, 47, 0x04030201, 0),
        (0x47, 65, 0x04030201, 0x08070605),
    ):
        host.write(CS, header << 24 | 0x310)
        assert host.command(DOIT | 1) == US(time, abs=2)
        assert host.read(DATA) == 0
        assert host.inputs() == (low, high, 0x06400600)
    for header, time in ((0x64, 35), (0x65, 40), (0x66, 47), (0x67, 62)):
        host.write(CS, header << 24 | 0x200)
        assert host.command(DOIT | 1) == US(time, abs=2)
        assert host.inputs() == (0x04030201, 0x08070605, 0x06400600)
    host.write(CS, 0xDF << 24)
    assert host.command(DOIT | 1) == US(26.5, abs=2)
    assert host.read(IF0) == 0x5A


@pytest.mark.parametrize("header", [0x00, 0xBB, 0xBC, 0x85])
def test_setup_refuses_what_is_no_access(header: int) -> None:
    host = Host()
    host.attach(0)
    host.result(SETUP | 1)
    host.port.take_line_bytes()
    host.write(CS, header << 24)
    assert host.command(DOIT | 1) == US(3.5, abs=2)
    assert (host.read(DATA), host.cs()) == (1, 0x400000)
    assert host.port.take_line_bytes() == []


def test_setup_timeout() -> None:
    host = Host()
    remote = host.attach(0, memory={0x310: 7})
    host.result(SETUP | 1)
    host.access(0x44, 0x310)
    remote.alive = False
    host.write(CS, 0x44000310)
    assert host.command(DOIT | 1) == US(49850, abs=250)
    assert (host.read(DATA), host.cs(), host.read(IF0)) == (1, 0x402008, 7)
    remote.alive = True
    assert host.access(0x44, 0x310) == 0
    assert host.cs() == 0x402008


def test_two_channels_in_one_setup_doit() -> None:
    host = Host()
    host.attach(0, memory={0x310: 0x11})
    host.attach(1, memory={0x320: 0x22, 0x321: 0x33, 0x322: 0x44, 0x323: 0x55})
    host.result(SETUP | 3)
    host.write(CS, 0x44000310, 0)
    host.write(CS, 0x46000320, 1)
    assert host.command(DOIT | 3) == US(48, abs=4)
    assert (host.read(IF0, 0), host.read(IF0, 1)) == (0x11, 0x55443322)


def test_a_start_in_setup_mode_slows_the_timeouts_of_running_channels() -> None:
    host, remote = running()
    host.attach(1)
    host.result(SETUP | 2)
    remote.inject(skip=1)
    took = host.command(DOIT | 1)
    assert took is not None
    assert took > 8000
    assert host.read(DATA) == 1


# -- time


def test_a_minute_of_virtual_time_is_cheap() -> None:
    host, _ = running()
    for _ in range(60):
        host.board.advance(1e6)
    assert host.result(DOIT | 1) == 0
    assert host.read(COMMAND) == 0


def test_pins_not_switched_make_a_remote_absent() -> None:
    host = Host()
    remote = host.attach(0)
    host.port.attach(0, remote, through_pins=True)
    assert host.result(START | 1) == 1
    assert host.cs() == 0x0001E188
