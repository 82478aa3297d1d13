"""The engine's thread on an emulated card in real time: ways out of the process, anything in any order."""

from __future__ import annotations

import contextlib
import errno
import os
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

import hostmot2
from hostmot2._core import ffi
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.ethernet import EthernetServer
from hostmot2.engine import Off, RealTimeWarning
from hostmot2.engine.options import warn_of
from hostmot2.errors import HostMot2Error

ROOT = Path(__file__).parent.parent
STEPS = 10_000
PROGRAM = """
import os, signal, sys, time
import hostmot2
from hostmot2.emulator.board import EmulatedBoard
emulated = EmulatedBoard("5i25+7i77")
board = hostmot2.open(emulated)
board.watchdog.timeout = 5  # a stalled machine is not what is tested
card = board.card("7i77")
card.start()
engine = board.engine(rate=1000, dead_man=0).start()
card.analog_enable = True
engine.write()
while not emulated.sserial[0].remote(1).get("analogena"):
    time.sleep(0.005)
def show():
    time.sleep(0.01)
    emulated.sync()
    print("running", engine.running, "enabled", emulated.sserial[0].remote(1).get("analogena"), flush=True)
"""


def program(ending: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM + ending],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done.stdout


def test_sigterm_turns_outputs_off() -> None:
    ending = "try:\n    os.kill(os.getpid(), signal.SIGTERM); time.sleep(5)\nfinally:\n    show()\n"
    assert program(ending) == "running False enabled False\n"


def test_a_forked_child_leaves_the_parents_engine_alone() -> None:
    ending = (
        "pid = os.fork()\n"
        "if not pid:\n    board.close(); os._exit(0)\n"
        "os.waitpid(pid, 0)\nshow()\nboard.close()\nshow()\n"
    )
    assert program(ending) == "running True enabled True\nrunning False enabled False\n"


def test_the_end_of_the_script_turns_outputs_off() -> None:
    # atexit runs backwards: what is registered before the package is looked at last
    before = "import atexit\natexit.register(lambda: show())\n"
    done = subprocess.run(
        [sys.executable, "-c", before + PROGRAM],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stdout == "running False enabled False\n", done.stderr


def test_a_pipelined_cycle_is_one_datagram_each_way() -> None:
    emulated = EmulatedBoard("7i92+7i77")
    with EthernetServer(emulated, "127.0.0.1", 0) as server:
        server.start()
        with hostmot2.open(server.url) as board:
            board.watchdog.timeout = 5  # a stalled machine is not what is tested
            board.card("7i77").start()
            with board.engine(rate=200, style="pipelined", dead_man=0, reply_timeout=0.02) as engine:
                next(engine.frames())
                before, cycles = server.counters, engine.status.cycles
                while engine.status.cycles < cycles + 20:
                    os.sched_yield()
                # counters were taken at some point between two cycles
                engine.disable()
                after, end = server.counters, engine.status.cycles
            assert abs(after.requests - before.requests - (end - cycles)) <= 1
            assert abs(after.replies - before.replies - (end - cycles)) <= 1


def test_boards_that_are_dropped_with_a_running_engine_are_made_safe() -> None:
    """The collector runs finalizers in any order; none may free what closing needs."""
    drop = """
import gc, warnings
from hostmot2.emulator.board import EmulatedBoard
import hostmot2
warnings.simplefilter("ignore", ResourceWarning)
for turn in range(60):
    emulated = EmulatedBoard("5i25+7i77", clock="virtual" if turn % 3 else "real")
    analog = emulated.sserial[0].remote(1)
    board = hostmot2.open(emulated)
    board.watchdog.timeout = 5  # a stalled machine is not what is tested
    card = board.card("7i77")
    card.start()
    if turn % 2:
        engine = board.engine().start()
        card.analog_enable = True
        engine.write()
        del engine
    del emulated, board, card
    gc.collect()
    assert not analog.get("analogena")
print("done")
"""
    done = subprocess.run(
        [sys.executable, "-c", drop], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.stdout, done.stderr) == ("done\n", ""), done


class Anything(RuleBasedStateMachine):
    """Start, stop, faults and closing in any order: nothing hangs or crashes, and stopped means off."""

    steps_done = starts = 0
    wire: Any = "on"

    def __init__(self) -> None:
        super().__init__()
        # two channels: no empty one to look for
        self.emulated = EmulatedBoard("5i25+7i77", sserial_channels=2, wire=self.wire)
        self.board = hostmot2.open(self.emulated)
        self.board.watchdog.timeout = 5  # a stalled machine is not what is tested
        self.card = self.board.card("7i77")
        self.engine: Any = None
        self.begun = False  # tried, at least: in real time a start may fail, and rules must not depend on it

    def remote(self) -> Any:
        return self.emulated.sserial[0].remote(1)

    @precondition(lambda self: not self.begun)
    @rule(rate=st.sampled_from([200, 1000, 4000]), style=st.sampled_from(["pipelined", "read-modify-write"]))
    def start(self, rate: float, style: Any) -> None:
        self.begun = True
        with contextlib.suppress(HostMot2Error):
            if self.board.watchdog.has_bitten:
                self.board.watchdog.acknowledge()
            self.remote().fault = 0  # else nothing starts
            self.remote().inject(bad_crc=0)
            self.card.start()
            self.engine = self.board.engine(rate, style=style, dead_man=0.02).start()
            Anything.starts += 1

    @precondition(lambda self: self.begun)
    @rule()
    def write(self) -> None:
        if self.engine is not None:
            self.engine.outputs["analogena"] = 1
            self.engine.write()
            self.engine.enable()

    @precondition(lambda self: self.begun)
    @rule()
    def look(self) -> None:
        if self.engine is not None:
            self.engine.read()
            self.engine.events()
            self.engine.trace()

    @rule(count=st.integers(1, 30))
    def lose_replies(self, count: int) -> None:
        self.remote().inject(bad_crc=count)

    @rule(fault=st.sampled_from([0, 0x08]))
    def fault(self, fault: int) -> None:
        self.remote().fault = fault

    @precondition(lambda self: self.begun)
    @rule()
    def stop(self) -> None:
        if self.engine is not None:
            self.engine.stop()
            assert self.engine.off == Off.STOP
        self.engine, self.begun = None, False

    @rule()
    def close(self) -> None:
        self.board.close()
        assert self.engine is None or not self.engine.running
        self.engine, self.begun = None, False
        self.remote().inject(bad_crc=0)  # the remotes are found anew
        self.remote().fault = 0
        self.board = hostmot2.open(self.emulated)
        self.board.watchdog.timeout = 5
        self.card = self.board.card("7i77")

    @invariant()
    def counts_its_steps(self) -> None:
        Anything.steps_done += 1

    @invariant()
    def only_a_running_engine_has_the_cycle(self) -> None:
        assert (self.board.cycle.engine is not None) == (self.engine is not None)

    def teardown(self) -> None:
        self.board.close()


class AnythingAtOnce(Anything):
    """The same with no time on the wire: starting takes next to none, so there is much more of it."""

    wire = "off"


def in_any_order(machine: type[Anything], examples: int, steps: int) -> None:
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=examples,
            stateful_step_count=steps,
            deadline=None,
            database=None,
            suppress_health_check=list(HealthCheck),
        ),
    )


def test_anything_in_any_order() -> None:
    in_any_order(Anything, 12, 15)


@pytest.mark.slow
def test_ten_thousand_steps_in_any_order() -> None:
    """A machine may end its steps early, so it runs until there were so many."""
    Anything.steps_done = Anything.starts = 0
    while Anything.steps_done < STEPS:
        in_any_order(AnythingAtOnce, 5, 500)
    assert Anything.starts > STEPS / 50


GRANTED = """
import os, sys, warnings
import hostmot2
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.engine import RealTimeWarning
before = set(os.listdir("/proc/self/task"))
locked = lambda: int(next(l for l in open("/proc/self/status") if l.startswith("VmLck")).split()[1])
def faults(thread):  # minor and major, of this thread alone
    fields = open(f"/proc/self/task/{thread}/stat").read().rsplit(")")[1].split()
    return int(fields[7]) + int(fields[9])
cpu = min(os.sched_getaffinity(0))
with hostmot2.open(EmulatedBoard("5i25+7i77")) as board, warnings.catch_warnings(record=True) as refused:
    warnings.simplefilter("always")
    assert locked() == 0
    with board.engine(200, real_time=7, cpu=cpu, dead_man=0) as engine:
        next(engine.frames())
        if any(issubclass(w.category, RealTimeWarning) for w in refused):
            print("refused", *(w.message for w in refused))
            sys.exit()
        (thread,) = set(os.listdir("/proc/self/task")) - before
        thread = int(thread)
        assert os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        assert os.sched_getparam(thread).sched_priority == 7
        assert os.sched_getaffinity(thread) == {cpu}
        assert os.sched_getscheduler(0) == os.SCHED_OTHER, "the program's own threads stay what they are"
        sanitized = "ASAN_OPTIONS" in os.environ  # locks no memory, and its own comes page by page
        assert locked() > 0 or sanitized
        taken = faults(thread)
        for _ in zip(range(50), engine.frames()):
            pass
        assert faults(thread) == taken or sanitized, "memory comes in the cycle"
print("granted")
"""


def test_what_is_granted_is_the_threads_own() -> None:
    """In a process of its own: locked memory stays locked."""
    done = subprocess.run(
        [sys.executable, "-c", GRANTED], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    if done.stdout.startswith("refused"):
        pytest.skip(f"NOT TRIED IN REAL TIME: {done.stdout}")
    assert done.stdout == "granted\n", done.stderr


def test_each_refusal_is_a_warning_that_says_what_to_do() -> None:
    refusals = ffi.new("hm2_engine_refusals *", {"priority": errno.EPERM, "lock_memory": errno.ENOMEM})
    with pytest.warns(RealTimeWarning) as warned:
        warn_of(refusals, -1)
    texts = [str(each.message) for each in warned]
    assert len(texts) == 2
    assert any("SCHED_FIFO" in text and os.strerror(errno.EPERM) in text for text in texts)
    assert any("mlockall" in text and os.strerror(errno.ENOMEM) in text for text in texts)
    assert all("hm2 setup rt" in text for text in texts)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of(ffi.new("hm2_engine_refusals *"), 0)


def test_awake_before_the_time_is_not_begun_before_the_time() -> None:
    """early= bounds when the thread wakes, never when a cycle begins."""
    for early in (0.0, 0.002):
        with hostmot2.open(EmulatedBoard("5i25+7i77")) as board:
            board.watchdog.timeout = 5  # a stalled machine is not what is tested
            engine = board.engine(200, early=early, dead_man=0)
            ring = engine.record(256, 0)
            with engine:
                for frame in engine.frames(seconds=0.1):
                    # its answer is there: now is behind its beginning, which was planned
                    assert time.monotonic_ns() >= frame.status.start_ns
                records = ring.pop()
            steps = np.diff(records["start_ns"][:15])
            assert (steps % 5_000_000 == 0).all()  # the schedule is absolute: periods or multiples of them


def test_refused_real_time_is_a_warning() -> None:
    with hostmot2.open(EmulatedBoard("5i25+7i77")) as board:
        board.card("7i77").start()
        engine = board.engine(cpu=1000)
        with pytest.warns(RealTimeWarning, match="processor 1000"):
            engine.start()
        assert next(engine.frames()).cycle >= 0
