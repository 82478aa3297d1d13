"""python -m tests.faults [--most N] [--pairs N] [--workers N] [-o FILE]

Every fault at every step of every operation (--most: at so many steps of each kind), then pairs of faults.
Prints what was tried and what came of it; -o writes it as JSON for docs/generate_promises.py.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

TESTS = str(Path(__file__).resolve().parent.parent)
if TESTS not in sys.path:
    sys.path.insert(0, TESTS)

from faults import command  # noqa: E402
from faults.enumeration import Group, Tally, groups, pairs, run_all, run_pairs, tabulate  # noqa: E402
from faults.layers import LAYERS  # noqa: E402


def _steps(found: list[Group]) -> list[dict[str, Any]]:
    """How many steps there are at each place, as counted, and how many of them are tried with each fault."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for group in found:
        key = (group.the_operation.name, str(group.place))
        rows[key] = {"operation": key[0], "place": key[1], "steps": group.total, "tried": len(group.steps)}
    return list(rows.values())


def _figures(tally: Tally) -> dict[str, Any]:
    return {
        "runs": tally.runs,
        "reached": tally.reached,
        "recovered": tally.recovered,
        "errors": dict(tally.errors.most_common()),
        "wrong": tally.wrong,
    }


def _command(arguments: argparse.Namespace) -> str:
    """What makes these figures again."""
    options = {"--most": arguments.most, "--pairs": arguments.pairs, "--only": arguments.only}
    return " ".join(
        ["python -m tests.faults", *(f"{name} {value}" for name, value in options.items() if value)]
    )


def _single(arguments: argparse.Namespace) -> dict[str, Any]:
    found = [g for g in groups(arguments.most) if arguments.only in f"{g.the_operation.name}, {g.place}"]
    steps = _steps(found)
    for row in steps:
        print(
            f"{row['operation']:<16} {row['place']:<26} {row['steps']:6} steps, {row['tried']} tried",
            flush=True,
        )
    table = tabulate(run_all(found, arguments.workers))
    rows = [
        {"operation": operation, "layer": layer, "fault": fault, **_figures(tally)}
        for (operation, layer, fault), tally in sorted(table.items())
    ]
    reasons = {layer.name: layer.reasons for layer in LAYERS}
    return {"steps": steps, "rows": rows, "reasons": reasons}


def _pairs(count: int, workers: int) -> list[dict[str, Any]]:
    tallies: dict[tuple[str, str], Tally] = {}
    for group, tally in run_pairs(pairs(count), workers):
        key = (next(group.cases()).operation.name, group.place.layer.name)
        tallies.setdefault(key, Tally())
        tallies[key] += tally
    return [{"operation": o, "layer": name, **_figures(t)} for (o, name), t in sorted(tallies.items())]


def main() -> int:
    """Runs them and prints what came of it."""
    parser = command.parser(__doc__)
    parser.add_argument("--most", type=int, help="at most so many steps of each kind; without: all")
    parser.add_argument("--pairs", type=int, default=0, help="runs with two faults")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", default="", help="operations and places whose names hold this")
    arguments = parser.parse_args()
    start = time.monotonic()
    result = {"command": _command(arguments), **_single(arguments)}
    result["pairs"] = _pairs(arguments.pairs, arguments.workers) if arguments.pairs else []
    rows = [*result["rows"], *result["pairs"]]
    for row in rows:
        classes = ", ".join(f"{name} {count}" for name, count in row["errors"].items())
        head = f"{row['operation']:<16} {row['layer']:<18} {row.get('fault', 'two'):<15}"
        print(f"{head} {row['runs']:5} runs {row['recovered']:5} good  {classes}")
    wrong = [text for row in rows for text in row["wrong"]]
    print("\n".join(wrong))
    print(f"{sum(r['runs'] for r in rows)} runs in {time.monotonic() - start:.0f} s, {len(wrong)} wrong")
    if arguments.output:
        arguments.output.write_text(json.dumps(result, indent=1))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
