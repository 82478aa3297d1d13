"""What the commands of this folder have alike: arguments, and how they tell what came of it."""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter
from pathlib import Path
from typing import Any


def parser(doc: str | None) -> argparse.ArgumentParser:
    """Of a module's documentation; it writes figures."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, help="the figures as JSON")
    return parser


def draws(doc: str | None, count: int, *, timed: bool = False) -> argparse.ArgumentParser:
    """The same for so many random runs, which may also end when a time is over."""
    draws = parser(doc)
    draws.add_argument("--count", type=int, default=count)
    draws.add_argument("--seed", type=int, default=1)
    if timed:
        draws.add_argument("--seconds", type=float, default=math.inf, help="no more begin after so long")
    return draws


def tell(result: Any, output: Path | None, **more: Any) -> int:
    """Print what came of them and write it as figures, with `more`. The exit status."""
    print(result)
    for text, number in Counter(result.wrong).most_common(20):
        print(number, text)
    if output:
        places = dict(result.places.most_common())
        figures = {**vars(result), **more, "places": places, "wrong": len(result.wrong)}
        output.write_text(json.dumps(figures))
    return 1 if result.wrong else 0
