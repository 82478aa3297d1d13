"""Starting channels on SSLBP 1.43: what the recordings do not hold (sserial.md 2.4, 3, SSLBP observed)."""

from __future__ import annotations

import pytest

from tests.emulator.sslbp_host import (
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


def started(channels: int = 4, **what: object) -> Host:
    host = Host(channels)
    host.attach(0, **what)
    host.result(STOP_ALL)
    return host


def frames(host: Host, to_remote: bool = True) -> list[str]:
    """Frames on channel 0 since the last call."""
    out: list[list[int]] = []
    end = -100.0
    for byte in sorted(host.port.take_line_bytes(), key=lambda b: b.start_us):
        if byte.channel == 0 and byte.to_remote == to_remote:
            if byte.start_us - end > 15 * byte.bit_us:
                out.append([])
            out[-1].append(byte.value)
            end = byte.start_us
    return [bytes(frame).hex(" ") for frame in out]


def test_two_channels_start_as_fast_as_one() -> None:
    host = started()
    host.attach(2, receive_size=5, transmit_size=4)
    assert host.command(START | 5) == US(992, abs=6)
    assert [chatters(host.cs(c)) for c in (0, 2)] == [0x3A0000] * 2


def test_the_largest_remote() -> None:
    host = started(receive_size=13, transmit_size=12)
    assert host.command(START | 1) == US(1075, abs=6)
    assert (host.command(DOIT | 1) or 999) <= 248
    assert host.command(DOIT | 1) == US(125, abs=4)


def test_eight_ports() -> None:
    host = started(8)
    assert host.command(START | 1) == US(1019, abs=6)
    host.command(DOIT | 1)
    assert host.command(DOIT | 1) == US(86.5, abs=4)


def test_starting_what_runs_or_nothing_or_what_does_not_exist() -> None:
    host = started()
    host.result(START | 1)
    host.result(DOIT | 1)
    frames(host)
    assert host.command(START | 1) == US(18, abs=2)
    assert host.read(DATA) == 0
    assert host.command(START) == US(20, abs=3)
    assert host.command(START | 0x80) == US(18, abs=2)
    assert host.read(DATA) == 0x80
    assert host.result(START | 0x81) == 0x80
    assert frames(host) == []
    assert host.cs() == 0x420000


def test_a_start_does_not_disturb_a_running_channel() -> None:
    host = started()
    host.attach(2, receive_size=5, transmit_size=4)
    host.result(START | 1)
    host.result(DOIT | 1)
    assert host.command(START | 4) == US(931, abs=8)
    assert host.cs(0) == 0x420000
    assert chatters(host.cs(2)) == 0x3A0000


def test_an_absent_channel_appearing_later_needs_another_start_and_keeps_its_sticky_bits() -> None:
    host = started()
    assert host.command(START | 4) == US(16970, abs=40)
    assert host.read(DATA) == 4
    assert host.cs(2) == 0x0001E188
    assert host.variable(0x17, 2) == 20
    host.attach(2, receive_size=5, transmit_size=4)
    host.board.advance(3000)
    assert host.cs(2) == 0x0001E188
    assert host.command(START | 4) == US(929, abs=8)
    assert host.read(DATA) == 0
    assert chatters(host.cs(2)) == 0x003A2088


def test_setup_start_with_an_absent_channel() -> None:
    host = started()
    assert host.command(SETUP | 3) == US(54600, abs=300)
    assert host.read(DATA) == 2
    assert (host.cs(0), host.cs(1)) == (0x400000, 0x0001E188)
    assert host.access(0x45, 0x600) == 0
    assert host.command(DOIT | 2) == US(3.4, abs=2)
    assert (host.read(DATA), host.cs(1)) == (0, 0x0001E188)


def test_a_wrong_cookie() -> None:
    host = started()
    host.port.remote(0).cookie = 0x55  # type: ignore[union-attr]
    assert host.command(START | 1) == US(9060, abs=30)
    assert (host.read(DATA), host.cs()) == (1, 0x0001E182)


def test_three_wrong_cookies() -> None:
    host = started()
    host.port.remote(0).bad_cookies = 3  # type: ignore[union-attr]
    assert host.command(START | 1) == US(2281, abs=8)
    assert host.read(DATA) == 0
    assert chatters(host.cs()) == 0x3A2002
    assert host.variable(0x15) == 3


def test_no_unit_number() -> None:
    host = started()
    host.port.remote(0).answers_unit_number = False  # type: ignore[union-attr]
    assert host.command(START | 1) == US(982, abs=4)
    assert (host.read(DATA), host.cs()) == (1, 0x000DE188)
    host.result(STOP_ALL)
    assert host.result(SETUP | 1) == 0
    assert host.cs() & 0xFFFF00 == 0x402000, "tolerated in setup mode"
    assert host.inputs()[1:] == (0x37374937, 0x06400600)


def test_no_discovery() -> None:
    host = started()
    host.port.remote(0).answers_discovery = False  # type: ignore[union-attr]
    assert host.result(SETUP | 1) == 0
    assert host.cs() & 0xFFFF00 == 0x402000
    assert host.inputs() == (0x12345678, 0x37374937, 0)
    host.result(STOP_ALL)
    assert host.result(START | 1) == 1


def test_a_fault_that_does_not_clear_and_then_does() -> None:
    host = started()
    remote = host.port.remote(0)
    assert remote is not None
    remote.fault, remote.fault_clears = 2, False  # type: ignore[attr-defined]
    assert host.command(START | 1) == US(1470, abs=8)
    assert (host.read(DATA), host.cs()) == (1, 0x0224A1C0)
    assert host.inputs() == (0x12345678, 0x37374937, 0x06400600)
    assert host.variable(0x1A) == 20
    remote.fault, remote.fault_clears = 0, True  # type: ignore[attr-defined]
    assert host.command(START | 1) == US(126, abs=4)
    assert host.read(DATA) == 0
    assert chatters(host.cs()) == 0x023A20C0
    assert host.result(DOIT | 1) == 0
    assert host.cs() == 0x004220C0


def test_the_old_fault_byte_stays_until_the_first_doit() -> None:
    host = started()
    remote = host.port.remote(0)
    assert remote is not None
    host.result(START | 1)
    host.result(DOIT | 1)
    remote.fault = 0x20  # type: ignore[attr-defined]
    host.result(DOIT | 1)
    assert host.cs() == 0x20422140
    remote.fault = 0  # type: ignore[attr-defined]
    host.result(STOP | 1)
    assert host.cs() == 0x2000C100
    host.result(START | 1)
    assert chatters(host.cs()) == 0x203A0000
    host.result(DOIT | 1)
    assert host.cs() == 0x00420000


def test_clear_faults_flag_that_stays_set_has_no_limit() -> None:
    host = started()
    host.port.remote(0).clear_flag_busy_reads = 1_000_000  # type: ignore[union-attr]
    assert host.command(START | 1, 4000) is None
    assert host.cs() & 0xFFFF == 0x8100
    host.port.remote(0).clear_flag_busy_reads = 0  # type: ignore[union-attr]
    assert host.finish() is not None
    assert host.read(DATA) == 0


def test_an_lbp_status_other_than_zero_costs_a_try() -> None:
    host = started()
    remote = host.port.remote(0)
    assert remote is not None
    host.begin(START | 1)
    while not any(b.value == 0xC1 and b.to_remote for b in host.port.take_line_bytes()):
        remote.lbp_status = 0x01  # type: ignore[attr-defined]
        host.board.advance(1)
    assert host.finish() is not None
    assert host.read(DATA) == 0
    assert chatters(host.cs()) & 0xFFFF == 0x2040
    assert host.variable(0x1A) >= 1


def test_the_mode_is_the_top_byte_of_cs_at_start_even_after_setup() -> None:
    host = started()
    remote = host.port.remote(0)
    host.write(CS, 0x03FFFFFF)
    host.result(START | 1)
    assert remote.software_mode == 3  # type: ignore[union-attr]
    host.result(STOP_ALL)
    host.result(SETUP | 1)
    host.access(0x45, 0x600)
    host.result(STOP_ALL)
    host.result(START | 1)
    assert remote.software_mode == 0x45  # type: ignore[union-attr]


def test_normal_start_after_setup_without_stop_stays_in_setup() -> None:
    host = started()
    host.result(SETUP | 1)
    assert host.command(START | 1) == US(18, abs=2)
    assert (host.read(DATA), host.cs()) == (0, 0x400000)


def test_a_lost_answer_in_a_start_step_starts_over() -> None:
    host = started()
    remote = host.port.remote(0)
    host.begin(START | 1)
    while not any(b.value == 0xBC and b.to_remote for b in host.port.take_line_bytes()):
        host.board.advance(1)
    host.board.advance(10)
    remote.inject(skip=2)  # type: ignore[union-attr]
    host.board.advance(30)
    frames(host)
    took = host.finish()
    assert took is not None
    assert "df 16" in frames(host)
    assert host.read(DATA) == 0
    assert chatters(host.cs()) == 0x3A2008


# -- 8I20


def the_8i20(**what: object) -> Host:
    host = Host()
    host.attach(0, name="8I20", model="8i20", unit_number=31, receive_size=None, transmit_size=None, **what)
    host.port.remote(0).inputs = bytes([1, 2, 0, 0, 0xB0, 0xB1, 0x70, 0x71])  # type: ignore[union-attr]
    host.result(STOP_ALL)
    return host


def test_8i20_start_sequence_and_result() -> None:
    host = the_8i20()
    host.write(CS, 0x03000000)
    assert host.command(START | 1) == US(1040, abs=5)
    sent = frames(host)
    assert sent[9:17] == [
        "65 54 08 ff ff 84",
        "45 54 08 8a",
        "45 52 08 20",
        "65 60 08 00 00 76",
        "65 04 08 ff ff 5c",
        "45 fe 08 83",
        "45 52 08 20",
        "65 5c 08 f4 01 d0",
    ]
    assert set(sent[17:]) == {"bd 00 00 00 00 a3"}
    assert host.read(DATA) == 0
    assert chatters(host.cs()) == 0x3A0000
    assert host.inputs() == (31, 0x30324938, 0)


def test_8i20_process_data() -> None:
    host = the_8i20()
    remote = host.port.remote(0)
    assert remote is not None
    host.result(START | 1)
    host.write(IF0, 0xABCD1234)
    host.result(DOIT | 1)
    assert remote.outputs == bytes([0x34, 0x12, 0xCD, 0xAB])  # type: ignore[attr-defined]
    assert host.command(DOIT | 1) == US(73.5, abs=3)
    assert (host.cs(), host.inputs()) == (0x3C0000, (0xB1B07170, 0x00000201, 0))
    remote.inputs = bytes([0, 0, 0, 1, 0, 0, 0, 0])  # type: ignore[attr-defined]
    assert host.result(DOIT | 1) == 0
    assert host.cs() == 0x3C0100
    remote.inputs = bytes(8)  # type: ignore[attr-defined]
    assert host.result(DOIT | 1) == 0
    assert host.cs() == 0x3C0100, "sticky"


def test_8i20_lost_answers_and_bad_crc() -> None:
    host = the_8i20()
    remote = host.port.remote(0)
    assert remote is not None
    host.result(START | 1)
    host.result(DOIT | 1)
    remote.inject(skip=1)  # type: ignore[attr-defined]
    assert host.command(DOIT | 1) == US(112, abs=4)
    assert (host.read(DATA), host.cs()) == (1, 0x3C2008)
    assert host.result(DOIT | 1) == 0
    remote.inject(bad_crc=1)  # type: ignore[attr-defined]
    assert host.result(DOIT | 1) == 1
    assert host.cs() == 0x3D2009
    host.board.advance(300)
    assert host.cs() == 0x3C2009
    assert host.result(DOIT | 1) == 0


def test_8i20_fault_at_the_first_check_is_read_once_and_needs_a_stop() -> None:
    host = the_8i20()
    remote = host.port.remote(0)
    assert remote is not None
    remote.fault_word, remote.fault_clears = 0x0104, False  # type: ignore[attr-defined]
    assert host.command(START | 1) == US(827, abs=3)
    assert (host.read(DATA), host.cs()) == (1, 0x052DA1C0)
    assert host.variable(0x1A) == 20
    remote.fault_word = 0  # type: ignore[attr-defined]
    assert host.command(START | 1) == US(18, abs=3)
    assert host.read(DATA) == 1
    assert host.result(DOIT | 1) == 0
    host.result(STOP | 1)
    assert host.result(START | 1) == 0
    assert chatters(host.cs()) == 0x3A0000, "its start clears the fault byte"


def test_8i20_fault_at_the_second_check() -> None:
    host = the_8i20()
    host.port.remote(0).fault_word_on_enable = 0x0100  # type: ignore[union-attr]
    assert host.command(START | 1) == US(980, abs=3)
    assert (host.read(DATA), host.cs()) == (1, 0x0037A1C0)


@pytest.mark.parametrize(
    ("knob", "states"), [("pid_off_reads", {0x32, 0x33, 0x34}), ("clear_flag_busy_reads", {0x29, 0x2A})]
)
def test_8i20_flags_are_polled_without_limit(knob: str, states: set[int]) -> None:
    host = the_8i20()
    remote = host.port.remote(0)
    setattr(remote, knob, 1_000_000)
    assert host.command(START | 1, 3000) is None
    assert host.cs() >> 16 in states
    assert host.cs() & 0xFFFF == 0x8100
    assert host.read(DATA) == 0xAA
    assert host.command(STOP | 0xFF, 10) is not None
    assert host.read(DATA) == 0xF0
    host.board.advance(2)
    assert host.result(STOP_ALL) == 0xAA


def test_8i20_silent_while_polled_falls_back_to_the_cookie() -> None:
    host = the_8i20()
    remote = host.port.remote(0)
    assert remote is not None
    remote.pid_off_reads = 1_000_000  # type: ignore[attr-defined]
    assert host.command(START | 1, 2000) is None
    remote.alive = False  # type: ignore[attr-defined]
    assert host.finish() == US(17000, abs=900)
    assert (host.read(DATA), host.cs()) == (1, 0x0001A188)
    assert host.inputs()[:2] == (31, 0x30324938)


def test_8i20_setup() -> None:
    host = the_8i20()
    assert host.command(SETUP | 1) == US(1670, abs=5)
    assert (host.read(DATA), host.cs(), host.inputs()[2]) == (0, 0x400000, 0)
    assert not any(frame.startswith(("bb", "e6", "e7", "bd")) for frame in frames(host))
    assert [host.variable(o) for o in (0x1D, 0x24, 0x2E, 0x2F, 0x23)] == [0x80, 0, 8, 4, 250]


# -- 7I64


def the_7i64() -> Host:
    host = Host()
    host.attach(0, name="7I64", model="7i64", receive_size=None, transmit_size=None)
    host.port.remote(0).inputs = bytes([0x10, 0x20, 0x30, 0xF7, 1, 2, 3, 4])  # type: ignore[union-attr]
    host.result(STOP_ALL)
    return host


def test_7i64_start_and_process_data() -> None:
    host = the_7i64()
    remote = host.port.remote(0)
    assert remote is not None
    assert host.command(START | 1) == US(814, abs=4)
    sent = frames(host)
    assert sent[9] == "bd 00 00 00 08 61"
    assert set(sent[10:]) == {"bd 00 00 00 00 a3"}
    assert chatters(host.cs()) == 0x3A0000
    assert host.inputs()[1:] == (0x34364937, 0)
    assert host.variable(0x1D) == 0x74
    host.write(IF0, 0xFFFFFFFF)
    host.result(DOIT | 1)
    assert remote.outputs == bytes([0xFF, 0xFF, 0xFF, 0])  # type: ignore[attr-defined]
    assert host.command(DOIT | 1) == US(70.7, abs=3)
    assert (host.cs(), host.inputs()) == (0x3E0000, (0x00302010, 0x04030201, 0))
    remote.fault_clears = False  # type: ignore[attr-defined]
    remote.inputs = bytes([0, 0, 0, 8, 0, 0, 0, 0])  # type: ignore[attr-defined]
    assert host.result(DOIT | 1) == 0
    assert host.cs() == 0x3E0100
    remote.inputs = bytes(8)  # type: ignore[attr-defined]
    host.result(DOIT | 1)
    assert host.cs() == 0x3E0100


def test_7i64_starts_with_its_watchdog_bitten() -> None:
    host = the_7i64()
    remote = host.port.remote(0)
    assert remote is not None
    remote.fault_clears = False  # type: ignore[attr-defined]
    remote.inputs = bytes([0, 0, 0, 8, 0, 0, 0, 0])  # type: ignore[attr-defined]
    assert host.result(START | 1) == 0
    assert chatters(host.cs()) == 0x3A0000
    host.result(DOIT | 1)
    assert host.cs() == 0x3E0100


def test_7i64_errors_and_setup() -> None:
    host = the_7i64()
    remote = host.port.remote(0)
    assert remote is not None
    host.result(START | 1)
    host.result(DOIT | 1)
    remote.inject(skip=1)  # type: ignore[attr-defined]
    assert host.command(DOIT | 1) == US(111.6, abs=4)
    assert (host.read(DATA), host.cs()) == (1, 0x3E2008)
    host.result(STOP_ALL)
    assert host.command(SETUP | 1) == US(1672, abs=5)
    assert (host.cs(), host.inputs()[2]) == (0x400000, 0)


def test_mixed_instance() -> None:
    host = Host()
    host.attach(0, name="8I20", model="8i20", receive_size=None, transmit_size=None)
    host.attach(1, name="7I64", model="7i64", receive_size=None, transmit_size=None)
    host.attach(2, receive_size=5, transmit_size=2)
    for channel in range(3):
        host.port.remote(channel).inputs = bytes(8)  # type: ignore[union-attr]
    host.result(STOP_ALL)
    assert host.command(START | 7) == US(1071, abs=8)
    host.result(DOIT | 7)
    assert host.command(DOIT | 7) == US(75, abs=4)
    assert [host.cs(c) for c in range(3)] == [0x3C0000, 0x3E0000, 0x420000]


# -- CRC flag and baud rate


def test_without_crc() -> None:
    host = started()
    host.port.remote(0).crc = False  # type: ignore[union-attr]
    host.write_local(0x8E, 0xFF)
    assert host.command(START | 1) == US(818, abs=6)
    sent = frames(host)
    assert "eb 28 e1 00 c1" in sent
    assert "e6 00 bb" in sent
    assert "e7 ff c7" in sent
    host.result(DOIT | 1)
    assert host.command(DOIT | 1) == US(76.5, abs=4)
    host.port.remote(0).inject(skip=1)  # type: ignore[union-attr]
    assert host.command(DOIT | 1) == US(112.9, abs=4)
    assert host.result(STOP_ALL) == 0xAA
    assert host.local(0x8E) == 0xFF
    assert host.command(SETUP | 1) == US(1623, abs=6)
    host.write(CS, 0x45000310)
    assert host.command(DOIT | 1) == US(31, abs=3)
    host.write(CS, 0x65000200)
    assert host.command(DOIT | 1) == US(6.6, abs=3)
    host.write(CS, 0x45000310)
    assert host.command(DOIT | 1) == US(45, abs=5)
    assert host.read(DATA) == 0


@pytest.mark.parametrize("flag", [0, 0xFF])
def test_crc_mismatch_looks_like_an_absent_device(flag: int) -> None:
    host = started()
    host.port.remote(0).crc = flag != 0  # type: ignore[union-attr]
    host.write_local(0x8E, flag)
    assert host.command(START | 1) == US(16970, abs=30)
    assert host.read(DATA) == 1
    assert host.cs() & 0xFFFF == 0xE188
    assert host.variable(0x14) == 0, "no CRC error is counted"


def test_baud_rate_is_loaded_by_stop_all_only() -> None:
    host = started()
    host.write_local(0x9A, 115200, 4)
    assert host.result(START | 1) == 0
    host.result(STOP | 1)
    assert host.result(START | 1) == 0
    host.port.remote(0).baud = 115200  # type: ignore[union-attr]
    host.result(STOP_ALL)
    assert host.command(SETUP | 1) == US(5950, abs=30)
    assert host.inputs() == (0x12345678, 0x37374937, 0x06400600)
    for header, time in ((0x44, 524), (0x45, 612), (0x47, 1134)):
        host.write(CS, header << 24 | 0x310)
        assert host.command(DOIT | 1) == US(time, abs=6)
    host.result(STOP_ALL)
    took = host.command(START | 1)  # the long tick of the setup mode is finished first
    assert took is not None
    assert 2335 < took < 2345 + 200
    assert (host.read(DATA), host.cs()) == (1, 0x000DE188)
    host.write_local(0x9A, 2500000, 4)
    host.port.remote(0).baud = 2500000  # type: ignore[union-attr]
    host.result(STOP_ALL)
    assert host.result(START | 1) == 0


def test_a_remote_at_another_baud_rate_is_absent() -> None:
    host = started()
    host.port.remote(0).baud = 115200  # type: ignore[union-attr]
    assert host.result(START | 1) == 1
    assert host.cs() & 0xFF == 0x88


def test_the_first_normal_start_after_setup_finishes_the_long_tick() -> None:
    host = started()
    host.result(SETUP | 1)
    host.result(STOP_ALL)
    took = host.command(START | 1)
    assert took is not None
    assert 980 < took < 992 + 200
