"""A recording as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hostmot2.recording.export import columns_of
from hostmot2.recording.recording import Recording

POINTS = 2000  # per curve; of more cycles the smallest and the largest of each stretch are drawn
CURVES = 10  # per axes, for a legend that can be read


def plot(recording: Recording, path: str | Path, names: Sequence[str] = ()) -> None:
    """One axes per unit, below them how long cycles took. names: what to draw, all signals unless given.

    The suffix of `path` says the kind of picture. Raises KeyError for a name that is not there, ValueError
    for a recording without a record or a path without a suffix, ImportError with advice if matplotlib is
    missing.
    """
    if Path(path).suffix in ("", "."):  # matplotlib would write another file
        raise ValueError(f"{path}: the name must say what kind of picture: .png, .svg or .pdf")
    if not len(recording.records):
        raise ValueError(f"{recording.path} has no records")
    try:
        figures = import_module("matplotlib.figure")
    except ImportError as problem:
        raise ImportError("pictures need matplotlib: pip install 'hostmot2[plot]'") from problem
    panels = _panels(recording, columns_of(recording, names) if names else _signals(recording))
    figure = figures.Figure(figsize=(10, 1 + 2.4 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), squeeze=False, sharex=True)[:, 0]
    for axis, (unit, columns) in zip(axes, panels, strict=True):
        for name in columns:
            axis.plot(*envelope(recording.seconds, recording[name]), label=name, linewidth=0.9)
        axis.set(ylabel=unit)
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small")
        axis.grid(visible=True, alpha=0.3)
        for gap in recording.gaps:
            at = min(int(np.searchsorted(recording.cycle, gap.first)), len(recording.seconds) - 1)
            axis.axvline(recording.seconds[at], color="tab:red", linewidth=0.8, linestyle=":")
    axes[-1].set(xlabel="seconds")
    figure.suptitle(_title(recording))
    figure.savefig(path)


def _signals(recording: Recording) -> list[str]:
    last = {"cycle", "status", "flags", *recording.stages}
    return [name for name in recording if name not in last] + ["total_us", "wake_us"]


def _panels(recording: Recording, names: list[str]) -> list[tuple[str, list[str]]]:
    by_unit: dict[str, list[str]] = {}
    for name in names:
        by_unit.setdefault(recording.units.get(name, ""), []).append(name)
    return [
        (unit, columns[first : first + CURVES])
        for unit, columns in by_unit.items()
        for first in range(0, len(columns), CURVES)
    ]


def _title(recording: Recording) -> str:
    dropped = f", {recording.dropped} dropped" if recording.dropped else ""
    cut = ", cut off" if recording.missing else ""
    return f"{Path(recording.path).name}: {len(recording.records)} cycles{dropped}{cut}"


def envelope(x: npt.NDArray[Any], y: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Few points that look the same: the smallest and the largest value of each stretch, in their order."""
    if len(y) <= 2 * POINTS:
        return x, y.astype(np.float64)
    values = y.astype(np.float64)
    stretch = -(-len(values) // POINTS)
    whole = len(values) // stretch * stretch
    blocks = values[:whole].reshape(-1, stretch)
    starts = np.arange(0, whole, stretch)
    gaps = np.isnan(blocks)  # hide no peak beside them
    low = starts + np.where(gaps, np.inf, blocks).argmin(axis=1)
    high = starts + np.where(gaps, -np.inf, blocks).argmax(axis=1)
    chosen = np.unique(np.concatenate((low, high, np.arange(whole, len(values)))))
    return x[chosen], values[chosen]
