"""A layout for Foxglove (and Lichtblick): what is in the file, plotted, one panel per unit.

Import it with "Layouts, Import from file". The form is the one their export writes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from hostmot2.recording import format as form
from hostmot2.recording.format import Signal

PATHS_PER_PLOT = 16
PLOTS = 12  # more panels than that show nothing


def layout(inputs: Sequence[Signal], outputs: Sequence[Signal]) -> bytes:
    """The layout's JSON: signals by unit, then how long the stages of a cycle took."""
    plots: dict[str, list[str]] = {}
    for topic, signals in ((form.INPUTS, inputs), (form.OUTPUTS, outputs)):
        for name, signal in zip(form.json_names(signals), signals, strict=True):
            plots.setdefault(signal.unit or "without unit", []).append(f"{topic}.{name}")
    panels: dict[str, Any] = {}
    for unit, paths in plots.items():
        for first in range(0, len(paths), PATHS_PER_PLOT):
            if len(panels) < PLOTS:
                panels[f"Plot!hm2{len(panels)}"] = _plot(unit, paths[first : first + PATHS_PER_PLOT])
    panels["Plot!hm2cycle"] = _plot("cycle, us", [f"{form.CYCLE}.{name}" for name in form.CYCLE_NAMES])
    panels["RosOut!hm2log"] = {"searchTerms": [], "minLogLevel": 1, "topicToRender": form.LOG}
    document = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split(list(panels), "column"),
    }
    return json.dumps(document, indent=1).encode()


def _plot(title: str, paths: list[str]) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "paths": [{"value": path, "enabled": True, "timestampMethod": "receiveTime"} for path in paths],
        "xAxisVal": "timestamp",
        "isSynced": True,
        "showLegend": True,
        "legendDisplay": "left",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showPlotValuesInLegend": True,
        "sidebarDimension": 240,
    }


def _split(names: list[str], direction: str) -> Any:
    """Panels halved again and again, so that all have about the same size."""
    if len(names) == 1:
        return names[0]
    middle = (len(names) + 1) // 2
    other = "row" if direction == "column" else "column"
    return {
        "direction": direction,
        "first": _split(names[:middle], other),
        "second": _split(names[middle:], other),
        "splitPercentage": round(100 * middle / len(names)),
    }
