"""Lines to emulated remotes for tests: in process, noisy, on a pseudo terminal."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hostmot2.emulator import DescribedRemote, EmulatedRemote, catalog
from hostmot2.emulator.serial_line import SerialLine
from hostmot2.lbp import ExchangeStream, LbpRemote, WireLink

ROOT = Path(__file__).resolve().parents[2]


def emulated(kind: str) -> DescribedRemote:
    return catalog.remote(kind, setup_jumper=True)


def connect(remote: EmulatedRemote, **options: int) -> LbpRemote:
    return LbpRemote(WireLink(ExchangeStream(remote.exchange)), **options)


class Recorder(ExchangeStream):
    """Writes down frames and answers."""

    def __init__(self, remote: EmulatedRemote) -> None:
        super().__init__(remote.exchange)
        self.frames: list[tuple[str, str]] = []
        self.remote = remote

    def send(self, data: bytes) -> None:
        answer = self.remote.exchange(data)
        self.frames.append((data.hex(" ").upper(), answer.hex(" ").upper()))
        self._waiting += answer


class NoisyStream:
    """The byte path of a remote, every byte of either direction flipped, lost or doubled now and then.

    Time is virtual: it passes with bytes, time-outs and pauses.
    """

    BYTE_NS = 86_806

    def __init__(self, remote: EmulatedRemote, rate: float, seed: int) -> None:
        self.url = "noisy:"
        self.baud = 115200
        self.now_ns = 0
        self._rate = rate
        self._random = random.Random(seed)
        self._line = SerialLine(remote, lambda: self.now_ns)
        self._waiting = b""
        self.spoiled = 0

    def _through(self, data: bytes) -> bytes:
        heard = bytearray()
        for byte in data:
            chance = self._random.random()
            if chance >= self._rate:
                heard.append(byte)
                continue
            self.spoiled += 1
            match self._random.randrange(3):
                case 0:
                    heard.append(byte ^ self._random.randrange(1, 256))
                case 1:
                    pass
                case _:
                    heard += bytes([byte, self._random.randrange(256)])
        return bytes(heard)

    def _pass(self, nanoseconds: int) -> None:
        self.now_ns += nanoseconds
        self._waiting += self._through(self._line.take())

    def send(self, data: bytes) -> None:
        heard = self._through(data)
        self._line.receive(heard)
        self._pass(len(heard) * self.BYTE_NS)

    def receive(self, count: int, timeout_s: float) -> bytes:
        end_ns = self.now_ns + round(timeout_s * 1e9)
        while len(self._waiting) < count and self.now_ns < end_ns:
            due_s = self._line.due_in_s()
            left = end_ns - self.now_ns
            self._pass(left if due_s is None else min(left, round(due_s * 1e9) + 1))
        taken, self._waiting = self._waiting[:count], self._waiting[count:]
        return taken

    def flush(self) -> int:
        self._pass(0)
        count, self._waiting = len(self._waiting), b""
        return count

    def pause(self, seconds: float) -> None:
        self._pass(round(seconds * 1e9))

    def close(self) -> None:
        pass


@contextmanager
def on_pty(kind: str, *options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """`hm2 emulate-remote KIND --pty` as a process of its own, and the path it printed."""
    code = "from hostmot2.cli import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, "emulate-remote", kind, "--pty", *options],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    try:
        assert process.stdout is not None
        word, path = process.stdout.readline().split()
        assert word == "ready"
        yield process, path
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=20)


def tell(process: subprocess.Popen[str], command: str) -> str:
    """A command to `hm2 emulate-remote`, and its answer."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(command + "\n")
    process.stdin.flush()
    return process.stdout.readline().strip()
