"""A line with noise: no wrong value is ever accepted, every failure is reported."""

from __future__ import annotations

import random

import pytest

from hostmot2.emulator import EmulatedRemote
from hostmot2.lbp import LbpError, LbpRemote, WireLink
from wire.lines import NoisyStream

OPERATIONS = 10_000
RATE = 0.01
SIZE = 0x400


def make_remote() -> tuple[EmulatedRemote, bytearray]:
    memory = bytearray(random.Random(7).randbytes(SIZE))
    remote = EmulatedRemote("7I77", 0x1234, memory=bytes(memory))
    remote.baud = 115200
    remote.timeout_bits = 255
    return remote, memory


def connect(remote: EmulatedRemote, seed: int, rate: float = RATE) -> tuple[LbpRemote, NoisyStream]:
    stream = NoisyStream(remote, rate, seed)
    for _ in range(20):
        try:
            return LbpRemote(WireLink(stream)), stream
        except LbpError:
            pass
    raise AssertionError("never found")


def test_ten_thousand_operations_at_one_percent() -> None:
    emulator, memory = make_remote()
    remote, stream = connect(emulator, 1)
    choose = random.Random(2)
    failed = 0
    for _ in range(OPERATIONS):
        size = choose.choice((1, 2, 4, 8))
        address = choose.randrange(SIZE - size)
        try:
            if choose.random() < 0.7:
                got = remote.read_bytes(address, size)
                assert got == memory[address : address + size], f"wrong value at {address:#x}"
            else:
                data = choose.randbytes(size)
                remote.write_bytes(address, data)
                assert remote.read_bytes(address, size) == data
                memory[address : address + size] = data
        except LbpError:
            failed += 1
            memory[:] = emulator.peek(0, SIZE)  # a reported write may or may not have been done
        if emulator.peek(0, SIZE) != memory:
            memory[:] = emulator.peek(0, SIZE)  # a misheard write elsewhere: nothing that a host can prevent
    counters = remote.link.counters
    assert stream.spoiled > 1000
    assert counters.errors > 1000
    assert failed < OPERATIONS // 100


@pytest.mark.parametrize("seed", range(5))
def test_hopeless_lines_end_in_errors(seed: int) -> None:
    emulator, memory = make_remote()
    remote, stream = connect(emulator, seed, 0.0)
    stream._rate = 0.4
    for address in range(20):
        try:
            assert remote.read_bytes(address, 8) == memory[address : address + 8]
        except LbpError:
            continue
