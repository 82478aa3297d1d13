"""What recording costs the cycle's thread, and whether a stalled disk costs records."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import hostmot2
from hostmot2._core import ffi, lib
from hostmot2.bench import host
from hostmot2.bench.lateness import WATCHDOG_SECONDS, run_engine
from hostmot2.bench.report import Goal, Report, Table
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.catalog import remote
from hostmot2.emulator.ethernet import EthernetServer
from hostmot2.engine import Engine
from hostmot2.histogram import Histogram
from hostmot2.record_ring import RecordRing, record_dtype
from hostmot2.recording import Recorder, record

RATE = 2000
FAST, CHANNELS = 4000, 8
STALLED_RUN, SHORTEST = 60, 6  # s: what is promised, and what still has flushes before and after the stall
STALL_SECONDS = 1.0
SPIN_US = 100

SHARE, COST_P50_US, COST_P99_9_US, PUSH_NS = 0.01, 0.1, 2.0, 15.0
WHY = "a difference of stages that scatter by 0.1 us from round to round: more rounds (--count) tell more"
CHANGE_HANDS = (
    "the reader, on the other processor, takes records as they come: with each, cache lines change hands"
)
PUSH_SLOTS, PUSH_BYTES, PUSH_ROUNDS = 1024, 128, 400


def cost(report: Report, rounds: int, seconds: float = 1.0) -> None:
    """Cycles over UDP in turns with a recorder and without."""
    with _served() as board, tempfile.TemporaryDirectory() as directory:
        options: Any = {"dead_man": 0, "real_time": host.engine_priority(), "cpu": host.measuring()}
        plain, recorded = (board.engine(RATE, style="pipelined", **options) for _ in range(2))
        without, with_it = [], []
        with record(recorded, Path(directory) / "run.mcap", json_rate=100):
            for _ in range(rounds):
                without.append(run_engine(plain, seconds))
                with_it.append(run_engine(recorded, seconds))
    p50 = median(_took(b, 50) - _took(a, 50) for a, b in zip(without, with_it, strict=True))
    cycle = median(_cycle_ns(trace) for trace in without)
    p99_9 = median(_took(b, 99.9) - _took(a, 99.9) for a, b in zip(without, with_it, strict=True))
    rows = {
        name: [median(_took(trace, p, [stage]) for trace in traces) for p in (50, 99, 99.9)]
        for name, traces, stage in (
            ("unpack", without, "unpack"),
            ("unpack and take words for the record", with_it, "unpack"),
            ("trace and publish", without, "after"),
            ("trace, push the record and publish", with_it, "after"),
        )
    }
    report.tables.append(Table("recording in the cycle's thread, ns", ("p50", "p99", "p99.9"), rows))
    report.goals += [
        Goal("recording, part of a UDP cycle at p50", p50 / cycle, SHARE, at_least=False),
        Goal("recording adds to a cycle, p50, us", p50 / 1000, COST_P50_US, at_least=False, why=WHY),
        Goal("recording adds to a cycle, p99.9, us", p99_9 / 1000, COST_P99_9_US, at_least=False),
    ]
    report.notes.append(f"recording adds {p50:.0f} ns to a UDP cycle of {cycle / 1000:.1f} us (medians)")


def _took(trace: dict[str, Histogram], percent: float, stages: list[str] | None = None) -> float:
    """ns of the stages in which recording has a part."""
    return float(sum(trace[stage].percentile(percent) for stage in stages or ["unpack", "after"]))


def _cycle_ns(trace: dict[str, Histogram]) -> float:
    """A whole cycle at p50, without its lateness."""
    return float(trace["cycle"].percentile(50) - trace["wake"].percentile(50))


@contextmanager
def _served() -> Iterator[hostmot2.Board]:
    with (
        EmulatedBoard("7i92+7i77") as card,
        EthernetServer(
            card, spin_us=SPIN_US, fifo_priority=host.engine_priority(), cpu=host.other()
        ) as server,
        hostmot2.open(f"{server.start().url}?error_limit=0") as board,
    ):
        board.watchdog.timeout = WATCHDOG_SECONDS
        board.card("7i77").start()
        yield board


def pushes(report: Report) -> None:
    """A record of 128 bytes into the ring, again and again, while a thread takes them out."""
    dtype = record_dtype(words=(PUSH_BYTES - record_dtype().itemsize) // 4)
    ring, over = RecordRing(dtype, PUSH_SLOTS), threading.Event()
    one = np.zeros(1, dtype).view(np.uint8)
    reader = threading.Thread(target=_drain, args=(ring, over))
    reader.start()
    times = []
    for _ in range(PUSH_ROUNDS):
        spent = lib.hm2_floor_pushes(ring.handle, ffi.from_buffer(one), PUSH_SLOTS)
        times.append(spent / PUSH_SLOTS)
        while ring.counters.popped < ring.counters.pushed:
            time.sleep(0)
    over.set()
    reader.join()
    name = f"pushing a record of {dtype.itemsize} bytes, ns"
    report.goals.append(Goal(name, median(times), PUSH_NS, at_least=False, why=CHANGE_HANDS))
    report.goals.append(Goal("pushes dropped", ring.counters.dropped, 0, at_least=False))


def _drain(ring: RecordRing, over: threading.Event) -> None:
    host.pin(host.other(), 0)
    records = np.empty(PUSH_SLOTS, ring.dtype)
    while not over.is_set():
        ring.pop_into(records)


def stalled_seconds(count: int | None) -> int:
    """How long to record with a stalled disk: STALLED_RUN, or `count`, but at least SHORTEST."""
    return STALLED_RUN if count is None else max(count, SHORTEST)


def stalled_disk(report: Report, seconds: float) -> None:
    """4 kHz with eight channels, everything recorded, and nothing written for a second in the middle."""
    with EmulatedBoard("5i25+7i77", sserial_channels=CHANNELS) as card, hostmot2.open(card) as board:
        for channel in range(2, CHANNELS):
            card.sserial[0].attach(channel, remote("7i77-io"))
        board.watchdog.timeout = WATCHDOG_SECONDS
        board.sserial.start((1 << CHANNELS) - 1).raise_for_failed()
        priority, cpu = host.engine_priority(), host.measuring()
        engine = board.engine(FAST, dead_man=0, real_time=priority, cpu=cpu)
        with tempfile.TemporaryDirectory() as directory:
            recorder = record(engine, Path(directory) / "run.mcap", json_rate=100)
            cycles = _run_stalled(recorder, engine, seconds)
            counters = recorder.counters
    text = f"records dropped in {seconds:g} s at {FAST} Hz, {CHANNELS} channels, the disk stalled for 1 s"
    report.goals.append(Goal(text, counters.dropped, 0, at_least=False))
    report.goals.append(Goal("the same: cycles without a record", cycles - counters.records, 0, False))


def _run_stalled(recorder: Recorder, engine: Engine, seconds: float) -> int:
    """Cycles run."""
    end = time.monotonic() + seconds
    _stall(recorder, at=end - seconds / 2)
    with recorder, engine:
        time.sleep(max(end - time.monotonic(), 0))
        engine.stop()
    return engine.status.cycles


def _stall(recorder: Recorder, at: float) -> None:
    """The first flush after a time takes a second: the disk writes nothing, and its caller waits."""
    sink: Any = recorder._sink
    flush: Callable[[], None] = sink.flush
    stalled = threading.Event()

    def slow() -> None:
        if time.monotonic() >= at and not stalled.is_set():
            stalled.set()
            time.sleep(STALL_SECONDS)
        flush()

    sink.flush = slow
