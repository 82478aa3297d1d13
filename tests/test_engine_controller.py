"""Controllers that users compile, in the engine's thread: with cffi, with gcc, with numba."""

from __future__ import annotations

import ctypes
import gc
import importlib.util
import re
import subprocess
import weakref
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import cffi
import numpy as np
import pytest
from engine_steps import run

import hostmot2
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.engine import EventKind, Off
from hostmot2.errors import EngineError

ROOT = Path(__file__).parent.parent
HEAD = "(void *context, const double *inputs, double *outputs, double seconds, int enabled)"
SOURCE = f"""
#include <math.h>

struct seen {{ double calls, enabled, seconds, count; int input, output; }};

void look{HEAD}
{{
    struct seen *seen = context;
    seen->calls += 1;
    seen->enabled = enabled;
    seen->seconds = seconds;
    seen->count = inputs[seen->input];
    outputs[seen->output] = outputs[seen->output] * 2 + 0.5;
}}

void not_a_number{HEAD}
{{
    (void)inputs; (void)seconds; (void)enabled;
    outputs[*(int *)context] = NAN;
}}

void endless{HEAD}
{{
    (void)inputs; (void)seconds; (void)enabled;
    outputs[*(int *)context] = INFINITY;
}}

double another_kind(double x) {{ return x; }}
"""
DECLARED = f"""
struct seen {{ double calls, enabled, seconds, count; int input, output; }};
void look{HEAD};
void not_a_number{HEAD};
void endless{HEAD};
double another_kind(double x);
"""


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """SOURCE as a module of cffi's, compiled out of line: `ffi`, `lib`."""
    folder = tmp_path_factory.mktemp("cffi")
    builder = cffi.FFI()
    builder.cdef(DECLARED)
    builder.set_source("controllers_of_the_tests", SOURCE)
    return module(Path(builder.compile(tmpdir=str(folder))))


def module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.name.split(".")[0], path)
    assert spec is not None
    assert spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def seen_by(compiled: Any, engine: Any) -> Any:
    context = compiled.ffi.new("struct seen *")
    context.input = engine.input_names.index("encoder0.raw_count")
    context.output = engine.outputs.index("analogout0")
    return context


# -- what it gets and what becomes of what it leaves


def test_a_function_of_cffi_gets_inputs_commands_and_time_and_its_outputs_go_out(
    board: Any, emulated: EmulatedBoard, compiled: Any
) -> None:
    emulated.encoder_input(0).set_rate(100_000.0)
    engine = board.engine(rate=500)
    seen = seen_by(compiled, engine)
    engine.add_control(compiled.ffi.addressof(compiled.lib, "look"), seen)
    with engine:
        assert engine.step().off == Off.IDLE
        assert (seen.calls, seen.enabled) == (1, 0)  # it sees inputs before anything is on
        engine.outputs["analogout0"] = 1.5
        frame = run(engine, 3)
        assert (seen.calls, seen.enabled, seen.seconds) == (4, 1, 0.002)
        assert seen.count == frame["encoder0.raw_count"] > 0
        assert frame.sent["analogout0"] == 3.5  # of what was written, not of what went out before
        run(engine, 2)
        emulated.advance(200.0)
        assert emulated.sserial[0].remote(1).get("analogout0") == pytest.approx(3.5, abs=0.01)


@pytest.mark.parametrize("overrun", ["skip", "catch-up"])
def test_periods_that_passed_before_a_late_cycle_are_told_to_that_cycle(
    board: Any, emulated: EmulatedBoard, compiled: Any, overrun: Any
) -> None:
    """Else what it takes from differences is several times too high once, and too low in the next."""
    board.watchdog.timeout = 5
    engine = board.engine(dead_man=0, overrun=overrun)
    seen = seen_by(compiled, engine)
    engine.add_control(compiled.ffi.addressof(compiled.lib, "look"), seen)
    told = []
    with engine:
        for cycle in range(24):
            if cycle in (8, 16):
                emulated.advance(3500.0 if cycle == 8 else 20_500.0)
            engine.step()
            told.append(round(seen.seconds * 1000))
    assert (told.pop(16), told.pop(8)) == (20, 3 if overrun == "skip" else 1)
    assert set(told) == {1}


def test_while_outputs_are_off_nothing_of_it_goes_out(
    board: Any, emulated: EmulatedBoard, compiled: Any
) -> None:
    engine = board.engine()
    seen = seen_by(compiled, engine)
    engine.add_control(compiled.ffi.addressof(compiled.lib, "look"), seen)
    with engine:
        assert run(engine, 3).sent["analogout0"] == 0.5
        engine.disable()
        frame = run(engine, 3)
        assert (frame.sent["analogout0"], seen.enabled, seen.calls) == (0.0, 0, 6)
    emulated.advance(200.0)
    assert emulated.sserial[0].remote(1).get("analogout0") == 0.0


def test_functions_run_in_their_order_and_then_the_axes(board: Any, compiled: Any) -> None:
    engine = board.engine()
    axis = engine.add_pid("x", feedback="encoder0.position", output="analogout1", p=1.0)
    command = engine.outputs.index("x.position")
    contexts = []
    for _ in range(2):
        seen = seen_by(compiled, engine)
        seen.output = command
        contexts.append(seen)
        engine.add_control(compiled.ffi.addressof(compiled.lib, "look"), seen)
    with engine:
        axis.position = 1.0
        assert run(engine, 2).sent["analogout1"] == (1.0 * 2 + 0.5) * 2 + 0.5


@pytest.mark.parametrize("name", ["not_a_number", "endless"])
def test_what_is_no_finite_number_turns_outputs_off(
    board: Any, emulated: EmulatedBoard, compiled: Any, name: str
) -> None:
    engine = board.engine()
    index = engine.outputs.index("analogout1")
    engine.add_control(compiled.ffi.addressof(compiled.lib, name), np.array([index], np.int32))
    with engine:
        engine.outputs["analogena"] = 1
        frame = run(engine, 4)
        assert frame.off == Off.CONTROL
        assert not frame.sent.array.any()
        assert (EventKind.CONTROL, index) in [(e.kind, e.index) for e in engine.events()]
        emulated.advance(200.0)
        assert not emulated.sserial[0].remote(1).get("analogena")
        engine.enable()
        assert run(engine, 2).off == Off.CONTROL


def test_a_function_of_a_library_is_given_by_its_address(board: Any, tmp_path: Path) -> None:
    source, library = tmp_path / "c.c", tmp_path / "c.so"
    source.write_text(SOURCE)
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", library, source], check=True)
    function = ctypes.CDLL(str(library)).not_a_number
    engine = board.engine()
    address = ctypes.cast(function, ctypes.c_void_p).value
    engine.add_control(address, ctypes.c_int(engine.outputs.index("analogout1")))
    with engine:
        assert run(engine, 2).off == Off.CONTROL


def numba() -> Any:
    return pytest.importorskip(
        "numba",
        reason="numba is not installed (pip install --group numba), or not for this Python and numpy",
        exc_type=ImportError,
    )


def test_a_function_of_numba_is_given_by_itself_or_its_address(board: Any, emulated: EmulatedBoard) -> None:
    types = numba().types
    doubles = types.CPointer(types.float64)

    @numba().cfunc(types.void(types.voidptr, doubles, doubles, types.float64, types.int32))
    def follow(_context, inputs, outputs, seconds, enabled):  # type: ignore[no-untyped-def]
        if enabled:
            outputs[0] = inputs[0] * seconds

    emulated.encoder_input(0).set_rate(100_000.0)
    for function in (follow, follow.address):
        engine = board.engine()
        first = engine.input_names.index("encoder0.position")
        assert first == 0
        engine.add_control(function)
        with engine:
            frame = run(engine, 3)
            assert frame["encoder0.position"] != 0.0
            assert frame.sent.array[0] == frame["encoder0.position"] * 0.001


def test_the_page_s_function_of_numba_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    numba()
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs/how-to/controller.md").read_text()
    (block,) = [b for b in re.findall(r"^```python\n(.*?)^```", text, re.M | re.S) if "numba" in b]
    names: dict[str, Any] = {}
    exec(compile("import hostmot2\nimport numpy as np\n" + block, "controller.md", "exec"), names)
    assert names["reached"] == pytest.approx(10.0)


# -- whose thread it is


def test_a_held_interpreter_lock_does_not_stop_it(compiled: Any) -> None:
    """usleep through PyDLL keeps the lock: a function that needed it would not be called once meanwhile."""
    sleep_us = ctypes.PyDLL(None).usleep
    with hostmot2.open(EmulatedBoard("5i25+7i77")) as board:
        board.watchdog.timeout = 5  # a stalled machine is not what is tested
        engine = board.engine(rate=1000, dead_man=0)
        seen = compiled.ffi.new("struct seen *")
        engine.add_command("command")
        seen.output = engine.outputs.index("command")
        engine.add_control(compiled.ffi.addressof(compiled.lib, "look"), seen)
        with engine:
            next(engine.frames())
            before = seen.calls
            sleep_us(300_000)
            during = seen.calls - before
        assert during > 30  # of 300, on a machine that others use, too


class Addressed:
    def __init__(self, address: Any) -> None:
        self.address = address


def test_function_and_context_live_as_long_as_the_engine(board: Any, compiled: Any) -> None:
    engine = board.engine()
    function = Addressed(
        int(compiled.ffi.cast("uintptr_t", compiled.ffi.addressof(compiled.lib, "not_a_number")))
    )
    context = np.array([engine.outputs.index("analogout1")], np.int32)
    gone = weakref.ref(function), weakref.ref(context)
    engine.add_control(function, context)
    del function, context
    gc.collect()
    assert None not in [each() for each in gone]
    with engine:
        assert run(engine, 2).off == Off.CONTROL
    assert None not in [each() for each in gone]


# -- what is refused


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        (lambda c: 0, ValueError),
        (lambda c: -1, ValueError),
        (lambda c: 1 << 64, ValueError),
        (lambda c: c.ffi.NULL, ValueError),
        (lambda c: c.ffi.cast(f"void(*){HEAD}", 0), ValueError),
        (lambda c: None, TypeError),
        (lambda c: True, TypeError),
        (lambda c: 4096.0, TypeError),
        (lambda c: "look", TypeError),
        (lambda c: Addressed("0x1234"), TypeError),
        (lambda c: lambda *anything: None, TypeError),
        (lambda c: c.lib.look, TypeError),  # cffi's way to call it, not where it is
        (lambda c: c.ffi.addressof(c.lib, "another_kind"), TypeError),
        (lambda c: c.ffi.new("struct seen *"), TypeError),
        (lambda c: c.ffi.new("double *"), TypeError),
        (lambda c: c.ffi.cast("void(*)(void *, float *, float *, double, int)", 4096), TypeError),
        (lambda c: c.ffi.cast("void(*)(void *, double *, double *, float, int)", 4096), TypeError),
        (lambda c: c.ffi.cast("void(*)(void *, double *, double *, double)", 4096), TypeError),
        (lambda c: c.ffi.cast("int(*)(void *, double *, double *, double, int)", 4096), TypeError),
        (lambda c: c.ffi.cast("void(*)(int, double *, double *, double, int)", 4096), TypeError),
        (
            lambda c: c.ffi.callback("void(void *, double *, double *, double, int)", lambda *_: None),
            TypeError,
        ),
        (lambda c: ctypes.CFUNCTYPE(None)(lambda: None), TypeError),
    ],
)
def test_what_is_no_controller_is_refused(
    board: Any, compiled: Any, wrong: Callable[[Any], Any], error: type[Exception]
) -> None:
    engine = board.engine()
    with pytest.raises(error):
        engine.add_control(wrong(compiled))
    with engine:  # nothing of it was kept
        assert run(engine, 2).off == 0


@pytest.mark.parametrize("context", [b"read-only", "text", 1.5, True, -1, object(), 1 << 64])
def test_what_is_no_context_is_refused(board: Any, compiled: Any, context: Any) -> None:
    engine = board.engine()
    with pytest.raises(TypeError, match="context"):
        engine.add_control(compiled.ffi.addressof(compiled.lib, "look"), context)


def test_not_more_than_eight_and_none_once_started(board: Any, compiled: Any) -> None:
    engine = board.engine()
    context = np.array([engine.outputs.index("analogout1")], np.int32)
    function = compiled.ffi.addressof(compiled.lib, "not_a_number")
    for _ in range(8):
        engine.add_control(function, context)
    with pytest.raises(ValueError, match="8"):
        engine.add_control(function, context)
    with engine, pytest.raises(EngineError, match="started"):
        engine.add_control(function, context)
