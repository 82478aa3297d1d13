"""Register dumps: a card's words in a text file, to be compared, sent to somebody, and opened again.

A line is `ADDRESS WORD` in hex, four and eight digits, then a name for the reader; a word of dashes says
that reading it would have had a side effect, so it was left out. Lines starting with # are comments;
`# key: value` carries a fact about the card. The first line is `# hm2dump 1`.

    # hm2dump 1
    # board: MESA5I25
    0100 55AACAFE  id cookie
    7600 --------  dpll sync: a sync event: samples the phase error
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from hostmot2 import errors
from hostmot2._core import lib
from hostmot2.address_map import registers_of
from hostmot2.whole_file import whole_file

if TYPE_CHECKING:
    from hostmot2.board import Board

FIRST_LINE = "# hm2dump 1"
MOST_BYTES = 1 << 23
"""Of a file; a dump of every word there can be has less than a quarter."""
_LINE = re.compile(r"([0-9A-Fa-f]{4})\s+([0-9A-Fa-f]{8}|-{8})(?:\s+(.*))?")
_FACT = re.compile(r"#\s*(\w+):\s*(.*)")


@dataclass(frozen=True)
class Dump:
    """Recorded words by address, why others were left out, the names of both, and facts about the card."""

    words: Mapping[int, int]
    omitted: Mapping[int, str] = field(default_factory=dict)
    names: Mapping[int, str] = field(default_factory=dict)
    facts: Mapping[str, str] = field(default_factory=dict)

    def idrom_words(self) -> list[int]:
        """The words of the IDROM from its offset on, as EmulatedBoard takes them; gaps are 0.

        Raises NotInDump if the dump has no ID block.
        """
        if 0x10C not in self.words:
            raise errors.NotInDump("the dump has no word at 0x010C, the IDROM offset", address=0x10C)
        start = self.words[0x10C] & 0xFFFF
        addresses = [address for address in self.words if start <= address < start + 0x400]
        return [self.words.get(address, 0) for address in range(start, max(addresses, default=start) + 4, 4)]


def take(board: Board, *, side_effects: bool = False) -> Dump:
    """Read everything of `board` that is known to be readable.

    Registers whose reading changes something (FIFOs, the DPLL's Sync) are left out unless `side_effects`.
    Raises TransportError if the card cannot be reached.
    """
    words: dict[int, int] = {}
    omitted: dict[int, str] = {}
    names: dict[int, str] = {}
    _take_tables(board, words)
    for at in registers_of(board.inventory):
        if not at.register.readable:
            continue
        names.setdefault(at.address, at.name)
        if at.register.read_effect and not side_effects:
            omitted[at.address] = at.register.read_effect
        elif at.address not in words:
            words[at.address] = board.read(at.address)
    facts = {
        "board": board.idrom.board_name,
        "source": board.url,
        "taken": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    return Dump(words, omitted, names, facts)


def _take_tables(board: Board, words: dict[int, int]) -> None:
    """The IDROM without gaps, as far as opening the dump will read it."""
    idrom = board.idrom
    end = idrom.address + idrom.pin_offset + 4 * idrom.io_width
    if idrom.module_offset > idrom.pin_offset:
        longest = 4 * lib.HM2_IDROM_MODULE_WORDS * lib.HM2_IDROM_MODULES_MAX
        end = max(end, idrom.address + idrom.module_offset + longest)
    end = min(end, lib.HM2_ADDRESS_SPACE)
    for index, word in enumerate(board.read_words(idrom.address, (end - idrom.address) // 4)):
        words[idrom.address + 4 * index] = word


def to_text(dump: Dump) -> str:
    """The dump as the text of a file."""
    lines = [FIRST_LINE, *(f"# {key}: {printable(value)}" for key, value in dump.facts.items())]
    for address in sorted({*dump.words, *dump.omitted}):
        name = dump.names.get(address, "")
        if address in dump.words:
            line = f"{address:04X} {dump.words[address]:08X}  {name}"
        else:
            line = f"{address:04X} --------  {name}: {dump.omitted[address]}"
        lines.append(line.rstrip())
    return "\n".join(lines) + "\n"


def printable(text: str) -> str:
    """Text from elsewhere, a broken IDROM's board name, say: it ends no line and steers no terminal."""
    return "".join(each if each.isprintable() else "?" for each in text)


def from_text(text: str) -> Dump:
    """The dump that `text` holds. Raises BrokenDump with the line number."""
    words: dict[int, int] = {}
    omitted: dict[int, str] = {}
    names: dict[int, str] = {}
    facts: dict[str, str] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if fact := _FACT.fullmatch(line):
            facts[fact[1]] = fact[2]
        if not line.strip() or line.startswith("#"):
            continue
        found = _LINE.fullmatch(line.rstrip())
        address = int(found[1], 16) if found else 1
        if not found or address % 4 or address in words or address in omitted:
            raise errors.BrokenDump(f"line {number} is no line of a dump: {line!r}", index=number)
        name, _, reason = (found[3] or "").partition(": ")
        if name:
            names[address] = name
        if found[2][0] == "-":
            omitted[address] = reason
        else:
            words[address] = int(found[2], 16)
    if not words and not omitted:
        raise errors.BrokenDump("no line of a dump is in it")
    return Dump(words, omitted, names, facts)


def save(dump: Dump, path: str | Path) -> None:
    """Write the dump to a file, whole or not at all."""
    with whole_file(path) as place:
        place.write_text(to_text(dump), encoding="utf-8")


def load(path: str | Path) -> Dump:
    """Read a dump from a file. Raises CardNotFound, PermissionDenied or BrokenDump, naming the file."""
    try:
        with Path(path).open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise errors.BrokenDump(f"a dump has at most {MOST_BYTES} bytes")
        return from_text(content.decode("utf-8"))
    except FileNotFoundError as error:
        raise errors.CardNotFound(f"{path}: there is no such file") from error
    except PermissionError as error:
        raise errors.PermissionDenied(f"{path}: this user may not read it") from error
    except UnicodeDecodeError as error:
        raise errors.BrokenDump(f"{path}: not a text file") from error
    except errors.BrokenDump as error:
        raise errors.BrokenDump(f"{path}: {error.args[0]}", index=error.index) from None


@dataclass(frozen=True, slots=True)
class Difference:
    """A word that differs between two dumps; None where one of them does not have it."""

    address: int
    name: str
    left: int | None
    right: int | None


def compare(left: Dump, right: Dump) -> list[Difference]:
    """The words in which two dumps differ, by address."""
    return [
        Difference(
            address,
            left.names.get(address) or right.names.get(address, ""),
            left.words.get(address),
            right.words.get(address),
        )
        for address in sorted({*left.words, *right.words})
        if left.words.get(address) != right.words.get(address)
    ]
