"""Lines that carry whole LBP commands: framing and checksums of a serial line are settled here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from hostmot2.lbp.errors import LineSilent, NotLbp, WrongAnswer
from hostmot2.lbp.frame import COOKIE, RESET_PARSER, Command, crc8
from hostmot2.lbp.stream import Stream
from hostmot2.registers import LbpCookie

NORMAL_S = 0.1
"""An ordinary command is answered within this (lbp_serial.md 2)."""

SILENCE_S = 0.006
SILENCE_BITS = 400
"""Both longer than the gap timer of set-up mode (255 bit times, 2.2 ms): the remote listens afresh."""

BITS_PER_BYTE = 10
QUIET_BYTES = 2
"""A line that stays silent for so many characters has finished its answer."""


@dataclass(slots=True)
class LineCounters:
    """What a line showed since it was opened."""

    commands: int = 0
    silent: int = 0
    short: int = 0
    surplus: int = 0
    bad_crc: int = 0
    stale: int = 0
    refused: int = 0
    resyncs: int = 0

    @property
    def errors(self) -> int:
        """Everything that is not as it should be."""
        return self.silent + self.short + self.surplus + self.bad_crc + self.stale + self.refused


class Link(Protocol):
    """Carries one command to one remote and its answer back, without checksums; asks once only."""

    url: str
    counters: LineCounters
    crc: bool

    def open(self) -> None:
        """Find the remote; learn whether it checks CRCs. Raises LineSilent, NotLbp."""
        ...

    def transact(self, command: Command, timeout_s: float = NORMAL_S) -> bytes:
        """The answer's data, exactly as many bytes as expected. Raises LineSilent, WrongAnswer."""
        ...

    def settle(self) -> None:
        """After a failure: silence, and an empty input, so that the next answer is the next command's."""
        ...

    def resync(self) -> None:
        """After a failure: make the remote forget what it half heard, and forget what it half said."""
        ...

    def close(self) -> None:
        """Give the line back."""
        ...


class WireLink:
    """A link over a line of bytes: serial port, USB chip, or a remote in this process."""

    def __init__(self, stream: Stream) -> None:
        self.stream = stream
        self.url = stream.url
        self.counters = LineCounters()
        self.crc = True
        """Whether commands and answers carry a CRC. Without one, commands that read nothing go unanswered."""

    def open(self) -> None:
        """Cookie with CRC, then without: old firmware may have it switched off (lbp_serial.md 2)."""
        heard = b""
        for crc in (True, True, False, False, True):
            self.crc = crc
            self.resync()
            self.stream.send(self._framed(COOKIE.data))
            answer = self.stream.receive(2 if crc else 1, NORMAL_S)
            heard += answer
            data = answer[:1]
            whole = len(answer) == (2 if crc else 1) and not (crc and crc8(answer))
            if whole and data[0] == LbpCookie.VALUE and not self._surplus():
                return
        self.crc = True
        if heard:
            raise NotLbp(
                f"{self.url}: {heard.hex(' ')} was heard, not LBP's cookie 5A",
                expected=LbpCookie.VALUE,
                received=heard[0],
            )
        raise LineSilent(f"{self.url}: nothing answers at {self.stream.baud} baud, with and without CRC")

    def transact(self, command: Command, timeout_s: float = NORMAL_S) -> bytes:
        """See Link.transact."""
        self.counters.commands += 1
        stale = self.stream.flush()
        if stale:
            self.counters.stale += 1
            raise WrongAnswer(f"{self.url}: {stale} bytes came that nobody asked for")
        self.stream.send(self._framed(command.data))
        expected = command.reply + (1 if self.crc else 0)
        on_the_line_s = (len(command.data) + 1 + expected) * BITS_PER_BYTE / self.stream.baud
        answer = self.stream.receive(expected, timeout_s + on_the_line_s) if expected else b""
        if expected and not answer:
            self.counters.silent += 1
            raise LineSilent(f"{self.url}: no answer to {command} within {timeout_s:g} s")
        if len(answer) < expected:
            self.counters.short += 1
            raise WrongAnswer(f"{self.url}: {len(answer)} of {expected} bytes answered {command}")
        if self.crc and crc8(answer):
            self.counters.bad_crc += 1
            raise WrongAnswer(f"{self.url}: {answer.hex(' ')} answered {command}, its CRC is wrong")
        if self._surplus():
            self.counters.surplus += 1
            raise WrongAnswer(f"{self.url}: more than {expected} bytes answered {command}")
        return answer[: command.reply]

    def _framed(self, data: bytes) -> bytes:
        return data + bytes([crc8(data)]) if self.crc else data

    def _surplus(self) -> bool:
        return bool(self.stream.receive(1, QUIET_BYTES * BITS_PER_BYTE / self.stream.baud))

    def settle(self) -> None:
        """See Link.settle."""
        self._be_silent()
        self.stream.flush()

    def _be_silent(self) -> None:
        self.stream.pause(max(SILENCE_S, SILENCE_BITS / self.stream.baud))

    def resync(self) -> None:
        """Silence that ends any frame, the parser reset, silence again, and an empty input."""
        self.counters.resyncs += 1
        self._be_silent()
        self.stream.send(RESET_PARSER)
        self._be_silent()
        self.stream.flush()

    def close(self) -> None:
        """Close the stream."""
        self.stream.close()

    def __str__(self) -> str:
        return self.url
