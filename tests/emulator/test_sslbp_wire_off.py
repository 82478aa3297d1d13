"""Zero wire time: a command's whole effect has happened when its write returns; same rules."""

from __future__ import annotations

import time

import pytest

from tests.emulator.sslbp_host import (
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
    Host,
    chatters,
)


def do(host: Host, command: int) -> int:
    host.begin(command)
    assert host.read(COMMAND) == 0
    return host.read(DATA)


def started() -> Host:
    host = Host(wire="off")
    host.attach(0)
    assert do(host, STOP_ALL) == 0xAA
    assert do(host, START | 1) == 0
    return host


def test_power_up_and_local_reads() -> None:
    host = Host(wire="off")
    assert host.read(DATA) == 0xAA
    assert host.cs() == 0xC100
    assert do(host, READ | 3) == 43
    assert do(host, 0x0A00) == 0xFF


def test_start_and_process_data() -> None:
    host = started()
    assert chatters(host.cs()) == 0x3A0000
    assert host.inputs() == (0x12345678, 0x37374937, 0x06400600)
    host.write(IF0, 0x04030201)
    assert do(host, DOIT | 1) == 0
    assert host.cs() == 0x420000
    assert host.inputs() == (0x44332211, 0x88776655, 0)
    assert host.port.remote(0).outputs[:4] == bytes([1, 2, 3, 4])  # type: ignore[union-attr]


def test_stops_and_reset() -> None:
    host = started()
    assert do(host, STOP | 1) == 0
    assert host.cs() == 0xC100
    assert do(host, START | 1) == 0
    assert do(host, STOP_ALL) == 0xAA
    assert host.cs() == 0xC100
    do(host, START | 1)
    host.begin(RESET | 0x7FF)
    assert host.read(DATA) == 0xABCD
    host.begin(1)
    assert host.read(COMMAND) == 0
    assert (host.read(DATA), host.cs()) == (0xAA, 0xC100)
    assert do(host, START | 1) == 0


def test_absent_wrong_and_faulty_remotes() -> None:
    host = started()
    assert do(host, START | 2) == 2
    assert host.cs(1) == 0x0001E188
    assert do(host, STOP_ALL) == 0xAA
    remote = host.port.remote(0)
    assert remote is not None
    remote.fault, remote.fault_clears = 2, False  # type: ignore[attr-defined]
    assert do(host, START | 1) == 1
    assert host.cs() == 0x0224A1C0
    remote.fault, remote.fault_clears = 0, True  # type: ignore[attr-defined]
    assert do(host, START | 1) == 0
    assert do(host, DOIT | 1) == 0
    assert host.cs() == 0x004220C0


def test_errors_while_running() -> None:
    host = started()
    remote = host.port.remote(0)
    assert remote is not None
    assert do(host, DOIT | 1) == 0
    remote.inject(skip=1)  # type: ignore[attr-defined]
    assert do(host, DOIT | 1) == 1
    assert host.cs() == 0x422008
    assert do(host, DOIT | 1) == 0
    remote.fault = 4  # type: ignore[attr-defined]
    assert do(host, DOIT | 1) == 0
    assert host.cs() == 0x04422148
    remote.fault = 0  # type: ignore[attr-defined]
    remote.inject(bad_crc=1)  # type: ignore[attr-defined]
    assert do(host, DOIT | 1) == 1
    assert host.cs() & 0xFF == 0x49


def test_setup_accesses() -> None:
    host = Host(wire="off")
    host.attach(0, memory={0x310: 0x11, 0x311: 0x22})
    assert do(host, SETUP | 1) == 0
    assert host.cs() == 0x400000
    host.write(CS, 0x45000310)
    assert do(host, DOIT | 1) == 0
    assert host.read(IF0) == 0x2211
    host.write(CS, 0)
    assert do(host, DOIT | 1) == 1


def test_what_never_completes_stays() -> None:
    host = started()
    host.begin(0x1101)
    assert host.read(COMMAND) == 0x1101
    host.begin(STOP | 0xFF)
    assert host.read(COMMAND) == 0
    assert do(host, STOP_ALL) == 0xAA
    host.port.remote(0).clear_flag_busy_reads = 1_000_000_000  # type: ignore[union-attr]
    host.begin(START | 1)
    assert host.read(COMMAND) == START | 1
    host.port.remote(0).clear_flag_busy_reads = 0  # type: ignore[union-attr]
    host.board.advance(1)
    assert (host.read(COMMAND), host.read(DATA)) == (0, 0)


@pytest.mark.parametrize("model", ["8i20", "7i64"])
def test_remotes_that_predate_discovery(model: str) -> None:
    host = Host(wire="off")
    host.attach(0, name=model.upper(), model=model, receive_size=None, transmit_size=None)
    host.port.remote(0).inputs = bytes([1, 0, 0, 0, 0xB0, 0xB1, 0x70, 0x71])  # type: ignore[union-attr]
    assert do(host, START | 1) == 0
    assert do(host, DOIT | 1) == 0
    assert host.cs() >> 16 == (0x3C if model == "8i20" else 0x3E)


def test_eight_channels_cycle() -> None:
    host = Host(8, wire="off")
    for channel in range(8):
        host.attach(channel, receive_size=5, transmit_size=2)
    assert do(host, START | 0xFF) == 0
    for _ in range(100):
        assert do(host, DOIT | 0xFF) == 0
    assert [host.cs(channel) for channel in range(8)] == [0x420000] * 8
    begin = time.perf_counter()
    for _ in range(1000):
        host.begin(DOIT | 0xFF)
    assert time.perf_counter() - begin < 5, "no busy waiting anywhere"
