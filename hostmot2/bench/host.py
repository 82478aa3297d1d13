"""Where a measurement was made, and the scheduling it was made under."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from hostmot2.host_facts import facts

__all__ = ["engine_priority", "facts", "measuring", "other", "pin", "placement", "quiet", "unlock_memory"]

ENGINE_PRIORITY = 60


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


def engine_priority() -> int:
    """SCHED_FIFO priority for the threads that are measured; 0 where the system does not permit it."""
    real_time = sys.platform == "linux" and os.sched_getscheduler(0) == os.SCHED_FIFO
    return ENGINE_PRIORITY if real_time else 0


def measuring() -> int:
    """The processor for what is measured: the last."""
    return max(os.sched_getaffinity(0))


def other() -> int:
    """The processor for everything else: the first, which may be the only one."""
    return min(os.sched_getaffinity(0))


def pin(cpu: int, priority: int) -> None:
    """This thread onto one processor, SCHED_FIFO with a priority or, with 0, as any other."""
    os.sched_setaffinity(0, {cpu})
    policy = os.SCHED_FIFO if priority else os.SCHED_OTHER
    os.sched_setscheduler(0, policy, os.sched_param(priority))


def placement() -> str:
    """In words."""
    policy = f"SCHED_FIFO {priority}" if (priority := engine_priority()) else "the normal scheduler"
    alone = "" if measuring() != other() else ", the only one: everything else runs there, too"
    return f"the engine's thread and the bare loop run under {policy} on processor {measuring()}{alone}"


def unlock_memory() -> None:
    """Undo the mlockall of an engine in real time, which holds for the whole process."""
    ctypes.CDLL(None).munlockall()
