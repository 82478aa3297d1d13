"""What every error of the package has: a code, evidence, likely causes, what to do."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Sequence
from typing import ClassVar

NUMBERS = ("address", "index", "expected", "received", "os_errno")
"""The numbers every error may carry."""
_INDENT = 12


class HostMot2Error(Exception):
    """Base of every error of this package: what, where, expected and received, likely causes, what to do.

    code: stable, "HM2-E0xx". causes: what is likely, the likeliest first. fix: what to do, a few sentences.
    An instance may know better than its class and say its own causes and fix, and give evidence beside the
    numbers as lines of text; those are part of str(). Everything is in `report()`.
    """

    code: ClassVar[str] = "HM2-E000"
    index_of: ClassVar[str] = "index"
    """What `index` counts: a channel, an instance, a pin."""
    causes: Sequence[str] = ("a case that no more precise error of this package stands for",)
    fix: str = "Read the message; `hm2 -v` shows what led to it."

    def __init__(
        self,
        message: str,
        *,
        address: int | None = None,
        index: int | None = None,
        expected: int | None = None,
        received: int | None = None,
        os_errno: int | None = None,
        evidence: Sequence[str] = (),
        causes: Sequence[str] = (),
        fix: str = "",
    ) -> None:
        super().__init__(message)
        self.address = address
        self.index = index
        self.expected = expected
        self.received = received
        self.os_errno = os_errno
        self.evidence = tuple(evidence)
        self.own_causes = tuple(causes)
        if causes:
            self.causes = self.own_causes
        if fix:
            self.fix = fix
        self.add_note(self._advice())  # a traceback shows it below the message

    @property
    def message(self) -> str:
        """What happened, without code and evidence."""
        return str(self.args[0]) if self.args else type(self).__name__

    def numbers(self) -> str:
        """The evidence that is numbers, in words: "at 0x0100, expected 0x55AACAFE, received 0".

        The C core has zeros where it has nothing to say: two that are compared and both 0 are left out.
        """
        words = []
        if self.address:
            words.append(f"at 0x{self.address:04X}")
        if self.index is not None:
            words.append(f"{self.index_of} {self.index}")
        compared = self.expected or self.received
        if self.expected is not None and compared:
            words.append(f"expected {_number(self.expected)}")
        if self.received is not None and compared:
            words.append(f"received {_number(self.received)}")
        if self.os_errno:
            words.append(f"errno {self.os_errno} ({os.strerror(self.os_errno)})")
        return ", ".join(words)

    def report(self, width: int = 100) -> str:
        """Everything, for people: what, evidence, likely causes in their order, what to do, where more is.

        Text is wrapped to `width` columns; evidence that is indented is a table and is not.
        """
        more = f"hm2 explain {self.code.removeprefix('HM2-')}"
        lines, seen = [f"{self.code} {type(self).__name__}: {self.message}"], []
        notes = [note for note in self.__notes__ if note != self._advice()]
        for line in (self.numbers(), *self.evidence, *notes):
            seen += [line] if line.startswith(" ") else wrapped([line], width)
        lines += _part("Evidence", seen)
        lines += _part("Likely", wrapped(numbered(self.causes), width))
        lines += _part("Do", wrapped([self.fix], width))
        return "\n".join([*lines, *_part("More", [more])])

    def _advice(self) -> str:
        return f"{self.fix}  (hm2 explain {self.code.removeprefix('HM2-')})"

    def __str__(self) -> str:
        lines = [f"{self.code}: {self.message}", *(f"  {line}" for line in self.evidence)]
        if self.own_causes:
            lines += ["Check in this order:", *(f"  {line}" for line in numbered(self.own_causes))]
        return "\n".join(lines)


def numbered(causes: Sequence[str]) -> list[str]:
    """The causes with their places; one alone has none."""
    if len(causes) < 2:
        return list(causes)
    return [f"{place}. {cause}" for place, cause in enumerate(causes, 1)]


def wrapped(lines: Sequence[str], width: int, indent: int = _INDENT) -> list[str]:
    """The lines as they fit behind `indent` columns, those of a report's names; the rest is indented."""
    room = max(width - indent, 40)
    wrap = textwrap.TextWrapper(room, subsequent_indent="   ", break_on_hyphens=False)
    return [part for line in lines for part in wrap.wrap(line)]


def _number(value: int) -> str:
    return str(value) if -10 < value < 10 else f"0x{value:X} ({value})"


def _part(name: str, lines: Sequence[str]) -> list[str]:
    heads = [f"{name}:", *[""] * len(lines)]
    return [f"  {head:<{_INDENT - 2}}{line}" for head, line in zip(heads, lines, strict=False)]


class EngineError(HostMot2Error):
    """The cycle engine cannot do that now: it has the board, or it does not run."""

    code = "HM2-E120"
    causes = (
        "the engine runs, and while it does the ports and the cycle are its own",
        "the engine was never started, or has been stopped",
        "it has been started: inputs, commands and controllers are added before that, to another one",
    )
    fix = "While an engine runs, exchange values with it (write, read, frames), or stop() it first."


class BitfileError(HostMot2Error):
    """An FPGA image file is broken or not for this card."""

    code = "HM2-E093"
    causes = (
        "the image is for another card of the family, or another FPGA on the same card",
        "the file was cut off or converted on its way here",
        "it is no image: neither Xilinx .bit nor Efinix .bin",
    )
    fix = "Take the image made for exactly this card; a wrong family bricks it."


class SserialError(HostMot2Error):
    """A smart-serial port, channel or remote failed."""

    code = "HM2-E020"
    index_of = "channel"
    causes: Sequence[str] = (
        "the cycle is shorter than the exchange with the slowest remote takes",
        "the port was left in a state this call does not fit",
    )
    fix = (
        "Print the port: it shows every channel, its counters() the errors on each line. stop() it, then "
        "start again."
    )
