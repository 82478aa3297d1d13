"""What a benchmark found: tables for people, JSON for the next comparison."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hostmot2.bench.rounds import Timing
from hostmot2.histogram import Histogram


@dataclass(frozen=True, slots=True)
class Goal:
    """A figure to reach: `value` at least or at most `limit`."""

    text: str
    value: float
    limit: float
    at_least: bool = True

    @property
    def met(self) -> bool:
        """Whether it was reached in this run."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    def __str__(self) -> str:
        sign = ">=" if self.at_least else "<="
        return f"{'met ' if self.met else 'MISS'}  {self.text}: {self.value:.2f} (goal {sign} {self.limit:g})"


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

    def __str__(self) -> str:
        parts = [f"== {self.name} =="]
        parts += [str(section) for section in self.sections]
        parts += [f"{name}\n  {histogram!r}" for name, histogram in self.histograms.items()]
        if self.goals:
            parts.append("goals\n" + "\n".join(f"  {goal}" for goal in self.goals))
        parts += [f"note: {note}" for note in self.notes]
        return "\n\n".join(parts)

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
            "goals": [
                {
                    "text": goal.text,
                    "value": goal.value,
                    "limit": goal.limit,
                    "at_least": goal.at_least,
                    "met": goal.met,
                }
                for goal in self.goals
            ],
            "histograms": {name: histogram.summary() for name, histogram in self.histograms.items()},
            "notes": self.notes,
        }


def document(reports: list[Report], host: dict[str, str], scheduling: str) -> dict[str, Any]:
    """The JSON document of a run."""
    return {"host": host, "scheduling": scheduling, "reports": [report.as_json() for report in reports]}


def compare(reports: list[Report], old: Path) -> str:
    """Every figure that an earlier run has too, as new / old. ValueError: not a document of this kind."""
    try:
        earlier = json.loads(old.read_text())
        before = {key: value for each in earlier["reports"] for key, value in each["figures_ns"].items()}
    except (json.JSONDecodeError, KeyError, TypeError) as problem:
        raise ValueError(f"{old} is not a result of this benchmark: {problem}") from problem
    lines = [f"new / old ({old}, {earlier.get('host', {}).get('date', 'no date')})"]
    for report in reports:
        for key, value in report.figures().items():
            if before.get(key):
                lines.append(f"  {value / before[key]:6.2f}  {key}")
    return "\n".join(lines)
