"""python -m tests.faults [--most N] [--workers N] [-o FILE]: every fault at every step."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

TESTS = str(Path(__file__).resolve().parent.parent)


def main() -> int:
    """Runs the enumeration and prints what came of it."""
    from faults.enumeration import groups, run_all, tabulate

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--most", type=int, help="at most so many steps of each kind; without: all")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", default="", help="operations and layers whose names hold this")
    arguments = parser.parse_args()
    start = time.monotonic()
    found = [g for g in groups(arguments.most) if arguments.only in f"{g.the_operation.name}, {g.place}"]
    for (operation, place), total in Counter(
        {(g.the_operation.name, str(g.place)): g.total for g in found}
    ).items():
        print(f"{operation:<16} {place:<26} {total:6} steps")
    table = tabulate(run_all(found, arguments.workers))
    wrong = [text for tally in table.values() for text in tally.wrong]
    for (operation, layer, fault), tally in sorted(table.items()):
        classes = ", ".join(f"{name} {count}" for name, count in tally.errors.most_common())
        print(
            f"{operation:<16} {layer:<18} {fault:<15} {tally.runs:5} runs {tally.recovered:5} good  {classes}"
            + (f"  WRONG {len(tally.wrong)}" if tally.wrong else "")
        )
    print("\n".join(wrong))
    runs = sum(tally.runs for tally in table.values())
    print(f"{runs} runs in {time.monotonic() - start:.0f} s, {len(wrong)} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.path.insert(0, TESTS)
    sys.exit(main())
