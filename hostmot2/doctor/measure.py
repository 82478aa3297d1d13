"""How late this machine wakes a thread, and how long a card takes to answer."""

from __future__ import annotations

import gc
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from hostmot2 import lbp16
from hostmot2.histogram import Histogram
from hostmot2.opening import open_board
from hostmot2.registers import Lbp16Space

PRIORITY = 80
PERIOD_NS = 1_000_000
_TIMEOUT_S = 0.1
_IDENTITY = 0x100
"""Address of registers that only identify the card: reading them changes nothing."""


@dataclass(frozen=True)
class Measurement:
    """times in ns; lost: exchanges without an answer. how: scheduling and rate in words."""

    what: str
    how: str
    times: Histogram = field(default_factory=Histogram)
    lost: int = 0

    def as_json(self) -> dict[str, object]:
        """As JSON takes it."""
        return {"what": self.what, "how": self.how, "lost": self.lost, **self.times.summary()}


Probe = Callable[[int], Measurement]
"""Measures so many times."""


@contextmanager
def real_time(priority: int = PRIORITY, cpu: int | None = None) -> Iterator[str]:
    """This thread under SCHED_FIFO where that is permitted, on one processor if asked; restores both."""
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    allowed = os.sched_getaffinity(0)
    words = "normal scheduling (SCHED_FIFO is not permitted)"
    collecting = gc.isenabled()
    gc.disable()
    try:
        if cpu is not None:
            os.sched_setaffinity(0, {cpu})
        if priority:
            try:
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
                words = f"SCHED_FIFO {priority}"
            except PermissionError:
                pass
        else:
            words = "normal scheduling"
        yield words + ("" if cpu is None else f", processor {cpu}")
    finally:
        os.sched_setscheduler(0, policy, parameters)
        os.sched_setaffinity(0, allowed)
        if collecting:
            gc.enable()


def lateness(count: int, *, priority: int = PRIORITY, cpu: int | None = None) -> Measurement:
    """Wake-ups at 1 kHz: how long after the time asked for this thread runs. Python adds about 2 us."""
    times, now = [], time.monotonic_ns
    with real_time(priority, cpu) as how:
        due = now() + PERIOD_NS
        for _ in range(count):
            time.sleep(max(due - now(), 0) / 1e9)
            times.append(max(now() - due, 0))
            due = max(due + PERIOD_NS, now())
    return Measurement("wake-up lateness", f"1 kHz, {how}", Histogram(times))


def round_trips(
    host: str, port: int, count: int, *, priority: int = PRIORITY, cpu: int | None = None
) -> Measurement:
    """Reads of an Ethernet card's identity at 1 kHz. Nothing is written to it. OSError if there is no way.

    The length asked for changes each time, so that a late answer is not taken for the next one.
    """
    times, lost, now = [], 0, time.monotonic_ns
    requests = [lbp16.read(Lbp16Space.HOSTMOT2, _IDENTITY, words) for words in range(1, 9)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock, real_time(priority, cpu) as how:
        sock.connect((host, port))
        sock.settimeout(_TIMEOUT_S)
        due = now()
        for number in range(count):
            words = number % 8
            start = now()
            sock.send(requests[words])
            if _answered(sock, 4 * (words + 1)):
                times.append(now() - start)
            else:
                lost += 1
                if lost > 10 and not times:
                    raise TimeoutError(f"udp://{host}:{port} does not answer")
            due = max(due + PERIOD_NS, now())
            time.sleep(max(due - now(), 0) / 1e9)
    return Measurement("round trip to the card", f"1 kHz, {how}", Histogram(times), lost)


def _answered(sock: socket.socket, size: int) -> bool:
    end = time.monotonic() + _TIMEOUT_S
    while time.monotonic() < end:
        try:
            if len(sock.recv(2048)) == size:
                return True
        except TimeoutError:
            return False
        except ConnectionRefusedError:
            return False
    return False


def register_reads(url: str, count: int, *, priority: int = PRIORITY, cpu: int | None = None) -> Measurement:
    """Single register reads of a card that is opened for it; errors as hostmot2.open."""
    times, now = [], time.monotonic_ns
    with open_board(url) as board, real_time(priority, cpu) as how:
        for _ in range(count):
            start = now()
            board.read(_IDENTITY)
            times.append(now() - start)
    return Measurement("register read", how, Histogram(times))
