"""Frames that pass the CRC and are wrong all the same are not believed."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lbp import crc8, with_crc

from hostmot2.emulator import EmulatedRemote
from hostmot2.emulator.serial_line import SerialLine
from hostmot2.lbp import LbpError, LbpRemote, WireLink, WrongAnswer
from hostmot2.lbp.frame import Command
from hostmot2.lbp.stream import ExchangeStream
from wire.lines import Recorder

MEMORY = bytes(random.Random(11).randbytes(0x400))


@pytest.fixture
def emulator() -> EmulatedRemote:
    remote = EmulatedRemote("7I77", memory=MEMORY)
    remote.baud = 115200
    return remote


class Bytewise:
    """The remote's byte path in virtual time; `spoil` changes what it hears."""

    url, baud = "bytes:", 115200

    def __init__(self, remote: EmulatedRemote) -> None:
        self.now_ns = 0
        self.line = SerialLine(remote, lambda: self.now_ns)
        self.waiting = b""

    def spoil(self, data: bytes) -> bytes:
        return data

    def send(self, data: bytes) -> None:
        heard = self.spoil(data)
        self.line.receive(heard)
        self.pause(len(heard) * 87e-6)

    def receive(self, count: int, timeout_s: float) -> bytes:
        if len(self.waiting) < count:
            self.pause(timeout_s)
        taken, self.waiting = self.waiting[:count], self.waiting[count:]
        return taken

    def flush(self) -> int:
        count, self.waiting = len(self.waiting), b""
        return count

    def pause(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)
        self.waiting += self.line.take()

    def close(self) -> None:
        pass


def test_a_command_obeyed_at_another_address_is_seen_in_the_status(emulator: EmulatedRemote) -> None:
    """A byte too many in `45 00 02 CRC` makes it a good read of another address for one byte in 256."""
    extra = next(x for x in range(256) if crc8(bytes([0x45, x, 0x00])) == 0x02)

    class Inserting(Bytewise):
        spoiled = 0

        def spoil(self, data: bytes) -> bytes:
            if data[:3] == b"\x45\x00\x02":
                self.spoiled += 1
                return data[:1] + bytes([extra]) + data[1:]
            return data

    stream = Inserting(emulator)
    remote = LbpRemote(WireLink(stream))
    with pytest.raises(LbpError):
        remote.read_bytes(0x0200, 2)
    assert stream.spoiled > 2
    assert remote.read_bytes(0x0210, 2) == MEMORY[0x210:0x212]


@pytest.mark.parametrize("which", [0, 1])
def test_a_wrong_answer_with_a_good_crc_is_outvoted(emulator: EmulatedRemote, which: int) -> None:
    class Lying(Recorder):
        reads = 0

        def send(self, data: bytes) -> None:
            super().send(data)
            if data[:1] == b"\x45":
                if self.reads == which:
                    self._waiting = with_crc(b"\x12\x34")
                self.reads += 1

    remote = LbpRemote(WireLink(Lying(emulator)))
    assert remote.read_bytes(0x0200, 2) == MEMORY[0x200:0x202]


def test_a_shifted_answer_is_told_by_its_surplus_byte(emulator: EmulatedRemote) -> None:
    class Shifting(Recorder):
        def send(self, data: bytes) -> None:
            super().send(data)
            if data[:1] == b"\x44":
                extra = next(x for x in range(256) if crc8(bytes([x])) == self._waiting[0])
                self._waiting = bytes([extra]) + self._waiting

    link = WireLink(Shifting(emulator))
    with pytest.raises(WrongAnswer, match="more than"):
        link.transact(Command(b"\x44\x00\x02", 1))


@settings(max_examples=300, deadline=None)
@given(st.lists(st.binary(max_size=12), max_size=60), st.sampled_from([1, 2, 4, 8]))
def test_whatever_is_answered_is_an_error_or_came_with_its_crc_twice(answers: list[bytes], size: int) -> None:
    """Random answers to everything behind the opening: a value is what two valid frames said."""
    queue = list(answers)
    emulator = EmulatedRemote("7I77", memory=MEMORY)
    said: list[bytes] = []

    def exchange(frame: bytes) -> bytes:
        if not opened:
            return emulator.exchange(frame)
        said.append(queue.pop(0) if queue else b"")
        return said[-1]

    opened = False
    remote = LbpRemote(WireLink(ExchangeStream(exchange)), tries=2)
    opened = True
    try:
        value = remote.read_bytes(0x0200, size)
    except LbpError:
        return
    assert said.count(with_crc(value)) >= 2
