"""Histograms as a picture."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from hostmot2.bench.report import Report
from hostmot2.histogram import Histogram


def draw(reports: list[Report], target: Path) -> None:
    """Every histogram of the reports, one above the other. ValueError: there is none.

    Raises ImportError with advice if matplotlib is missing (`pip install hostmot2[plot]`).
    """
    histograms = {
        f"{each.name}: {name}": h for each in reports for name, h in each.histograms.items() if len(h)
    }
    if not histograms:
        raise ValueError("these benchmarks have no histogram to draw")
    draw_histograms(histograms, target)


def draw_histograms(histograms: dict[str, Histogram], target: Path) -> None:
    """Draw histograms that are not empty, with their percentiles, into a picture file."""
    try:
        figures = import_module("matplotlib.figure")
    except ImportError as problem:
        raise ImportError("pictures need matplotlib: pip install 'hostmot2[plot]'") from problem
    figure = figures.Figure(figsize=(9, 1 + 3 * len(histograms)), layout="constrained")
    axes = figure.subplots(len(histograms), squeeze=False)[:, 0]
    for axis, (name, histogram) in zip(axes, histograms.items(), strict=True):
        start, width, count = histogram.buckets()
        axis.bar(start / 1000, count, width / 1000, align="edge", color="tab:blue")
        axis.set(title=name, xlabel="microseconds", ylabel="cycles", xscale="log", yscale="log")
        for percent in (50.0, 99.0, 99.9):
            value = histogram.percentile(percent) / 1000
            axis.axvline(value, color="black", linewidth=0.8, linestyle="--")
            axis.annotate(f"p{percent:g}\n{value:.2f}", (value, 1), (2, 4), textcoords="offset points")
    figure.savefig(target)
