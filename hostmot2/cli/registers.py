"""hm2 peek, poke: registers by address, decoded where they are known."""

from __future__ import annotations

from typing import Any

import click

from hostmot2.cli.session import ADDRESS, WORD, Session, reports, rows
from hostmot2.decoding import Place, describe, places


@click.command()
@click.argument("address", type=ADDRESS, metavar="ADDR")
@click.argument("count", type=click.IntRange(1, 0x4000), default=1, metavar="[N]")
@reports
def peek(session: Session, address: int, count: int) -> None:
    """Read N words from byte address ADDR on.

    Some registers do something when they are read; that is said on stderr.
    """
    if address + 4 * count > 0x10000:
        raise click.UsageError(f"{count} words from 0x{address:04X} on reach beyond 0xFFFF")
    with session.board() as board:
        known = places(board.inventory)
        words = board.read_words(address, count)
    lines, document = [], []
    for index, word in enumerate(words):
        at = address + 4 * index
        here = known.get(at, ())
        _warn_of_reading(here)
        decoded = "  ".join(describe(place, word) for place in here if place.register.readable)
        lines.append((f"0x{at:04X}", f"0x{word:08X}", word, ", ".join(map(str, here)), decoded))
        document.append(_document(at, word, here))
    session.report(document, rows(("address", "word", "decimal", "register", "fields"), lines))


def _warn_of_reading(here: tuple[Place, ...]) -> None:
    for place in here:
        if place.register.read_effect:
            click.echo(f"hm2: reading {place}: {place.register.read_effect}", err=True)
        if not place.register.readable:
            click.echo(f"hm2: {place} is write-only, what it reads means nothing", err=True)


def _document(address: int, word: int, here: tuple[Place, ...]) -> dict[str, Any]:
    readable = [place for place in here if place.register.readable]
    return {
        "address": address,
        "word": word,
        "register": ", ".join(map(str, here)) or None,
        "fields": readable[0].register.decode(word) if readable else {},
    }


@click.command()
@click.argument("address", type=ADDRESS, metavar="ADDR")
@click.argument("value", type=WORD)
@click.option("--yes", is_flag=True, help="Really write: outputs may move machines.")
@reports
def poke(session: Session, address: int, value: int, yes: bool) -> None:
    """Write VALUE to the register at byte address ADDR. Needs --yes."""
    with session.board() as board:
        here = ", ".join(map(str, places(board.inventory).get(address, ()))) or "an unknown register"
        what = f"0x{value:08X} to 0x{address:04X} ({here})"
        if not yes:
            raise click.UsageError(f"this would write {what} of {board.url}; add --yes to do it")
        board.write(address, value)
    session.report({"address": address, "word": value, "register": here}, f"wrote {what}")
