"""What must hold after every run, whatever went wrong in it."""

from __future__ import annotations

import ctypes
import gc
import os
import threading

from faults.operations import Wrong
from faults.world import SILENCE_US, UserError, World
from hostmot2 import HostMot2Error

MOST_US = 20e6
"""Virtual time that an operation may take at most, however it ends."""


def typed(error: BaseException, fault: str) -> str:
    """The error's class, if it is one that may come out. Raises Wrong."""
    if fault == "user exception":
        if not isinstance(error, UserError):
            raise Wrong(f"the user's exception came out as {error!r}") from error
    elif not isinstance(error, HostMot2Error):
        raise Wrong(f"no error of this package: {error!r}") from error
    elif type(error) is HostMot2Error:
        raise Wrong(f"an error that says nothing: {error!r}")
    return type(error).__name__


def in_time(elapsed_us: float) -> None:
    """The operation has ended within its virtual time."""
    if elapsed_us > MOST_US:
        raise Wrong(f"took {elapsed_us / 1e6:.1f} s")


def nothing_unasked(world: World) -> None:
    """Remotes show what was asked for or nothing; pins are driven where only lines hang on them."""
    for number, (outputs, allowed) in enumerate(zip(world.outputs(), world.allowed_outputs, strict=True)):
        if outputs not in allowed:
            raise Wrong(f"remote {number} shows {outputs.hex()}, nobody asked for it")
    for port, (driven, lines) in enumerate(zip(world.driven(), world.lines, strict=True)):
        if driven & ~lines:
            raise Wrong(f"port {port} drives {driven:#x}, lines are {lines:#x}")


def off_after_silence(world: World) -> None:
    """When nobody exchanges any more everything goes off by itself."""
    world.card.advance(SILENCE_US)
    if any(any(outputs) for outputs in world.outputs()):
        raise Wrong(f"after {SILENCE_US / 1e3:g} ms of silence: {[o.hex() for o in world.outputs()]}")


def off_when_closed(world: World) -> None:
    """A closed board drives nothing."""
    if any(world.driven()):
        raise Wrong(f"closed, and pins are driven: {[hex(mask) for mask in world.driven()]}")
    off_after_silence(world)


class Resources:
    """What a process holds: file descriptors, threads, memory of C."""

    def __init__(self) -> None:
        gc.collect()  # what only a cycle of references holds is not forgotten
        self.files = len(os.listdir("/proc/self/fd"))
        self.threads = threading.active_count()
        self.tasks = len(os.listdir("/proc/self/task"))
        self.memory = in_use()

    def compare(self, runs: int) -> None:
        """Raises Wrong if more is held than before so many runs."""
        now = Resources()
        for name in ("files", "threads", "tasks"):
            if getattr(now, name) > getattr(self, name):
                raise Wrong(f"{name}: {getattr(self, name)} before, {getattr(now, name)} after {runs} runs")
        grown = now.memory - self.memory
        if grown > NOISE_BYTES + runs * BYTES_PER_RUN:
            raise Wrong(f"memory grew by {grown} bytes in {runs} runs")


NOISE_BYTES = 60_000
BYTES_PER_RUN = 100
"""Less than the smallest thing that could be forgotten, a board of the C core."""


class _Mallinfo2(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_size_t)
        for name in (
            "arena",
            "ordblks",
            "smblks",
            "hblks",
            "hblkhd",
            "usmblks",
            "fsmblks",
            "uordblks",
            "fordblks",
            "keepcost",
        )
    ]


_LIBC = ctypes.CDLL(None)
_LIBC.mallinfo2.restype = _Mallinfo2


def in_use() -> int:
    """Bytes that C has allocated and not freed."""
    info = _LIBC.mallinfo2()
    return int(info.uordblks + info.hblkhd)
