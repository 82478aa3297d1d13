"""What all commands share: which board, and how to report."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Concatenate, ParamSpec, TypeVar

import click
from rich.console import Console
from rich.table import Table
from rich.text import Text

import hostmot2
from hostmot2.board import Board
from hostmot2.default import BOARD_VARIABLE, EMULATED

P = ParamSpec("P")
R = TypeVar("R")


@dataclass
class Session:
    """The options before the command."""

    url: str | None = None
    as_json: bool = False
    verbose: bool = False
    document: str | None = None
    """What was reported with --json."""

    @contextmanager
    def board(self, *, read_only: bool = False) -> Iterator[Board]:
        """The board the user means, open; at the end it is closed, its outputs off unless it is read_only."""
        url, began = self.board_url(), time.monotonic()
        with hostmot2.open(url, read_only=read_only) as board:
            self.say(f"{url} open after {1e3 * (time.monotonic() - began):.1f} ms: {board!r}")
            yield board
        self.say(f"{url} closed" + ("" if read_only else ", outputs off"))

    def say(self, text: str) -> None:
        """With --verbose: what is done, on stderr."""
        if self.verbose:
            click.echo(f"hm2: {text}", err=True)

    def board_url(self) -> str:
        """--board, else $HM2_BOARD, else the emulated card, which is said on stderr."""
        url = self.url or os.environ.get(BOARD_VARIABLE)
        if not url:
            url = EMULATED
            click.echo(f"hm2: no --board and no ${BOARD_VARIABLE}: using the emulated card {url}", err=True)
        return url

    def report(self, document: Any, *shown: Table | str) -> None:
        """One JSON document with --json, else tables and lines.

        The document is printed when the command is through: a card may still be lost while it is closed, and
        the error is the document then.
        """
        if self.as_json:
            self.document = json.dumps(_numbers(document), indent=2, default=str, allow_nan=False)
            return
        console = _console()
        for item in shown:
            if isinstance(item, Table):
                console.print(item)
            else:
                click.echo(item)


def _numbers(document: Any) -> Any:
    """The document with null for NaN and infinities, which JSON does not have."""
    if isinstance(document, float):
        return document if math.isfinite(document) else None
    if isinstance(document, dict):
        return {key: _numbers(value) for key, value in document.items()}
    if isinstance(document, list | tuple):
        return [_numbers(value) for value in document]
    return document


def text_width() -> int:
    """Columns to wrap text to: the terminal's, and not more than is read well."""
    return min(shutil.get_terminal_size().columns, 110) if sys.stdout.isatty() else 110


def _console() -> Console:
    # a pipe has no width: never cut or wrap what a script reads
    width = None if sys.stdout.isatty() or "COLUMNS" in os.environ else 240
    return Console(width=width, highlight=False)


def rows(header: Sequence[str], lines: Sequence[Sequence[object]], title: str | None = None) -> Table:
    """A table; cells become text, None an empty one. Without a header: names and values."""
    table = Table(*header, title=title, title_justify="left", box=None, pad_edge=False)
    table.show_header = bool(header)
    for line in lines:
        table.add_row(
            *(cell if isinstance(cell, Text) else "" if cell is None else str(cell) for cell in line)
        )
    return table


def _set_json(context: click.Context, _parameter: click.Parameter, value: bool) -> None:
    if value:
        context.ensure_object(Session).as_json = True


def reports(command: Callable[Concatenate[Session, P], R]) -> Callable[P, R]:
    """Gives a command --json after its name, too, and the session as its first argument."""
    option = click.option(
        "--json", is_flag=True, expose_value=False, callback=_set_json, help="Print one JSON document."
    )
    return option(click.make_pass_decorator(Session, ensure=True)(command))


def number(maximum: int = 0xFFFFFFFF, multiple: int = 1) -> Callable[[str], int]:
    """The type of an argument written as people write registers: 0x0100, 256, 0b1."""

    def convert(text: str) -> int:
        try:
            value = int(text, 0)
        except ValueError:
            raise click.BadParameter(f"{text!r} is not a number such as 0x0100 or 256") from None
        if not 0 <= value <= maximum:
            raise click.BadParameter(f"{text} is outside 0..0x{maximum:X}")
        if value % multiple:
            raise click.BadParameter(f"{text} is not a multiple of {multiple}")
        return value

    convert.__name__ = "number"
    return convert


ADDRESS = number(0xFFFC, 4)
WORD = number()
MASK = number(0xFF)
