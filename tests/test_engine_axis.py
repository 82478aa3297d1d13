"""An axis of the engine: its settings while it runs and while it does not, and what it refuses."""

import math
from collections.abc import Iterator
from typing import Any

import pytest

import hostmot2
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.engine import Off
from hostmot2.engine.signals import Signal


@pytest.fixture
def engine() -> Iterator[Any]:
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        board.card("7i77").start()
        yield board.engine(rate=1000, dead_man=0)


def axis_of(engine: Any, **more: Any) -> Any:
    return engine.add_pid(
        "x", feedback="encoder0.position", output="analogout0", p=2.0, max_output=10, **more
    )


def step(engine: Any, count: int) -> None:
    for _ in range(count):
        engine.step()


def test_settings_are_taken_at_once_or_from_the_next_cycle_on(engine: Any) -> None:
    axis = axis_of(engine)
    axis.tune(p=3.0, ff0=1.0)
    assert (axis.settings["p"], axis.settings["ff0"], axis.settings["max_output"]) == (3.0, 1.0, 10)
    with engine:
        axis.position = 2.0
        engine.enable()
        step(engine, 3)
        assert axis.output == pytest.approx(3.0 * axis.error + 2.0)
        axis.tune(p=1.0)
        step(engine, 1)
        assert axis.output == pytest.approx(1.0 * axis.error + 2.0)
        assert axis.settings["p"] == 1.0
        assert repr(axis).startswith("<Axis x at 2, error 2, ")


def test_a_commanded_velocity_is_fed_forward(engine: Any) -> None:
    axis = axis_of(engine, ff1=0.5, velocity_command=True)
    with engine:
        axis.position = 0.0
        axis.velocity = 4.0
        assert axis.velocity == 4.0
        engine.enable()
        step(engine, 3)
        assert axis.output == pytest.approx(2.0 * axis.error + 0.5 * 4.0)


def test_an_axis_more_leaves_what_was_said_to_the_others(engine: Any) -> None:
    first = axis_of(engine)
    first.position = 1.5
    second = engine.add_pid("y", feedback="encoder1.position", output="analogout1", p=1.0)
    assert first.position == 1.5
    assert math.isnan(second.position)


def test_no_two_axes_have_names_that_differ_in_capitals_alone(engine: Any) -> None:
    """Names are found in any capitals: one of them would follow the other's position."""
    axis_of(engine).position = 1.0
    for add in (
        lambda: engine.add_pid("X", feedback="encoder1.position", output="analogout1"),
        lambda: engine.add_command("X.Position"),
        lambda: engine.add_input(Signal("Encoder0.Position")),
    ):
        with pytest.raises(ValueError, match="already"):
            add()
    with engine:
        engine.write()


def test_in_virtual_time_several_axes_are_tuned_between_two_cycles(engine: Any) -> None:
    """No cycle comes by itself to take one's settings before the next."""
    first = axis_of(engine)
    second = engine.add_pid("y", feedback="encoder1.position", output="analogout1", p=1.0, max_output=10)
    with engine:
        first.position = second.position = 2.0
        engine.enable()
        for axis, p in ((first, 3.0), (second, 4.0), (first, 0.5)):
            axis.tune(p=p)
        step(engine, 3)
        assert first.output == pytest.approx(0.5 * first.error)
        assert second.output == pytest.approx(4.0 * second.error)


@pytest.mark.parametrize("told", [0.0, 3.0])
def test_what_a_card_was_told_before_an_axis_was_added_goes_out(told: float) -> None:
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        card = board.card("7i77")
        card.start()
        card.analog[1].volts = 3.0 - told
        engine = board.engine(dead_man=0)
        card.analog[1].volts = told
        axis_of(engine).position = 0.0
        with engine:
            engine.write()
            step(engine, 3)
            assert engine.read().sent["analogout1"] == card.analog[1].volts == told


def test_what_was_said_last_counts_also_behind_a_write_that_was_refused(engine: Any) -> None:
    axis = axis_of(engine)
    with engine:
        engine.board.card("7i77").analog[1].volts = 5.0
        with pytest.raises(ValueError, match=r"x\.position"):
            engine.write()
        axis.position = engine.outputs["analogout1"] = 0.0
        engine.write()
        step(engine, 3)
        assert engine.read().sent["analogout1"] == 0.0


def test_nothing_goes_out_before_it_is_said_where_an_axis_shall_be_not_even_in_the_next_run(
    engine: Any,
) -> None:
    """An axis that stands at 5 must not run to 0 because a program enables before it says a position."""
    axis = axis_of(engine)
    with engine:
        for act in (engine.write, engine.enable):
            with pytest.raises(ValueError, match=r"x\.position; .* say where each axis shall be"):
                act()
        step(engine, 2)
        assert engine.off == Off.IDLE
        axis.position = 5.0
        engine.enable()
        step(engine, 2)
        assert engine.off == 0
    with engine:
        engine.outputs["analogena"] = 1
        with pytest.raises(ValueError, match=r"x\.position"):
            engine.enable()
        step(engine, 2)
        assert engine.off == Off.IDLE
        axis.position = float("inf")
        with pytest.raises(ValueError, match=r"x\.position"):
            engine.write()


@pytest.mark.parametrize(
    ("setting", "refusal"),
    [
        ({"speed": 1.0}, TypeError),
        ({"max_output": float("nan")}, ValueError),
        *(({name: -1.0}, ValueError) for name in ("max_output", "max_integral", "max_error", "deadband")),
    ],
)
def test_settings_that_cannot_be_are_refused_and_change_nothing(
    engine: Any, setting: Any, refusal: Any
) -> None:
    axis = axis_of(engine)
    before = axis.settings
    with pytest.raises(refusal):
        axis.tune(**setting)
    assert axis.settings == before


def test_settings_changed_while_stopped_hold_for_the_next_run(engine: Any) -> None:
    axis = axis_of(engine)
    with engine:
        axis.position = 2.0
        engine.enable()
        step(engine, 3)
    for p in (1.5, 0.25):  # the last one counts
        axis.tune(p=p, max_output=1.0)
    with engine:
        axis.position = 2.0
        engine.enable()
        step(engine, 3)
        assert axis.output == pytest.approx(0.25 * axis.error)
        axis.position = 100.0
        engine.write()
        step(engine, 3)
        assert axis.output == 1.0


def test_an_engine_has_room_for_sixteen_axes_and_says_so_when_one_too_many_is_added() -> None:
    with hostmot2.open("emu://5i25+7i77?clock=virtual") as board:
        board.sserial.start(0x03)
        engine = board.engine()
        for number in range(16):
            engine.add_pid(f"x{number}", feedback="encoder0.position", output="analogout0")
        with pytest.raises(ValueError, match="16 axes"):
            engine.add_pid("x16", feedback="encoder0.position", output="analogout0")
        assert "x16.position" not in engine.outputs
        with engine:
            engine.step()
