"""hm2 dump, diff: register images of a card."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

import hostmot2
from hostmot2 import dump as dumps
from hostmot2.cli.session import Session, reports, rows


@click.command()
@click.option(
    "-o", "output", type=click.Path(dir_okay=False, path_type=Path), help="The file to write; else printed."
)
@click.option("--side-effects", is_flag=True, help="Read FIFOs and the like, too: what is read is gone.")
@reports
def dump(session: Session, output: Path | None, side_effects: bool) -> None:
    """Write every readable register as text, for bug reports.

    The file opens as a read-only board, --board dump://FILE, and as an emulated card with the same modules
    and pins, --board emu:///PATH. Registers whose reading changes something (FIFOs, the DPLL's Sync) are
    named but left out.

    \b
    Examples:
      hm2 dump -o before.hm2dump
      hm2 dump --side-effects -o all.hm2dump
    """
    with session.board() as board:
        taken = dumps.take(board, side_effects=side_effects)
    if output is None:
        session.report(_document(taken), dumps.to_text(taken).rstrip())
        return
    dumps.save(taken, output)
    left_out = f", {len(taken.omitted)} left out whose reading has side effects" if taken.omitted else ""
    document = {"file": str(output), "words": len(taken.words), "omitted": len(taken.omitted)}
    session.report(document, f"{output}: {len(taken.words)} words{left_out}")


def _document(taken: dumps.Dump) -> dict[str, object]:
    return {
        "facts": taken.facts,
        "words": {f"0x{address:04X}": word for address, word in sorted(taken.words.items())},
        "omitted": {f"0x{address:04X}": reason for address, reason in sorted(taken.omitted.items())},
    }


@click.command()
@click.argument("left", metavar="A")
@click.argument("right", metavar="B")
@reports
def diff(session: Session, left: str, right: str) -> None:
    """Show the registers in which A and B differ.

    A and B are dump files, or URLs of cards.

    \b
    Examples:
      hm2 diff before.hm2dump after.hm2dump
      hm2 diff before.hm2dump "emu://5i25+7i77?clock=virtual"
    """
    found = dumps.compare(_load(left), _load(right))
    lines = [(f"0x{each.address:04X}", _word(each.left), _word(each.right), each.name) for each in found]
    shown = rows(("address", left, right, "register"), lines) if lines else "no difference"
    session.report([asdict(each) for each in found], shown)


def _load(name: str) -> dumps.Dump:
    if "://" not in name:
        return dumps.load(name)
    with hostmot2.open(name) as board:
        return dumps.take(board)


def _word(word: int | None) -> str:
    return "-" if word is None else f"0x{word:08X}"
