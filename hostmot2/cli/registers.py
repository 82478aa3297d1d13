"""hm2 peek, poke: registers by address, decoded where they are known."""

from __future__ import annotations

from typing import Any

import click

from hostmot2.address_map import RegisterAt, registers_of
from hostmot2.cli.session import ADDRESS, WORD, Session, reports, rows
from hostmot2.inventory import Inventory


@click.command()
@click.argument("address", type=ADDRESS, metavar="ADDR")
@click.argument("count", type=click.IntRange(1, 0x4000), default=1, metavar="[N]")
@reports
def peek(session: Session, address: int, count: int) -> None:
    """Read N words from byte address ADDR on, decoded.

    Some registers do something when they are read; that is said on stderr.

    \b
    Examples:
      hm2 peek 0x0100 4
      hm2 --board pci:// --json peek 0x1000
    """
    if address + 4 * count > 0x10000:
        raise click.UsageError(f"{count} words from 0x{address:04X} on reach beyond 0xFFFF")
    with session.board() as board:
        known = _by_address(board.inventory)
        words = board.read_words(address, count)
    lines, document = [], []
    for index, word in enumerate(words):
        at = address + 4 * index
        here = known.get(at, ())
        _warn_of_reading(here)
        decoded = "  ".join(_fields(known_as, word) for known_as in here if known_as.register.readable)
        lines.append((f"0x{at:04X}", f"0x{word:08X}", word, _names(here), decoded))
        document.append(_document(at, word, here))
    session.report(document, rows(("address", "word", "decimal", "register", "fields"), lines))


def _by_address(inventory: Inventory) -> dict[int, tuple[RegisterAt, ...]]:
    found: dict[int, tuple[RegisterAt, ...]] = {}
    for at in registers_of(inventory):
        found[at.address] = (*found.get(at.address, ()), at)
    return found


def _names(here: tuple[RegisterAt, ...]) -> str:
    return ", ".join(known_as.name for known_as in here)


def _fields(at: RegisterAt, word: int) -> str:
    fields = (field for field in at.register.fields if field.readable)
    return " ".join(f"{field.name}={_value(field.get(word), field.width)}" for field in fields)


def _value(value: int, width: int) -> str:
    return str(value) if width <= 4 else f"0x{value:0{(width + 3) // 4}X}"


def _warn_of_reading(here: tuple[RegisterAt, ...]) -> None:
    for at in here:
        if at.register.read_effect:
            click.echo(f"hm2: reading {at.name}: {at.register.read_effect}", err=True)
        if not at.register.readable:
            click.echo(f"hm2: {at.name} is write-only, what it reads means nothing", err=True)


def _document(address: int, word: int, here: tuple[RegisterAt, ...]) -> dict[str, Any]:
    readable = [at for at in here if at.register.readable]
    return {
        "address": address,
        "word": word,
        "register": _names(here) or None,
        "fields": readable[0].register.decode(word) if readable else {},
    }


@click.command()
@click.argument("address", type=ADDRESS, metavar="ADDR")
@click.argument("value", type=WORD)
@click.option("--yes", is_flag=True, help="Really write: outputs may move machines.")
@reports
def poke(session: Session, address: int, value: int, yes: bool) -> None:
    """Write VALUE to the register at byte address ADDR. Needs --yes.

    Without --yes nothing is written and it says what would be.

    \b
    Examples:
      hm2 poke 0x1104 0x155
      hm2 poke 0x1104 0x155 --yes
    """
    with session.board() as board:
        here = _names(_by_address(board.inventory).get(address, ())) or "an unknown register"
        what = f"0x{value:08X} to 0x{address:04X} ({here})"
        if not yes:
            raise click.UsageError(f"this would write {what} of {board.url}; add --yes to do it")
        board.write(address, value)
    session.report({"address": address, "word": value, "register": here}, f"wrote {what}")
