"""An engine's inputs and outputs by name: what modules add to them, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from engine_steps import run

import hostmot2
from hostmot2._core import ffi, lib
from hostmot2.emulator import EmulatedBoard
from hostmot2.engine.control import context_of
from hostmot2.engine.signals import Signal
from hostmot2.errors import EngineError
from hostmot2.registers import Gtag
from tests.modules.module_card import ModuleWords, module_card, pin

STEPPERS = module_card(
    ModuleWords(Gtag.STEPGEN, 0x2000, 10, instances=2, version=2, multiple=0x1FF),
    pins=tuple(pin(Gtag.STEPGEN, 0x81 + n, unit) for unit in range(2) for n in range(2)),
)


@pytest.fixture
def engine(board: Any) -> Any:
    return board.engine(1000, dead_man=0)


@pytest.fixture
def steppers() -> Iterator[Any]:
    with hostmot2.open(EmulatedBoard(STEPPERS, clock="virtual")) as board:
        for stepgen in board.stepgens:
            stepgen.scale, stepgen.max_velocity, stepgen.max_acceleration = 100.0, 50.0, 0.0
            stepgen.set_times(step_length=1e-6, step_space=1e-6)
        yield board


def test_step_generators_are_commanded_by_name_and_off_when_it_stops(steppers: Any) -> None:
    engine = steppers.engine(1000)
    names = [f"stepgen1.{name}" for name in ("position_command", "velocity_command", "enable")]
    assert [name for name in engine.outputs if name.startswith("stepgen1")] == names
    with engine:
        engine.outputs["stepgen1.enable"] = 1
        engine.outputs["stepgen1.velocity_command"] = 20.0
        frame = run(engine, 100)
        assert frame["stepgen1.velocity"] == pytest.approx(20.0)
        assert frame["stepgen1.position"] == pytest.approx(2.0, abs=0.1)
        assert frame["stepgen0.position"] == 0.0
        assert repr(frame).endswith(", outputs on>")
        engine.disable()
        assert repr(run(engine, 3)).endswith(", outputs USER>")
        stands = run(engine, 1)["stepgen1.position"]
        assert run(engine, 20)["stepgen1.position"] == stands


def test_a_step_generator_under_position_control_goes_nowhere_before_it_is_said_where(steppers: Any) -> None:
    """One that stands at 2 must not run to 0, be it in an engine's first run or in the next."""
    stepgen = steppers.stepgens[1]
    stepgen.position_command, stepgen.enable = 2.0, True
    for _ in range(200):
        steppers.cycle.run()
        lib.hm2_board_pause_ns(steppers.handle, 1_000_000)
    engine = steppers.engine(1000, dead_man=0)
    for _ in range(2):
        with engine:
            engine.outputs["stepgen1.enable"] = 1
            for act in (engine.write, engine.enable):
                with pytest.raises(ValueError, match=r"stepgen1\.position_command; .* say where each axis"):
                    act()
            for _ in range(100):
                assert engine.step()["stepgen1.position"] == pytest.approx(2.0, abs=0.01)
            engine.outputs["stepgen1.position_command"] = 2.5
            assert run(engine, 200)["stepgen1.position"] == pytest.approx(2.5, abs=0.01)
            engine.outputs["stepgen1.position_command"] = 2.0
            assert run(engine, 200)["stepgen1.position"] == pytest.approx(2.0, abs=0.01)


def test_a_step_generator_that_is_put_under_position_control_stays_until_it_is_said_where(
    steppers: Any,
) -> None:
    engine, stepgen = steppers.engine(1000, dead_man=0), steppers.stepgens[1]
    with engine:
        engine.outputs["stepgen1.enable"] = 1
        engine.outputs["stepgen1.velocity_command"] = 20.0
        stands = run(engine, 100)["stepgen1.position"]
        stepgen.position_command = 5.0
        with pytest.raises(ValueError, match=r"stepgen1\.position_command"):
            engine.write()
        for _ in range(100):
            assert engine.step()["stepgen1.position"] == pytest.approx(stands, abs=0.1)


def test_values_print_as_lines_and_are_counted(engine: Any) -> None:
    engine.outputs["analogout0"] = 2.5
    lines = repr(engine.outputs).splitlines()
    assert len(lines) == len(engine.outputs)
    (line,) = [line for line in lines if "AnalogOut0 " in line]
    assert line.split()[1] == "2.5"


def test_an_output_is_not_deleted_and_no_name_is_there_twice(board: Any, engine: Any) -> None:
    before = list(engine.outputs)
    with pytest.raises(TypeError, match="an output cannot be deleted"):
        del engine.outputs["analogout0"]
    engine.add_command("spare")
    with pytest.raises(ValueError, match="there is an output 'spare' already"):
        engine.add_command("spare")
    word = ffi.addressof(board.sserial._core._image.cs, 0)
    engine.add_input(Signal("cs0", word, lib.HM2_SIGNAL_U32))
    with pytest.raises(ValueError, match="there is an input 'cs0' already"):
        engine.add_input(Signal("cs0", word, lib.HM2_SIGNAL_U32))
    assert list(engine.outputs) == [*before, "spare"]
    assert list(engine.input_names).count("cs0") == 1


def test_settings_that_the_engine_does_not_take_in_time_stay_as_they_were(
    engine: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    axis = engine.add_pid("x", feedback="encoder0.position", output="analogout0", p=2.0)
    axis.position = 0.0
    with engine:
        run(engine, 2)
        busy = SimpleNamespace(hm2_engine_set_pid=lambda *_: lib.HM2_ERR_BUSY, HM2_ERR_BUSY=lib.HM2_ERR_BUSY)
        with monkeypatch.context() as patched:
            patched.setattr("hostmot2.engine.axis.lib", busy)
            patched.setattr("hostmot2.engine.axis.MAILBOX_SECONDS", 0.0)
            with pytest.raises(EngineError, match="axis x: the engine takes no settings"):
                axis.tune(p=99.0)
        assert axis.settings["p"] == 2.0
        axis.tune(p=3.0)
    assert axis.settings["p"] == 3.0


def test_an_axis_that_was_never_built_has_no_error(engine: Any) -> None:
    axis = engine.add_pid("x", feedback="encoder0.position", output="analogout0", p=2.0)
    axis.position = 5.0
    assert (axis.error, axis.output) == (0.0, 0.0)


@pytest.mark.parametrize("wrong", [True, -1, 1 << 70, 1.5, "x", b"read only"])
def test_a_context_that_is_no_memory(wrong: object) -> None:
    with pytest.raises(TypeError):
        context_of(wrong)
    assert context_of(None) == ffi.NULL
