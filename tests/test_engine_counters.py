"""Counters in process data (MPG wheels of a 7I77, 8 bits): the engine and the program count as one."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import pytest

import hostmot2
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.errors import EngineError

PER_UNIT = 255.0  # counts, unless configured otherwise: what the remote states as its maximum (sserial.md 6)


class Wheel:
    """An MPG on input 16: where it is, and what the remote's 8 bits show of it."""

    def __init__(self, emulated: EmulatedBoard) -> None:
        self._remote: Any = emulated.sserial[0].remote(0)
        self.at = 0

    def turn(self, counts: int) -> None:
        self.at += counts
        self._remote.set("enc0", self.at % 256)


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Any]:
    with hostmot2.open(emulated) as opened:
        card = opened.card("7i77")
        card.mode = 3
        card.start()
        yield opened


@pytest.fixture
def wheel(emulated: EmulatedBoard, board: Any) -> Wheel:
    made = Wheel(emulated)
    made.turn(0)
    exchange(board)
    return made


def exchange(board: Any) -> None:
    board.card("7i77").exchange()
    board.pause(0.001)


def run(engine: Any, cycles: int = 3) -> Any:
    for _ in range(cycles):
        engine.write()
        frame = engine.step()
    return frame


def turn(wheel: Wheel, counts: int, then: Any) -> None:
    """So far in steps that 8 bits can tell."""
    step = 100 if counts > 0 else -100
    for _ in range(abs(counts) // 100):
        wheel.turn(step)
        then()


def count(board: Any) -> int:
    """As the program has it."""
    return int(board.card("7i77").mpg[0])


def test_an_engine_counts_on_where_the_program_was(board: Any, wheel: Wheel) -> None:
    turn(wheel, 700, lambda: exchange(board))
    assert count(board) == 700
    with board.engine() as engine:
        assert run(engine)["enc0"] == 700 / PER_UNIT
        assert count(board) == 700
        turn(wheel, -1500, lambda: run(engine))
        assert engine.read()["enc0"] == -800 / PER_UNIT
        assert count(board) == -800


def test_the_program_counts_on_where_the_engine_was(board: Any, wheel: Wheel) -> None:
    with board.engine() as engine:
        turn(wheel, 1000, lambda: run(engine))
    assert count(board) == 1000
    exchange(board)
    assert count(board) == 1000
    turn(wheel, 300, lambda: exchange(board))
    assert count(board) == wheel.at == 1300


def test_what_was_not_read_before_the_engine_stopped_is_not_lost(board: Any, wheel: Wheel) -> None:
    with board.engine() as engine:
        for _ in range(10):
            wheel.turn(100)
            for _ in range(3):  # no read() but that of step()
                engine.step()
        wheel.turn(50)
    exchange(board)
    exchange(board)
    assert count(board) == 1050


def test_any_order_of_engines_and_exchanges_counts_as_a_wheel_without_end(board: Any, wheel: Wheel) -> None:
    chance = random.Random(7)
    for _ in range(12):
        if chance.random() < 0.5:
            with board.engine() as engine:
                for _ in range(chance.randint(0, 4)):
                    wheel.turn(chance.randint(-127, 127))
                    frame = run(engine)
                    assert (frame["enc0"], count(board)) == (wheel.at / PER_UNIT, wheel.at)
        else:
            for _ in range(chance.randint(1, 4)):
                wheel.turn(chance.randint(-127, 127))
                exchange(board)
                assert count(board) == wheel.at


def test_an_engine_started_again_counts_on(board: Any, wheel: Wheel) -> None:
    engine = board.engine()
    with engine:
        turn(wheel, 500, lambda: run(engine))
    turn(wheel, 500, lambda: exchange(board))
    with engine:
        assert run(engine)["enc0"] == 1000 / PER_UNIT


def test_counts_are_shown_whatever_their_scale(board: Any, wheel: Wheel) -> None:
    inputs = board.card("7i77").field_io_channel.inputs
    engine = board.engine()
    inputs.configure("enc0", scale=-3.0)  # after the engine was made
    with engine:
        turn(wheel, 700, lambda: run(engine))
        assert inputs["enc0"] == run(engine)["enc0"] == 700 / -3.0
        assert inputs.raw("enc0") == 700
        turn(wheel, -800, lambda: run(engine))
        assert inputs.raw("enc0") == -100
    assert inputs.raw("enc0") == -100


def test_a_counter_is_zeroed_while_the_engine_runs(board: Any, wheel: Wheel) -> None:
    inputs = board.card("7i77").field_io_channel.inputs
    with board.engine() as engine:
        turn(wheel, 700, lambda: run(engine))
        inputs.zero("enc0")
        assert run(engine)["enc0"] == 0
        turn(wheel, 200, lambda: run(engine))
        assert (count(board), inputs.raw("enc0")) == (200, 200)
    wheel.turn(10)
    exchange(board)
    exchange(board)
    assert count(board) == 210


def test_scaling_stays_as_it_is_while_the_engine_runs(board: Any, wheel: Wheel) -> None:
    inputs = board.card("7i77").field_io_channel.inputs
    outputs = board.card("7i77").analog_channel.outputs
    with board.engine():
        with pytest.raises(EngineError, match="stop it first"):
            inputs.configure("enc0", scale=4.0)
        with pytest.raises(EngineError, match="stop it first"):
            outputs.configure("analogout0", high=1.0)
    inputs.configure("enc0", scale=4.0)
    assert inputs.scaling("enc0").scale == 4.0


def test_limits_set_before_start_hold_in_the_engine(
    board: Any, emulated: EmulatedBoard, wheel: Wheel
) -> None:
    card = board.card("7i77")
    engine = board.engine()
    card.analog_channel.outputs.configure("analogout0", low=-1.0, high=1.0)
    with engine:
        card.analog_enable = True
        card.analog[0].volts = 5.0
        run(engine, 5)
        emulated.advance(200.0)
        assert emulated.sserial[0].remote(1).get("analogout0") == pytest.approx(1.0, abs=0.01)
