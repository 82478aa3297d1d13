"""A run of the benchmarks as a page of the documentation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hostmot2.bench.report import Report, Section

HEAD = """# Performance

Written by `python -m hostmot2.bench --page docs/reference/performance.md` on the machine below; `make bench`
prints the same for yours. Others' work is measured in the same process and run, in turns, and compared round
by round: such ratios survive a busy machine where times do not. [Measure](../how-to/measure.md) says how,
also on a card of your own.
"""


def page(reports: Sequence[Report], facts: Mapping[str, str], scheduling: str) -> str:
    """The whole page, Markdown."""
    parts = [HEAD, _facts(facts, scheduling), "## Goals", _goals(reports)]
    for report in reports:
        parts.append(f"## {report.name}")
        parts += [_grid(["", "ns", f"x {s.reference}"], _section(s), s.title) for s in report.sections]
        parts += [_grid(*_table(table.cells()), table.title) for table in report.all_tables()]
        if report.histograms:
            parts.append(_histograms(report))
        parts += [f"* {note}" for note in report.notes]
        parts += [f"* **Left out:** {reason}" for reason in report.left_out]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _facts(facts: Mapping[str, str], scheduling: str) -> str:
    shown = {key: value for key, value in facts.items() if value != "not installed"}
    return "; ".join(f"{key} {value}" for key, value in {**shown, "scheduling": scheduling}.items()) + "."


def _grid(head: Sequence[str], rows: Sequence[Sequence[str]], title: str = "") -> str:
    lines = [f"{title}:\n"] if title else []
    lines += [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    lines += [f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows]
    return "\n".join(lines)


def _table(cells: Sequence[Sequence[str]]) -> tuple[Sequence[str], Sequence[Sequence[str]]]:
    return cells[0], cells[1:]


def _goals(reports: Sequence[Report]) -> str:
    goals = [(report.name, goal) for report in reports for goal in report.goals]
    rows = [
        [
            name,
            goal.text,
            f"{goal.value:.3g}",
            f"{goal.sign} {goal.limit:g}",
            "" if goal.of_limit is None else f"{goal.of_limit:.2f}",
            "met" if goal.met else "**missed**",
        ]
        for name, goal in goals
    ]
    head = ["", "goal", "here", "limit", "of limit", ""]
    missed = [f"* Missed: {g.text}. {g.why}".strip() for _, g in goals if not g.met]
    return "\n\n".join([_grid(head, rows), "\n".join(missed)])


def _section(section: Section) -> list[list[str]]:
    reference = section.timings[section.reference]
    return [
        [name, f"{timing.ns:.2f}", f"{reference.times_faster_than(timing):.4g}"]
        for name, timing in section.timings.items()
    ]


def _histograms(report: Report) -> str:
    keys = ("min_ns", "p50_ns", "p99_ns", "p99.9_ns", "max_ns")
    rows = [
        [name, str(len(h)), *(f"{h.summary()[key] / 1000:.2f}" for key in keys)]
        for name, h in report.histograms.items()
        if len(h)
    ]
    return _grid(["us", "count", "min", "p50", "p99", "p99.9", "max"], rows, "Distributions")
