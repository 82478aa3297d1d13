"""What the generators of pages share: they make texts of files, which are written, or compared (--check)."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
sys.path.insert(0, str(ROOT))  # also where the package is not installed


def main(description: str, make: Callable[[], Mapping[str, str]], problems: Sequence[str] = ()) -> int:
    """Write the files that `make` gives by their path below docs/; with --check only say what would change.

    problems: what is wrong with what the pages name; nothing is written then. The result is the exit status.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--check", action="store_true", help="write nothing; fail if a page would change")
    check = parser.parse_args().check
    found = list(problems)
    for name, text in make().items():
        path = DOCS / name
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        if check:
            found.append(f"docs/{name} is not up to date: run {Path(sys.argv[0]).name}")
        elif not problems:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    for line in found:
        print(line)
    return 1 if found else 0


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    """A Markdown table."""
    lines = [f"| {' | '.join(header)} |", "|" + "---|" * len(header)]
    return [*lines, *(f"| {' | '.join(str(cell) for cell in row)} |" for row in rows)]
