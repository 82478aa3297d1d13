"""Histograms as a picture: how times are distributed, and how heavy their tail is."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from hostmot2.bench.report import Curves, Report

Buckets = tuple[Any, Any, Any]
"""Starts and widths in ns, counts."""

PERCENTS = (50.0, 99.0, 99.9)


def draw(
    reports: Sequence[Report],
    target: Path,
    facts: Mapping[str, str] | None = None,
    before: Mapping[str, Any] | None = None,
) -> None:
    """A row per benchmark: left its distributions, right the part of cycles that took longer (log-log).

    Curves have a row of their own. facts stand below. before: the document of an earlier run, whose lines
    are dashed. ValueError: no benchmark has anything to draw. ImportError with advice if matplotlib is
    missing.
    """
    spread = [report for report in reports if any(len(h) for h in report.histograms.values())]
    grown = [report for report in reports if report.curves]
    if not spread and not grown:
        raise ValueError("these benchmarks have no histogram to draw")
    figure = new_figure((13, 1.2 + 4.2 * (len(spread) + len(grown))))
    rows = list(np.ravel(figure.subfigures(len(spread) + len(grown), 1)))
    for report in spread:
        lines = {name: h.buckets() for name, h in report.histograms.items() if len(h)}
        _draw_row(rows.pop(0).subplots(1, 2), report.name, lines, _old_lines(before, report.name))
    for report in grown:
        _draw_curves(rows.pop(0).subplots(1, len(report.curves), squeeze=False)[0], report.curves)
    if facts:
        figure.supxlabel("\n".join(textwrap.wrap(words(facts), 170)), fontsize="small")
    figure.savefig(target, dpi=110)


def new_figure(size: tuple[float, float]) -> Any:
    """An empty figure of matplotlib. ImportError with advice."""
    try:
        figures = import_module("matplotlib.figure")
    except ImportError as problem:
        raise ImportError("pictures need matplotlib: pip install 'hostmot2[plot]'") from problem
    return figures.Figure(figsize=size, layout="constrained")


def words(facts: Mapping[str, str]) -> str:
    """Facts about the machine in a line."""
    return ", ".join(f"{key} {value}" for key, value in facts.items() if value != "not installed")


def _old_lines(before: Mapping[str, Any] | None, name: str) -> dict[str, Buckets]:
    if before is None:
        return {}
    histograms = [each["histograms"] for each in before["reports"] if each["name"] == name]
    found = {key: one["buckets"] for each in histograms for key, one in each.items() if one.get("buckets")}
    return {key: (start, width, count) for key, (start, width, count) in found.items() if start}


def _draw_row(
    row: Sequence[Any], name: str, lines: Mapping[str, Buckets], old: Mapping[str, Buckets]
) -> None:
    spread, tail = row
    names = list(dict.fromkeys([*lines, *old]))
    for runs, style, mark in ((lines, "-", ""), (old, "--", "before: ")):
        for key, buckets in runs.items():
            color = f"C{names.index(key) % 10}"
            x, density = distribution(buckets)
            spread.step(x, density, style, where="post", color=color, linewidth=1)
            label = f"{mark}{key}\n{_percentiles(buckets)}"
            tail.step(*tail_of(buckets), style, where="post", color=color, label=label)
    spread.set(title=f"{name}: distribution", xlabel="us", ylabel="part of all per tenth of an octave")
    tail.set(title=f"{name}: part that took longer", xlabel="us", ylabel="part of all")
    for axis in row:
        axis.set(xscale="log", yscale="log")
        for kind in (axis.xaxis.set_major_formatter, axis.xaxis.set_minor_formatter):
            kind(import_module("matplotlib.ticker").LogFormatter(minor_thresholds=(1.5, 0.5)))
        axis.grid(visible=True, which="both", alpha=0.2)
    tail.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="x-small", frameon=False)


def _draw_curves(axes: Sequence[Any], curves: Sequence[Curves]) -> None:
    for axis, each in zip(axes, curves, strict=True):
        for name, values in each.lines.items():
            axis.plot(each.x, values, "o-", label=name, linewidth=1, markersize=4)
        axis.set(title=each.title, xlabel=each.what, ylabel=each.unit, ylim=(0, None))
        axis.grid(visible=True, alpha=0.3)
        axis.legend(fontsize="small", frameon=False)


def distribution(buckets: Buckets) -> tuple[Any, Any]:
    """Times in us and the part of all in each tenth of an octave, from there to the next time."""
    start, width, count = (np.asarray(part, float) for part in buckets)
    octaves = np.log2(np.maximum(start + width / 2, 1)) * 10
    first = int(np.floor(octaves[0]))
    parts = np.bincount((octaves - first).astype(int), count) / count.sum()
    parts = np.append(parts, 0.0)
    return 2 ** ((first + np.arange(len(parts))) / 10) / 1000, np.where(parts > 0, parts, np.nan)


def tail_of(buckets: Buckets) -> tuple[Any, Any]:
    """Times in us and the part of all that took longer, down to the longest of all."""
    start, width, count = (np.asarray(part, float) for part in buckets)
    longer = 1 - np.cumsum(count[:-1]) / count.sum()
    times = np.maximum(np.append(start[0], start + width), 1) / 1000
    return times, np.concatenate(([1.0], longer, longer[-1:] if len(longer) else [1.0]))


def _percentiles(buckets: Buckets) -> str:
    start, width, count = (np.asarray(part, float) for part in buckets)
    seen = np.cumsum(count) / count.sum() * 100
    at = [min(int(np.searchsorted(seen, percent)), len(start) - 1) for percent in PERCENTS]
    cells = [f"p{percent:g} {(start + width)[i] / 1000:.3g}" for percent, i in zip(PERCENTS, at, strict=True)]
    return ", ".join([*cells, f"max {(start + width)[-1] / 1000:.3g} us"])
