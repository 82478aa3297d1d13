"""An engine used out of turn: closed while it works, asked when it is over, its arrays kept for longer."""

from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys
import threading
import time
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from engine_steps import run

import hostmot2
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.engine import Off
from hostmot2.errors import EngineError, TransportClosed
from hostmot2.registers import Gtag

ROOT = Path(__file__).parent.parent


# -- when it is over


def test_what_drives_is_refused_when_it_is_over_and_what_tells_still_tells(board: Any) -> None:
    engine = board.engine()
    axis = engine.add_pid("x", feedback="encoder0.position", output="analogout0", p=1.0)
    with engine:
        axis.position = 0.0
        run(engine, 20)
    for attempt in (
        engine.write,
        engine.read,
        engine.step,
        engine.enable,
        engine.disable,
        lambda: next(engine.frames()),
        lambda: engine.lend(board.sserial[0]).__enter__(),
    ):
        with pytest.raises(EngineError):
            attempt()
    axis.tune(p=2.0)
    assert axis.settings["p"] == 2.0
    assert engine.status.cycles >= 20
    assert len(engine.trace()["cycle"]) >= 20
    assert len(engine.slowest()) == 16
    assert engine.off == Off.STOP
    assert engine.layout() == []  # nothing was recorded
    assert [str(event) for event in engine.events()]
    assert "stopped" in repr(engine)


def test_what_tells_tells_before_it_has_begun(board: Any) -> None:
    engine = board.engine()
    assert engine.status.cycles == 0
    assert engine.off == Off.STOP
    assert (engine.events(), engine.layout(), len(engine.slowest())) == ([], [], 0)
    assert {len(histogram) for histogram in engine.trace().values()} == {0}
    engine.reset_trace()
    engine.stop()
    with pytest.raises(EngineError):
        engine.read()


def test_a_started_engine_may_be_started_again_and_nothing_happens(board: Any) -> None:
    with board.engine() as engine:
        cycles = run(engine, 5).status.cycles
        assert engine.start() is engine
        assert run(engine, 1).status.cycles == cycles + 1
        assert engine.off == 0


@pytest.mark.parametrize("ran_before", [False, True])
def test_an_engine_of_a_closed_board_does_not_start(ran_before: bool) -> None:
    with hostmot2.open(EmulatedBoard("7i96", clock="virtual")) as board:
        board.cycle.automatic_watchdog = False
        engine = board.engine()
        if ran_before:
            with engine:
                run(engine, 3)
    with pytest.raises(TransportClosed):
        engine.start()
    assert not engine.running


def test_parts_that_an_engine_cannot_take_along_are_refused() -> None:
    """What they were told never went out, what they showed never changed, and nothing said so."""
    with hostmot2.open(EmulatedBoard("7i96", clock="virtual")) as board:
        engine = board.engine()
        with engine:
            run(engine, 3)
            with pytest.raises(EngineError, match="before an engine"):
                board.ssrs[0].enable = True
            assert run(engine, 3).off == 0
        ssr = board.ssrs[0]
        with pytest.raises(EngineError, match="make another one"):
            engine.start()
        assert (engine.running, board.cycle.engine) == (False, None)
        with board.engine() as another:
            ssr.enable = True
            ssr[0] = True
            run(another, 3)
            assert board.read(board.module(Gtag.SSR).base) == 1


def test_nothing_turns_on_by_itself_after_stop_and_start(board: Any) -> None:
    engine = board.engine()
    for _ in range(3):
        with engine:
            engine.outputs["analogena"] = 1
            assert run(engine, 3).sent["analogena"] == 1
        assert not engine.outputs.array.any()
        with engine:
            for _ in range(5):
                assert engine.step().off == Off.IDLE
            assert run(engine, 5).sent["analogena"] == 0


def test_stopping_elsewhere_ends_the_users_loop_with_an_error() -> None:
    with hostmot2.open(EmulatedBoard("5i25+7i77", sserial_channels=2)) as board:
        board.watchdog.timeout = 5  # a stalled machine is not what is tested
        board.card("7i77").start()
        engine = board.engine(1000, dead_man=0).start()
        threading.Timer(0.1, engine.stop).start()
        with pytest.raises(EngineError, match="not running"):
            for _ in engine.frames(seconds=60):
                pass


def test_ctrl_c_while_it_stops_leaves_nothing_running(
    board: Any, emulated: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    for place in ("hostmot2.engine.restart.Restarter.stop", "hostmot2.engine.engine.Engine._take_events"):
        engine = board.engine(restart_ports=1).start()
        engine.outputs["analogena"] = 1
        assert run(engine, 3).sent["analogena"] == 1
        with monkeypatch.context() as context:
            context.setattr(place, interrupted)
            with pytest.raises(KeyboardInterrupt):
                engine.stop()
        engine.stop()
        assert (engine.running, board.cycle.engine) == (False, None)
        emulated.advance(1000.0)
        assert not emulated.sserial[0].remote(1).get("analogena")
        with pytest.raises(EngineError):
            engine.write()


def test_an_engine_that_is_over_is_not_kept_by_its_board(board: Any) -> None:
    with board.engine() as engine:
        run(engine, 3)
    gone = weakref.ref(engine)
    del engine
    gc.collect()
    assert gone() is None


FORKS = """
import os, signal, threading
import hostmot2
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.errors import EngineError
board = hostmot2.open(EmulatedBoard("5i25+7i77", sserial_channels=2))
board.watchdog.timeout = 5
board.card("7i77").start()
running, over = board.engine(1000, dead_man=0).start(), board.engine(500)
held, release = threading.Event(), threading.Event()
def hold():
    with running._lock, over._lock:
        held.set()
        release.wait()
holder = threading.Thread(target=hold)
holder.start()
held.wait()
child = os.fork()
if not child:
    signal.alarm(20)  # ends one that waits for ever
    for engine in (running, over):
        engine.events(), repr(engine), engine.slowest(), engine.stop()
        try:
            engine.write()
        except EngineError:
            continue
        os._exit(1)
    os._exit(running.running or running.status.running)
status = os.waitpid(child, 0)[1]
release.set()
holder.join()
print("child", os.waitstatus_to_exitcode(status), "parent", running.running)
board.close()
"""


def test_a_forked_child_does_not_wait_for_a_thread_that_had_the_engine() -> None:
    done = subprocess.run(
        [sys.executable, "-c", FORKS], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.stdout == "child 0 parent True\n", done.stderr


@pytest.fixture(scope="module")
def rest(tmp_path_factory: pytest.TempPathFactory) -> int:
    """A controller that sleeps as many microseconds as its context says: its address."""
    folder = tmp_path_factory.mktemp("control")
    (folder / "rest.c").write_text(
        "#include <unistd.h>\n"
        "void rest(void *context, const double *in, double *out, double seconds, int enabled)\n"
        "{ (void)in; (void)out; (void)seconds; (void)enabled; usleep(*(unsigned *)context); }\n"
    )
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", folder / "rest.so", folder / "rest.c"], check=True)
    address = ctypes.cast(ctypes.CDLL(str(folder / "rest.so")).rest, ctypes.c_void_p).value
    assert address is not None
    return address


@pytest.mark.parametrize("turn", range(3))
def test_the_board_is_closed_while_a_controller_is_at_work(turn: int, rest: int) -> None:
    """A controller that takes most of the period, of which one is always running."""
    emulated = EmulatedBoard("5i25+7i77", sserial_channels=2)
    board = hostmot2.open(emulated)
    board.watchdog.timeout = 5
    card = board.card("7i77")
    card.start()
    engine = board.engine(500, dead_man=0, style="read-modify-write")
    engine.add_control(rest, np.array([1200 + turn], np.uint32))
    engine.start()
    card.analog_enable = True
    card.analog[0].volts = 5.0
    engine.write()
    end = time.monotonic() + 20
    while not emulated.sserial[0].remote(1).get("analogena") and time.monotonic() < end:
        time.sleep(0.002)
    assert emulated.sserial[0].remote(1).get("analogena")
    closers = [threading.Thread(target=board.close) for _ in range(3)]
    for closer in closers:
        closer.start()
    for closer in closers:
        closer.join(20)
    assert not any(closer.is_alive() for closer in closers)
    assert not engine.running
    emulated.sync()
    assert not emulated.sserial[0].remote(1).get("analogena")
    assert emulated.sserial[0].remote(1).get("analogout0") == 0.0
    with pytest.raises(EngineError):
        engine.write()


# -- arrays that are kept for longer than the board

KEPT = """
import gc, sys, weakref
import numpy as np
import hostmot2
from hostmot2.emulator.board import EmulatedBoard

emulated = EmulatedBoard("5i25+7i77", clock="virtual")
board = hostmot2.open(emulated)
board.card("7i77").start()
engine = board.engine()
ring = engine.record(64, 64)
with engine:
    for _ in range(10):
        engine.write()
        frame = engine.step()
data = board.sserial.process_data
arrays = [data.input_image, data.output_image, data.values, data.raw, engine.outputs.array]
arrays += [frame.inputs.array, frame.sent.array, ring.pop()["words"], engine.slowest()["stage_ns"]]
unpack, pack = data.unpack, data.pack
gone = weakref.ref(board)
board.close()
del board, engine, emulated, frame, ring, data
gc.collect()
assert gone() is None
for array in arrays:
    array[...] = 1  # spoils what lies there now
before = [array.copy() for array in arrays]
filling = [bytes([165]) * size for size in range(16, 6000)]  # takes whatever was given back
unpack(), pack()
for array, kept in zip(arrays[:2], before):
    assert array.shape == kept.shape
assert (arrays[0] == 1).all(), "the inputs' registers lie in memory that others use"
assert all(set(block) == {165} for block in filling)
print("done")
"""


def test_arrays_outlive_their_board() -> None:
    environment = os.environ | {"PYTHONMALLOC": "malloc", "MALLOC_PERTURB_": "165"}
    done = subprocess.run(
        [sys.executable, "-c", KEPT],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.stdout == "done\n", done.stderr
