"""What a benchmark found: tables for people, JSON for the next comparison."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from hostmot2.bench.rounds import Timing
from hostmot2.histogram import Histogram


@dataclass(frozen=True, slots=True)
class Goal:
    """A figure to reach: `value` at least or at most `limit`. why: what it is missed by, if it is."""

    text: str
    value: float
    limit: float
    at_least: bool = True
    why: str = ""

    @property
    def met(self) -> bool:
        """Whether it was reached in this run."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    @property
    def sign(self) -> str:
        """How the value has to stand to the limit."""
        return ">=" if self.at_least else "<="

    @property
    def of_limit(self) -> float | None:
        """How much of what is allowed was used: up to 1 is met. None where the limit is 0."""
        over, under = (self.limit, self.value) if self.at_least else (self.value, self.limit)
        return over / under if under else None

    def __str__(self) -> str:
        verdict = "met " if self.met else "MISS"
        return f"{verdict}  {self.text}: {self.value:.2f} (goal {self.sign} {self.limit:g})"


@dataclass(frozen=True, slots=True)
class Table:
    """Figures that are not compared: a name and a cell per column in each row; None: an empty cell."""

    title: str
    columns: Sequence[str]
    rows: Mapping[str, Sequence[float | None]]

    def cells(self) -> list[list[str]]:
        """The head and the rows as text."""
        numbers = {name: ["" if x is None else f"{x:.4g}" for x in row] for name, row in self.rows.items()}
        return [["", *self.columns], *([name, *row] for name, row in numbers.items())]

    def __str__(self) -> str:
        cells = self.cells()
        widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
        lines = ["  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in cells]
        return "\n".join([self.title, *(f"  {line.rstrip()}" for line in lines)])


@dataclass(frozen=True, slots=True)
class Curves:
    """Figures over something that grows: a value per line at each x."""

    title: str
    what: str
    unit: str
    x: Sequence[float]
    lines: Mapping[str, Sequence[float]]

    def table(self) -> Table:
        """The same in figures."""
        rows = {f"{x:g}": [values[i] for values in self.lines.values()] for i, x in enumerate(self.x)}
        return Table(f"{self.title}, {self.unit}, by {self.what}", list(self.lines), rows)


@dataclass(slots=True)
class Section:
    """One table: candidates that did the same work, against the one named `reference`."""

    title: str
    timings: Mapping[str, Timing]
    reference: str
    unit: str = "ns"

    def __str__(self) -> str:
        reference = self.timings[self.reference]
        width = max(len(name) for name in self.timings)
        lines = [f"{self.title}", f"  {'':{width}}  {self.unit:>12}  {'x ' + self.reference}"]
        for name, timing in self.timings.items():
            ratio = reference.times_faster_than(timing)
            lines.append(f"  {name:{width}}  {timing.ns:12.2f}  {ratio:.4g}")
        return "\n".join(lines)


@dataclass(slots=True)
class Report:
    """The outcome of one benchmark."""

    name: str
    sections: list[Section] = field(default_factory=list)
    goals: list[Goal] = field(default_factory=list)
    histograms: dict[str, Histogram] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    """What could not be measured here, each with its reason."""
    curves: list[Curves] = field(default_factory=list)

    def __str__(self) -> str:
        parts = [f"== {self.name} =="]
        parts += [str(section) for section in self.sections]
        parts += [str(table) for table in self.all_tables()]
        parts += [f"{name}\n  {histogram!r}" for name, histogram in self.histograms.items()]
        if self.goals:
            parts.append("goals\n" + "\n".join(f"  {goal}" for goal in self.goals))
        parts += [f"note: {note}" for note in self.notes]
        parts += [f"**** LEFT OUT: {reason}" for reason in self.left_out]
        return "\n\n".join(parts)

    def all_tables(self) -> list[Table]:
        """With those of the curves."""
        return [*self.tables, *(curves.table() for curves in self.curves)]

    def figures(self) -> dict[str, float]:
        """Every time of the report by a name that stays the same from run to run, in ns."""
        result = {
            f"{self.name}: {section.title}: {timing.name}": timing.ns
            for section in self.sections
            for timing in section.timings.values()
        }
        for name, histogram in self.histograms.items():
            summary = histogram.summary()
            result |= {
                f"{self.name}: {name}: {key}": value for key, value in summary.items() if key != "count"
            }
        return result

    def as_json(self) -> dict[str, Any]:
        """Everything, as JSON takes it."""
        return {
            "name": self.name,
            "figures_ns": self.figures(),
            "goals": [{**asdict(goal), "met": goal.met} for goal in self.goals],
            "histograms": {
                name: {**histogram.summary(), "buckets": [part.tolist() for part in histogram.buckets()]}
                for name, histogram in self.histograms.items()
            },
            "tables": [
                {"title": t.title, "columns": list(t.columns), "rows": dict(t.rows)}
                for t in self.all_tables()
            ],
            "notes": self.notes,
            "left_out": self.left_out,
        }


def document(reports: list[Report], host: dict[str, str], scheduling: str) -> dict[str, Any]:
    """The JSON document of a run."""
    return {"host": host, "scheduling": scheduling, "reports": [report.as_json() for report in reports]}


def goals_table(reports: Sequence[Report]) -> str:
    """Every goal of a run in one table, and below it what was missed and left out."""
    goals = [(report.name, goal) for report in reports for goal in report.goals]
    width = max((len(goal.text) for _, goal in goals), default=0)
    lines = [f"{'':8} {'':6} {'goal':{width}} {'value':>10}    {'limit':>8} {'of limit':>8}"]
    for name, goal in goals:
        verdict = "met" if goal.met else "MISSED"
        used = f"{goal.of_limit:8.2f}" if goal.of_limit is not None else ""
        row = (
            f"{name:8} {verdict:6} {goal.text:{width}} {goal.value:10.3f} {goal.sign} {goal.limit:8g} {used}"
        )
        lines.append(row.rstrip())
    lines += [f"missed: {goal.text}: {goal.why}" for _, goal in goals if not goal.met and goal.why]
    lines += [f"**** LEFT OUT: {reason}" for report in reports for reason in report.left_out]
    met = sum(goal.met for _, goal in goals)
    return "\n".join([*lines, f"{met} of {len(goals)} goals met"])


def earlier(old: Path) -> dict[str, Any]:
    """The document of an earlier run. ValueError: the file is none."""
    try:
        found = json.loads(old.read_text())
        for report in found["reports"]:
            report["figures_ns"].items(), report["histograms"].items()
    except (json.JSONDecodeError, KeyError, TypeError, AttributeError) as problem:
        raise ValueError(f"{old} is not a result of this benchmark: {problem}") from problem
    return dict(found)


def compare(reports: Sequence[Report], before: Mapping[str, Any]) -> str:
    """Every figure that an earlier run has, too, as new / old."""
    figures = {key: value for each in before["reports"] for key, value in each["figures_ns"].items()}
    lines = [f"new / old (of {before.get('host', {}).get('date', 'no date')})"]
    for report in reports:
        for key, value in report.figures().items():
            if figures.get(key):
                lines.append(f"  {value / figures[key]:6.2f}  {key}")
    return "\n".join(lines)
