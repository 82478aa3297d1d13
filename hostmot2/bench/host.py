"""Where a measurement was made, and the scheduling it was made under."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from hostmot2.host_facts import facts

__all__ = ["facts", "quiet"]


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
