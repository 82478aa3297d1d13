"""Writes docs/reference/errors/: a page for every error code, and their list, from the classes themselves.

What `hm2 explain CODE` prints and what these pages say has one source: docstring, causes and fix of a class.

    python docs/generate_errors.py [--check]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGES = ROOT / "docs" / "reference" / "errors"
sys.path.insert(0, str(ROOT))  # also where the package is not installed

from hostmot2.cli import catalogue, failure  # noqa: E402
from hostmot2.errors import NUMBERS, HostMot2Error  # noqa: E402
from hostmot2.sserial.checklist import checklist_of  # noqa: E402
from hostmot2.sserial.errors import NoRemote  # noqa: E402
from hostmot2.wiring import WIRING  # noqa: E402

GENERATED = "<!-- written by docs/generate_errors.py: change the class, then run it again -->"
GROUPS = (
    ("E00", "Everything"),
    ("E01", "Reaching the card"),
    ("E02", "Smart serial"),
    ("E03", "Smart serial"),
    ("E04", "Modules at work"),
    ("E05", "The card's description of itself"),
    ("E06", "The card's description of itself"),
    ("E07", "The card's description of itself"),
    ("E08", "Register dumps"),
    ("E09", "Ethernet cards and FPGA images"),
    ("E10", "LBP over a serial line"),
    ("E11", "Recordings"),
    ("E12", "The cycle engine"),
    ("E13", "Daughter cards"),
)
"""By the first digits of the code."""

EVIDENCE = {
    "address": "a register or memory address",
    "index": "which channel, instance, pin, descriptor or line",
    "expected": "the number that should have been there",
    "received": "the number that was there",
    "os_errno": "the operating system's reason",
}


def page(kind: type[HostMot2Error]) -> str:
    """The page of one error."""
    parts = [
        GENERATED,
        f"# {kind.code} {kind.__name__}",
        *_meaning(kind),
        "## Likely causes",
        _list(kind.causes),
    ]
    if kind is NoRemote:
        parts += _checklists()
    parts += ["## What to do", kind.fix, "## In programs", *_in_programs(kind)]
    return "\n\n".join(parts) + "\n"


def _meaning(kind: type[HostMot2Error]) -> list[str]:
    return [" ".join(paragraph.split()) for paragraph in catalogue.paragraphs(kind)]


def _list(causes: object) -> str:
    assert isinstance(causes, tuple | list)
    if len(causes) == 1:
        return f"* {causes[0]}"
    return "\n".join(f"{number}. {cause}" for number, cause in enumerate(causes, 1))


def _checklists() -> list[str]:
    parts = [
        "## Checklists from the cards' manuals",
        "Which remotes of a card do answer decides what to look at first. The exception and "
        "`hm2 sserial scan` choose the list by themselves; a scan also finds remotes whose set-up jumper "
        "is in place.",
    ]
    for card in WIRING.values():
        for situation, checks in checklist_of(card.name).items():
            parts += [f"### {card.name.upper()}: {situation}", _list(checks)]
    return parts


def _in_programs(kind: type[HostMot2Error]) -> list[str]:
    module = catalogue.public_module(kind)
    names = ", ".join(f"`{name}`" for name in catalogue.bases(kind))
    also = f" It is also caught as {names}." if names else ""
    code = failure.exit_code_of(kind)
    numbers = ", ".join(f"`{name}` ({EVIDENCE[name]})" for name in NUMBERS)
    return [
        f"`from {module} import {kind.__name__}`",
        f"`except {kind.__name__}` catches it.{also} At the prompt, `hm2` ends with status {code} "
        f"({catalogue.exit_meaning(kind)}).",
        f"Numbers, where they are known: {numbers}. `evidence`, `causes` and `fix` hold the text; `report()` "
        "is all of it.",
    ]


def index(kinds: list[type[HostMot2Error]]) -> str:
    """The list of all errors."""
    lines = [
        GENERATED,
        "",
        "# Errors",
        "",
        "Every error has a code that never changes. `hm2 explain CODE` prints the same as its page here, and "
        "`hm2 explain 0x00422088` tells what a smart-serial status word means.",
    ]
    for title in dict.fromkeys(name for _, name in GROUPS):
        prefixes = [prefix for prefix, name in GROUPS if name == title]
        rows = [kind for kind in kinds if catalogue.short(kind)[:3] in prefixes]
        lines += ["", f"## {title}", "", "| code | error | meaning |", "|---|---|---|"]
        lines += [
            f"| [{catalogue.short(kind)}]({catalogue.short(kind)}.md) | `{kind.__name__}` | {_cell(kind)} |"
            for kind in rows
        ]
    return "\n".join(lines) + "\n"


def _cell(kind: type[HostMot2Error]) -> str:
    return catalogue.meaning(kind).replace("|", "\\|")


def pages() -> dict[Path, str]:
    """Every file and its content."""
    kinds = catalogue.all_errors()
    grouped = {prefix for prefix, _ in GROUPS}
    lost = [kind.code for kind in kinds if catalogue.short(kind)[:3] not in grouped]
    if lost:
        raise SystemExit(f"no group for {', '.join(lost)}: add one to GROUPS")
    found = {PAGES / f"{catalogue.short(kind)}.md": page(kind) for kind in kinds}
    return {PAGES / "index.md": index(kinds), **found}


def main() -> int:
    """Writes the pages, or says which would change."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--check", action="store_true", help="fail if a page would change")
    check = parser.parse_args().check
    wanted = pages()
    there = set(PAGES.glob("*.md"))
    changed = [path for path, text in wanted.items() if path not in there or path.read_text() != text]
    surplus = there - wanted.keys()
    if check:
        for path in sorted({*changed, *surplus}):
            print(f"{path.relative_to(ROOT)} is not what its error says: run python docs/generate_errors.py")
        return 1 if changed or surplus else 0
    PAGES.mkdir(parents=True, exist_ok=True)
    for path in surplus:
        path.unlink()
    for path in changed:
        path.write_text(wanted[path])
    print(f"{len(wanted)} pages, {len(changed)} written, {len(surplus)} removed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
