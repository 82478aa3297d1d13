"""Benchmarks: ours beside others' in one process, round by round, as ratios that survive a noisy machine.

From Python:

    from hostmot2 import bench

    with bench.quiet():                       # no garbage collection, SCHED_FIFO where permitted
        report = bench.run("doit", 500)
    print(report)                             # tables, histograms, goals
    report.histograms, report.goals           # Histogram by name; Goal.value, .limit, .met
    bench.draw([report], Path("doit.png"), bench.facts())
    bench.document([report], bench.facts(), "")   # JSON, as `hm2 bench -o` writes it
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from hostmot2.bench.host import facts, quiet
from hostmot2.bench.picture import draw
from hostmot2.bench.report import Goal, Report, Table, compare, document, earlier, goals_table

__all__ = [
    "BENCHMARKS",
    "Goal",
    "Report",
    "Table",
    "compare",
    "document",
    "draw",
    "earlier",
    "facts",
    "goals_table",
    "quiet",
    "run",
]

# name: module with `run(count: int | None) -> Report`, what it measures
BENCHMARKS = {
    "pack": ("hostmot2.bench.pack", "process data: unpack, pack and bulk decode beside other packages"),
    "doit": (
        "hostmot2.bench.doit",
        "smart serial exchanges: host, bus, wire, firmware, beside their floor",
    ),
    "cycle": ("hostmot2.bench.cycle", "the cycle engine: lateness, a busy interpreter, recording"),
    "scale": ("hostmot2.bench.scale", "the engine's cost with channels, cards and rate"),
    "rtt": (
        "hostmot2.bench.rtt",
        "Ethernet: cycles beside bare exchanges, the emulated card beside a bare answerer",
    ),
    "peer": ("hostmot2.bench.peer", "LinuxCNC's hm2_eth on the same emulated card (needs root)"),
}


def run(name: str, count: int | None = None, url: str | None = None) -> Report:
    """Run one benchmark of BENCHMARKS; count: rounds or cycles, None: its default.

    url: the card to measure, where the benchmark is about a card ("doit"); emulated ones by default.
    Raises KeyError for no such benchmark, ImportError when what it needs is not installed.
    """
    measure: Callable[..., Report] = import_module(BENCHMARKS[name][0]).run
    return measure(count, url) if name == "doit" and url else measure(count)
