"""Nothing comes back by itself after a watchdog bite, whether anybody has seen it yet or not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from tests.emulator.test_engine_skips import CARD
from tests.emulator.test_generators import DIRECTION, PWM_A, STEP

FREE, OTHER = 33, 32


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual")


@pytest.fixture
def generators() -> EmulatedBoard:
    return EmulatedBoard(CARD, clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


@pytest.mark.parametrize(
    "action",
    [
        lambda board: board.gpio[OTHER].drive(False),
        lambda board: board.gpio[FREE].drive(True),
        lambda board: board.gpio[OTHER].let_go(),
        lambda board: board.sserial.start(0x01),
        lambda board: board.encoders,
    ],
    ids=["another pin", "the pin", "letting another go", "smart serial", "encoders"],
)
def test_an_unseen_bite_is_seen_before_any_pin_is_driven_again(
    board: Board, emulated: EmulatedBoard, action: Callable[[Board], object]
) -> None:
    board.gpio[FREE].drive(False)
    board.gpio[OTHER].drive(False)
    emulated.advance(60_000.0)
    with pytest.raises(errors.WatchdogBite):
        action(board)
    assert (emulated.pin(FREE).level, emulated.pin(OTHER).level) == ("H", "H")


def test_a_pin_switched_in_the_last_moment_is_watched_for_the_whole_time(
    board: Board, emulated: EmulatedBoard
) -> None:
    board.gpio[FREE].drive(False)
    emulated.advance(49_990.0)
    board.gpio[OTHER].drive(False)
    emulated.advance(49_900.0)
    assert emulated.pin(OTHER).level == "0"
    emulated.advance(200.0)
    assert emulated.pin(OTHER).level == "H"


def run_into_a_bite(board: Board, emulated: EmulatedBoard) -> None:
    for _ in range(5):
        board.cycle.run()
        emulated.advance(1000.0)
    emulated.advance(60_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()


def levels_while(
    board: Board, emulated: EmulatedBoard, pins: tuple[int, ...], action: Callable[[], object]
) -> set[tuple[str, ...]]:
    """All that pins showed between the writes of an action, with time passing after each."""
    seen = {tuple(emulated.pin(pin).level for pin in pins)}
    write = board.write

    def watched(address: int, words: Any) -> None:
        write(address, words)
        for _ in range(50):
            emulated.advance(1.0)
            seen.add(tuple(emulated.pin(pin).level for pin in pins))

    board.write = watched  # type: ignore[method-assign]
    action()
    del board.write  # type: ignore[method-assign]
    return seen


@pytest.mark.parametrize("pins_first", [True, False])
def test_acknowledging_moves_no_generator_and_enabling_does_not_resume(
    generators: EmulatedBoard, pins_first: bool
) -> None:
    with hostmot2.open(generators) as board:
        if pins_first:
            assert board.ioport.ports == 2
        stepgen, pwmgen = board.stepgens[0], board.pwmgens[0]
        stepgen.set_times(step_length=5e-6, step_space=5e-6)
        stepgen.velocity_command, pwmgen.value = 20_000.0, 0.5
        stepgen.enable = pwmgen.enable = True
        run_into_a_bite(board, generators)
        pins = STEP, DIRECTION, PWM_A
        assert levels_while(board, generators, pins, board.watchdog.acknowledge) == {("H", "H", "H")}
        assert (stepgen.enable, pwmgen.enable) == (False, False)
        stepgen.enable = pwmgen.enable = True
        before = generators.read(0x2100)
        for _ in range(5):
            board.cycle.run()
            generators.advance(1000.0)
        assert generators.read(0x2100) == before
        assert generators.pin(PWM_A).level == "0"
        stepgen.velocity_command = 20_000.0
        for _ in range(2):  # worked out by one exchange, written by the next
            board.cycle.run()
            generators.advance(1000.0)
        assert generators.read(0x2100) != before


def test_an_inverted_output_changes_level_by_letting_go_only(board: Board, emulated: EmulatedBoard) -> None:
    pin = board.gpio[FREE]
    pin.drive(True, invert=True)
    assert levels_while(board, emulated, (FREE,), lambda: pin.drive(False)) == {("0",), ("H",)}
    pin.drive(True, invert=True)
    assert levels_while(
        board, emulated, (FREE,), lambda: board.ioport.release([pin.descriptor])
    ) == {("0",), ("H",)}  # fmt: skip


def test_opening_a_card_that_was_left_driving_changes_no_level_but_by_letting_go(
    emulated: EmulatedBoard,
) -> None:
    emulated.write(0x1404, 1 << FREE - 17)  # inverted, low latch kept at 1
    emulated.write(0x1004, 1 << FREE - 17)
    emulated.write(0x1104, 1 << FREE - 17)
    assert emulated.pin(FREE).level == "0"
    with hostmot2.open(emulated) as board:
        assert levels_while(board, emulated, (FREE,), lambda: board.ioport) == {("0",), ("H",)}


def test_a_generator_switched_off_stops_at_once_and_does_not_start_where_it_was(
    generators: EmulatedBoard,
) -> None:
    with hostmot2.open(generators) as board:
        stepgen, pwmgen = board.stepgens[0], board.pwmgens[0]
        stepgen.velocity_command, pwmgen.value = 20_000.0, 0.5
        stepgen.enable = pwmgen.enable = True
        for _ in range(5):
            board.cycle.run()
            generators.advance(1000.0)
        stepgen.enable = pwmgen.enable = False
        before = generators.read(0x2100)
        generators.advance(1000.0)
        assert generators.read(0x2100) == before
        stepgen.velocity_command = 0.0
        stepgen.enable = True
        board.cycle.run()
        generators.advance(1000.0)
        assert generators.read(0x2100) == before


def test_switching_off_is_possible_after_a_bite(generators: EmulatedBoard) -> None:
    with hostmot2.open(generators) as board:
        stepgen, pwmgen = board.stepgens[0], board.pwmgens[0]
        stepgen.enable = pwmgen.enable = True
        run_into_a_bite(board, generators)
        stepgen.enable = pwmgen.enable = False
        board.watchdog.acknowledge()
        assert (stepgen.enable, pwmgen.enable) == (False, False)


def test_acknowledging_without_a_bite_changes_nothing(board: Board, emulated: EmulatedBoard) -> None:
    board.watchdog.acknowledge()
    board.gpio[FREE].drive(False)
    board.watchdog.acknowledge()
    assert emulated.pin(FREE).level == "0"
    assert board.watchdog.armed
    emulated.advance(60_000.0)
    assert emulated.pin(FREE).level == "H"
    board.watchdog.acknowledge()  # nobody had looked: now it is seen and acknowledged
    assert not board.watchdog.armed
    assert emulated.pin(FREE).level == "H"
