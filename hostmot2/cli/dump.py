"""hm2 dump, diff: register images of a card."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from hostmot2 import dump as dumps
from hostmot2.cli.session import Session, reports, rows


@click.command()
@click.option(
    "-o", "output", type=click.Path(dir_okay=False, path_type=Path), required=True, help="The file to write."
)
@click.option("--side-effects", is_flag=True, help="Read FIFOs and the like, too: what is read is gone.")
@reports
def dump(session: Session, output: Path, side_effects: bool) -> None:
    """Write every readable register to a text file, which opens as dump://FILE."""
    with session.board() as board:
        taken = dumps.take(board, side_effects=side_effects)
    dumps.save(taken, output)
    left_out = f", {len(taken.omitted)} left out whose reading has side effects" if taken.omitted else ""
    document = {"file": str(output), "words": len(taken.words), "omitted": len(taken.omitted)}
    session.report(document, f"{output}: {len(taken.words)} words{left_out}")


@click.command()
@click.argument("left", type=click.Path(dir_okay=False, path_type=Path), metavar="A")
@click.argument("right", type=click.Path(dir_okay=False, path_type=Path), metavar="B")
@reports
def diff(session: Session, left: Path, right: Path) -> None:
    """Show the registers in which two dumps differ."""
    found = dumps.compare(dumps.load(left), dumps.load(right))
    lines = [(f"0x{each.address:04X}", _word(each.left), _word(each.right), each.name) for each in found]
    shown = rows(("address", str(left), str(right), "register"), lines) if lines else "no difference"
    session.report([asdict(each) for each in found], shown)


def _word(word: int | None) -> str:
    return "-" if word is None else f"0x{word:08X}"
