"""Bytes to and from a line: what a serial port, a USB chip and a remote in this process have in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol


class Stream(Protocol):
    """A line of bytes. `baud` is what it runs at, in bits per second."""

    url: str
    baud: int

    def send(self, data: bytes) -> None:
        """Hand over all bytes at once, without gaps between them."""
        ...

    def receive(self, count: int, timeout_s: float) -> bytes:
        """Up to `count` bytes; fewer when `timeout_s` have passed."""
        ...

    def flush(self) -> int:
        """Throw away what has come in; how many bytes that were."""
        ...

    def pause(self, seconds: float) -> None:
        """Let time pass in silence."""
        ...

    def close(self) -> None:
        """Give the line back. Harmless when done twice."""
        ...


class ExchangeStream:
    """A remote in this process, asked by whole frames: silence takes no time.

    exchange: a frame in, its answer out; b"" is silence.
    """

    def __init__(self, exchange: Callable[[bytes], bytes], url: str = "emu:") -> None:
        self.url = url
        self.baud = 115200
        self._exchange = exchange
        self._waiting = b""

    def send(self, data: bytes) -> None:
        """One frame; its answer waits to be received."""
        self._waiting += self._exchange(data)

    def receive(self, count: int, timeout_s: float) -> bytes:
        """What is there; more will not come."""
        taken, self._waiting = self._waiting[:count], self._waiting[count:]
        return taken

    def flush(self) -> int:
        """Throw away what has not been received."""
        count, self._waiting = len(self._waiting), b""
        return count

    def pause(self, seconds: float) -> None:
        """Nothing happens here by itself."""

    def close(self) -> None:
        """Nothing is held."""

    def __str__(self) -> str:
        return self.url
