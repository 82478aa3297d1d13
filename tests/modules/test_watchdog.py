"""The watchdog lets go of outputs, shuts the gate and opens it only when acknowledged."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard

GPIO = 20  # on the second connector of a 5I25 with one 7I77


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


def test_the_status_after_configuration_is_no_bite(board: Board) -> None:
    assert board.read(0x0D00) & 1 == 1
    board.watchdog.arm()
    assert board.watchdog.check() is False


def test_an_output_is_driven_only_with_the_watchdog_armed(board: Board, emulated: EmulatedBoard) -> None:
    board.gpio[GPIO].drive(False)
    assert board.watchdog.armed
    assert emulated.pin(GPIO).level == "0"


def test_exchanges_keep_it_fed(board: Board, emulated: EmulatedBoard) -> None:
    board.gpio[GPIO].drive(False)
    for _ in range(10):
        emulated.advance(40_000.0)
        board.cycle.run()
    assert not board.watchdog.has_bitten
    assert emulated.pin(GPIO).level == "0"


def test_silence_lets_go_of_the_pin_and_the_next_exchange_says_so(
    board: Board, emulated: EmulatedBoard
) -> None:
    board.gpio[GPIO].drive(False)
    emulated.advance(49_000.0)
    assert emulated.pin(GPIO).level == "0"
    emulated.advance(2_000.0)
    assert emulated.pin(GPIO).level == "H"
    with pytest.raises(errors.WatchdogBite, match="50 ms"):
        board.cycle.run()


def test_after_a_bite_nothing_is_written_until_acknowledged(board: Board, emulated: EmulatedBoard) -> None:
    board.gpio[GPIO].drive(False)
    emulated.advance(60_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()
    for attempt in (
        lambda: board.gpio[GPIO].drive(False),
        lambda: board.write(0x1104, 1 << 3),
        board.cycle.run,
        board.watchdog.arm,
    ):
        with pytest.raises(errors.WatchdogBite):
            attempt()
    assert emulated.read(0x1104) == 0
    assert board.read(0x0100) == 0x55AACAFE, "reading goes on"
    board.watchdog.acknowledge()
    assert emulated.pin(GPIO).level == "H", "acknowledging switches nothing on"
    board.gpio[GPIO].drive(False)
    assert emulated.pin(GPIO).level == "0"
    board.cycle.run()


def test_close_lets_go_at_once_and_leaves_the_watchdog_bitten(emulated: EmulatedBoard) -> None:
    board = hostmot2.open(emulated)
    board.gpio[GPIO].drive(False)
    board.close()
    emulated.advance_clocks(10)
    assert emulated.pin(GPIO).level == "H"
    assert emulated.read(0x0D00) == 1


def test_an_exception_in_the_users_code_lets_go(emulated: EmulatedBoard) -> None:
    def users_code() -> None:
        with hostmot2.open(emulated) as board:
            board.gpio[GPIO].drive(False)
            raise RuntimeError("user")

    with pytest.raises(RuntimeError, match="user"):
        users_code()
    assert emulated.pin(GPIO).level == "H"


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf"), 65.0])
def test_timeouts_the_counter_cannot_hold_are_refused(board: Board, seconds: float) -> None:
    with pytest.raises(ValueError, match="outside"):
        board.watchdog.timeout = seconds


def test_five_milliseconds_are_the_sheets_number(board: Board, emulated: EmulatedBoard) -> None:
    board.watchdog.arm(0.005)
    assert emulated.read(0x0C00) == 166666  # 5 ms * 33333333 / s - 1, rounded


class Failing:
    """A board's write that fails at the chosen ones of its next calls."""

    def __init__(self, board: Board, monkeypatch: pytest.MonkeyPatch, *at: int) -> None:
        self.left = list(at)
        self.calls = 0
        self._write = board.write
        monkeypatch.setattr(board, "write", self)

    def __call__(self, address: int, words: Any) -> None:
        self.calls += 1
        if self.calls in self.left:
            raise errors.TransportTimeout("lost")
        self._write(address, words)


def test_a_bite_behind_a_lost_relaxation_is_found_and_acknowledged(
    board: Board, emulated: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    board.gpio[GPIO].drive(False)
    Failing(board, monkeypatch, 1)
    with pytest.raises(errors.TransportTimeout):
        board.watchdog.relax()
    emulated.advance(60_000.0)
    board.watchdog.acknowledge()
    board.gpio[GPIO].drive(False)
    assert emulated.pin(GPIO).level == "0"


def test_a_stall_while_it_is_armed_is_a_bite(
    board: Board, emulated: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = board.write

    def slow(address: int, words: Any) -> None:
        write(address, words)
        emulated.advance(60_000.0)

    monkeypatch.setattr(board, "write", slow)
    board.watchdog.arm()
    monkeypatch.undo()
    assert board.watchdog.check()


def test_half_an_acknowledgement_is_none_and_can_be_repeated(
    board: Board, emulated: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    board.gpio[GPIO].drive(False)
    emulated.advance(60_000.0)
    for at in range(1, 4):
        with monkeypatch.context() as patch:
            Failing(board, patch, at)
            with pytest.raises(errors.TransportTimeout):
                board.watchdog.acknowledge()
        with pytest.raises(errors.WatchdogBite):
            board.cycle.run()
    board.watchdog.acknowledge()
    board.cycle.run()
