"""Where a measurement was made, and the scheduling it was made under."""

from __future__ import annotations

import gc
import os
import platform
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path

_PACKAGES = ("hostmot2", "numpy", "cffi", "bitstruct", "cbitstruct", "cantools")


def facts() -> dict[str, str]:
    """What a reader of the numbers needs to know about the machine and the versions."""
    result = {
        "date": time.strftime("%Y-%m-%d %H:%M:%S %z"),
        "processor": _processor(),
        "processors": str(os.cpu_count()),
        "kernel": f"{platform.system()} {platform.release()}",
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "load": " ".join(f"{load:.2f}" for load in os.getloadavg()),
    }
    for package in _PACKAGES:
        try:
            result[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            result[package] = "not installed"
    return result


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


@contextmanager
def quiet(priority: int = 50) -> Iterator[str]:
    """No garbage collection, and SCHED_FIFO where the system permits; gives the scheduling in words.

    Restores both. Without FIFO times are two to three times longer and scatter; ratios hold.
    """
    collecting = gc.isenabled()
    gc.collect()
    gc.disable()
    real_time, words = _enter_fifo(priority)
    try:
        yield words
    finally:
        if real_time:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        if collecting:
            gc.enable()


def _enter_fifo(priority: int) -> tuple[bool, str]:
    if sys.platform != "linux":
        return False, "normal scheduler"
    if os.sched_getscheduler(0) != os.SCHED_OTHER:
        return False, f"scheduling policy {os.sched_getscheduler(0)} as found"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return False, "normal scheduler (SCHED_FIFO not permitted: expect two to three times the noise)"
    return True, f"SCHED_FIFO {priority}"
