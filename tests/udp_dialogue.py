"""Dialogues of the UDP driver as text (tests/golden/udp/README.md), decoded by lbp16_reference alone."""

from __future__ import annotations

import difflib
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from lbp16_reference import Command, parse

GOLDEN = Path(__file__).parent / "golden" / "udp"
SPACES = ("hostmot2", "nic", "eeprom", "flash", "timer", "space5", "control", "board")
TIMER, SEQUENCE, PROBE = 4, 0x10, 0x14
"""Scratch words of the timer space where the driver keeps its numbers."""
NEAR = 0x10000
BYTES_PER_LINE = 16
TEXT_COLUMN = 46


@dataclass
class Numbers:
    """What the driver drew: its datagrams are n+1, n+2, .., its probes p+1, p+2, .."""

    n: int | None = None
    p: int | None = None

    def token(self, letter: str, data: bytes) -> str:
        """Four bytes as a number relative to what was drawn, or as they are."""
        base, (value,) = getattr(self, letter), struct.unpack("<I", data)
        distance = (value - base) % 2**32 if base is not None else NEAR
        return f"[{letter}+{distance}]" if distance < NEAR else data.hex()

    def bytes(self, text: str) -> bytes:
        """Hex with tokens, as bytes."""

        def hexadecimal(match: re.Match[str]) -> str:
            base = getattr(self, match[1])
            assert base is not None, f"{match[0]} before any number was sent"
            return struct.pack("<I", (base + int(match[2])) % 2**32).hex()

        return bytes.fromhex(re.sub(r"\[([np])\+(\d+)\]", hexadecimal, text))

    def learn(self, request: bytes) -> None:
        """The first number of each kind that is sent is the base plus one."""
        for command in parse(request):
            if command.write and command.space == TIMER and command.count == 2:
                (value,) = struct.unpack("<I", command.data)
                if command.address == SEQUENCE and self.n is None:
                    self.n = (value - 1) % 2**32
                if command.address == PROBE and self.p is None:
                    self.p = (value - 1) % 2**32

    def last(self, request: bytes) -> int | None:
        """The number of a datagram."""
        for command in parse(request):
            if command.write and command.space == TIMER and command.address == SEQUENCE:
                return int.from_bytes(command.data, "little")
        return None


@dataclass
class Datagram:
    """A request (>) or a reply (<), and the number in the file of the request that it is or answers."""

    kind: str
    number: int
    title: str = ""
    hex: str = ""
    lines: list[str] = field(default_factory=list)


@dataclass
class Dialogue:
    """A file: its comment, and what goes over the wire in that order."""

    comment: str
    datagrams: list[Datagram]


def load(name: str) -> Dialogue:
    """The dialogue of that name."""
    comment, datagrams = [], []
    for line in (GOLDEN / f"{name}.txt").read_text().splitlines():
        head = re.fullmatch(r"([<>]) (\d+) *(.*)", line)
        if head:
            datagrams.append(Datagram(head[1], int(head[2]), head[3]))
        elif line.startswith("#"):
            comment.append(line)
        elif line.strip():
            datagrams[-1].lines.append(line)
            datagrams[-1].hex += line.partition("|")[0].replace(" ", "")
    return Dialogue("\n".join(comment), datagrams)


def dump(dialogue: Dialogue) -> str:
    """The text of a file."""
    parts = [dialogue.comment, ""]
    for datagram in dialogue.datagrams:
        parts.append(f"{datagram.kind} {datagram.number} {datagram.title}".rstrip())
        parts += datagram.lines
    return "\n".join(parts) + "\n"


def request_lines(request: bytes, numbers: Numbers) -> list[str]:
    """A request: a line for each command, and more where its data does not fit beside it."""
    lines = []
    for command in parse(request):
        head = command.wire()[: 2 if command.address is None else 4]
        code, text = f"{head[:2].hex()} {head[2:].hex()}", _describe(command)
        rows = _rows(command, command.data, numbers)
        if len(rows) == 1:
            code, text, rows = f"{code} {rows[0][0]}", f"{text} = {rows[0][1]}", []
        lines.append(_line(code, text))
        lines += [_line(f"  {data}", f"= {words}") for data, words in rows]
    return lines


def reply_lines(request: bytes, reply: bytes, numbers: Numbers) -> list[str]:
    """A reply, in the pieces that the request's reads ask for."""
    lines = []
    for command in parse(request):
        if not command.write:
            size = command.count * command.size
            piece, reply = reply[:size], reply[size:]
            rows = _rows(command, piece, numbers)
            lines += [
                _line(data, f"= {words}" if i else f"{_place(command)} = {words}")
                for i, (data, words) in enumerate(rows)
            ]
    if reply:
        lines.append(_line(reply.hex(), "NOT ASKED FOR"))
    return lines


def _line(left: str, right: str) -> str:
    return f"  {left:<{TEXT_COLUMN}} | {right}".rstrip()


def _place(command: Command) -> str:
    address = "where it stands" if command.address is None else f"0x{command.address:04x}"
    return f"{SPACES[command.space]}{' info' if command.info else ''} {address}"


def _describe(command: Command) -> str:
    what = "write" if command.write else "read"
    still = "" if command.increment else ", the same address each time"
    size = f" {command.count} x {8 * command.size} bits" if command.count > 1 or still else ""
    return f"{what} {_place(command)}{size}{still}"


def _rows(command: Command, data: bytes, numbers: Numbers) -> list[tuple[str, str]]:
    """Hex and words: the driver's numbers one by one, everything else sixteen bytes a row."""
    rows = []
    for offset, size in _pieces(command, len(data)):
        piece = data[offset : offset + size]
        letter = _letter(command, offset)
        if letter and size == 4:
            token = numbers.token(letter, piece)
            name = "number of a datagram" if letter == "n" else "number of a probe"
            rows.append((token, name if token.startswith("[") else _words(piece, 4)))
        else:
            rows.append((_spaced(piece, command.size), _words(piece, command.size)))
    return rows


def _letter(command: Command, offset: int) -> str | None:
    if command.space != TIMER or command.address is None or command.count < 2:
        return None
    return {SEQUENCE: "n", PROBE: "p"}.get(command.address + offset)


def _pieces(command: Command, length: int) -> Iterator[tuple[int, int]]:
    offset = 0
    while offset < length:
        size = min(4 if _letter(command, offset) else BYTES_PER_LINE, length - offset)
        yield offset, size
        offset += size


def _spaced(data: bytes, size: int) -> str:
    return " ".join(data[i : i + size].hex() for i in range(0, len(data), size))


def _words(data: bytes, size: int) -> str:
    words = (data[i : i + size] for i in range(0, len(data), size))
    return " ".join(f"{int.from_bytes(word, 'little'):0{2 * size}x}" for word in words)


def difference(name: str, number: int, expected: list[str], got: list[str]) -> str:
    """What is wrong with a request, line by line."""
    names = f"{name}.txt, request {number}", "what the driver sent"
    return "\n".join(difflib.unified_diff(expected, got, *names, lineterm=""))
