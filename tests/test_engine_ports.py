"""Whose smart-serial ports are: taken by an engine, given up, started anew by policy, given back."""

from __future__ import annotations

import time
from typing import Any

import pytest
from engine_steps import run

import hostmot2
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.catalog import remote
from hostmot2.engine import EventKind, Off
from hostmot2.engine.restart import Restarter
from hostmot2.errors import EngineError


def kinds(engine: Any) -> list[EventKind]:
    return [event.kind for event in engine.events()]


def sent_by_hand(board: Any, emulated: EmulatedBoard, volts: float) -> float:
    """What the remote got of an output that the program sends without an engine."""
    card = board.card("7i77")
    card.analog_enable = True
    card.analog[0].volts = volts
    for _ in range(2):
        card.exchange()
        emulated.advance(1000.0)
    return float(emulated.sserial[0].remote(1).get("analogout0"))


# -- taking


def test_an_engine_does_not_start_over_channels_that_were_stopped_since_it_was_made(
    board: Any, emulated: EmulatedBoard
) -> None:
    engine = board.engine()
    board.sserial.stop()
    with pytest.raises(EngineError, match="make another one"):
        engine.start()
    assert board.cycle.engine is None
    board.sserial.start(0x01)
    with pytest.raises(EngineError, match="0x03 then, 0x01 now"):
        engine.start()
    board.sserial.start(0x03)
    with engine:
        assert run(engine, 3).off == 0


def test_an_engine_does_not_start_over_other_remotes(board: Any, emulated: EmulatedBoard) -> None:
    board.watchdog.timeout = 5  # looking at remotes takes longer than the usual 50 ms
    engine = board.engine()
    emulated.sserial[0].attach(1, remote("7i77-io"))
    board.sserial.stop()
    board.sserial.scan()
    board.sserial.start(0x03).raise_for_failed()
    with pytest.raises(EngineError, match="make another one"):
        engine.start()


def test_an_engine_that_cannot_be_built_leaves_the_ports_to_the_program(
    board: Any, emulated: EmulatedBoard
) -> None:
    engine = board.engine()
    for number in range(513):
        engine.add_command(f"c{number}")
    for _ in range(2):
        with pytest.raises(ValueError, match="512"):
            engine.start()
    assert (board.cycle.engine, engine.running) == (None, False)
    assert sent_by_hand(board, emulated, 2.0) == pytest.approx(2.0, abs=0.01)
    with board.engine() as another:
        assert run(another, 3).off == 0


# -- given up and started anew


def test_a_port_is_started_anew_as_often_as_the_policy_says(board: Any, emulated: EmulatedBoard) -> None:
    with board.engine(fault_bucket=(10, 1, 50), restart_ports=2) as engine:
        engine.outputs["analogena"] = 1
        run(engine, 5)
        for time_given_up in (1, 2, 3):
            emulated.sserial[0].remote(1).inject(bad_crc=6)
            frame = run(engine, 30)
            came_back = kinds(engine).count(EventKind.PORT_BACK)
            assert came_back == (time_given_up <= 2)
            assert frame.status.ports_given_up == (time_given_up == 3,)
            assert Off.PORT in frame.off
            assert not emulated.sserial[0].remote(1).get("analogena")
            if came_back:
                engine.enable()
                engine.outputs["analogena"] = 1
                assert run(engine, 6).off == 0


@pytest.mark.parametrize("style", ["pipelined", "read-modify-write"])
def test_a_remote_that_hears_but_is_not_heard_gets_the_zeroes_before_its_port_is_given_up(
    board: Any, emulated: EmulatedBoard, style: Any
) -> None:
    with board.engine(fault_bucket=(10, 1, 50), style=style) as engine:
        engine.outputs.update({"analogena": 1, "analogout0": 5.0})
        run(engine, 5)
        emulated.sserial[0].remote(1).inject(bad_crc=100)
        while not engine.status.ports_given_up[0]:
            run(engine, 1)
        emulated.advance(200.0)
        assert not emulated.sserial[0].remote(1).get("analogena")
        assert emulated.sserial[0].remote(1).get("analogout0") == 0.0
        engine.enable()
        assert Off.PORT in run(engine, 2).off


def test_enabling_while_a_port_is_being_given_up_turns_nothing_on(
    board: Any, emulated: EmulatedBoard
) -> None:
    with board.engine(fault_bucket=(10, 1, 50)) as engine:
        engine.outputs["analogena"] = 1
        run(engine, 5)
        emulated.sserial[0].remote(1).inject(bad_crc=100)
        while not engine.off:
            run(engine, 1)
        while not engine.status.ports_given_up[0]:
            engine.enable()
            frame = run(engine, 1)
            assert Off.PORT in frame.off
            assert not frame.sent.array.any()


def test_a_port_that_is_back_never_turns_outputs_on(board: Any, emulated: EmulatedBoard) -> None:
    """However long it runs well, and however often the program writes what it wants."""
    with board.engine(fault_bucket=(10, 1, 50), restart_ports=1) as engine:
        engine.outputs.update({"analogena": 1, "analogout0": 5.0})
        run(engine, 5)
        emulated.sserial[0].remote(1).inject(bad_crc=6)
        run(engine, 30)
        assert EventKind.PORT_BACK in kinds(engine)
        for _ in range(300):
            engine.outputs.update({"analogena": 1, "analogout0": 5.0})
            frame = run(engine, 1)
            assert Off.PORT in frame.off
            assert not frame.sent.array.any()
            assert not emulated.sserial[0].remote(1).get("analogena")
            assert emulated.sserial[0].remote(1).get("analogout0") == 0.0
        assert frame.status.port_levels == (0,)
        assert EventKind.ON not in kinds(engine)


def test_a_port_with_other_remotes_than_before_stays_given_up(board: Any, emulated: EmulatedBoard) -> None:
    with board.engine(fault_bucket=(10, 1, 50), restart_ports=1) as engine:
        run(engine, 5)
        emulated.sserial[0].attach(1, remote("7i77-io"))
        frame = run(engine, 40)
        assert Off.PORT in frame.off
        assert frame.status.ports_given_up == (True,)
        assert any("other remotes" in problem for problem in engine.restart_problems)
    # the port's process data is that of the remotes found, not that of the engine's
    board.sserial.start(0x03).raise_for_failed()
    emulated.sserial[0].remote(1).set("input", 0x1234)
    for _ in range(3):
        board.sserial.doit(0x03)
        emulated.advance(500.0)
    assert board.sserial.channels[1].inputs["input"] == 0x1234


def test_a_remote_that_stays_away_is_told_and_the_rest_goes_on(board: Any, emulated: EmulatedBoard) -> None:
    emulated.encoder_input(0).set_rate(100_000.0)
    with board.engine(fault_bucket=(10, 1, 50), restart_ports=2) as engine:
        run(engine, 5)
        emulated.sserial[0].remote(1).alive = False
        run(engine, 60)
        assert engine.status.ports_given_up == (True,)
        assert len(engine.restart_problems) == 2
        before = run(engine, 1)["encoder0.raw_count"]
        assert run(engine, 10)["encoder0.raw_count"] - before == 1000
    assert len(engine.restart_problems) == 2


def test_a_port_is_not_started_anew_for_an_engine_that_is_over(board: Any, emulated: EmulatedBoard) -> None:
    """Who stops it may have come first, while the thread that saw the port given up waited for the board."""
    with board.engine(fault_bucket=(10, 1, 50)) as engine:
        emulated.sserial[0].remote(1).inject(bad_crc=100)
        while not engine.status.ports_given_up[0]:
            run(engine, 1)
        late = Restarter(engine, 1, threaded=False)
    assert engine.status.ports_given_up == (True,)
    late.look()
    assert late.left == {0: 1}


def test_a_port_that_is_back_is_not_started_again_before_a_cycle_has_seen_it(
    board: Any, emulated: EmulatedBoard
) -> None:
    """In an engine of 20 Hz the thread looks five times between two cycles: no try was left."""
    board.watchdog.timeout = 5
    with board.engine(fault_bucket=(10, 1, 50)) as engine:
        run(engine, 5)
        emulated.sserial[0].remote(1).inject(bad_crc=6)
        assert run(engine, 30).status.ports_given_up == (True,)
        restarter = Restarter(engine, 3, threaded=False)
        for _ in range(5):
            restarter.look()
        assert (restarter.left, engine.restart_problems) == ({0: 2}, [])
        assert run(engine, 2).status.ports_given_up == (False,)


def test_a_run_begins_with_a_status_of_its_own(board: Any, emulated: EmulatedBoard) -> None:
    """Before its first cycle the last run's would be seen, a port given up among it."""
    board.watchdog.timeout = 5
    engine = board.engine(fault_bucket=(10, 1, 50))
    with engine:
        run(engine, 5)
        emulated.sserial[0].remote(1).inject(bad_crc=6)
        assert run(engine, 30).status.ports_given_up == (True,)
    board.sserial.start(0x03).raise_for_failed()
    with engine:
        status = engine.status
        assert (status.running, status.ports_given_up, engine.off) == (True, (False,), Off.IDLE)


def test_in_real_time_a_thread_starts_the_port_while_the_cycle_goes_on() -> None:
    emulated = EmulatedBoard("5i25+7i77", sserial_channels=2)
    with hostmot2.open(emulated) as board:
        board.watchdog.timeout = 5  # a stalled machine is not what is tested
        board.card("7i77").start()
        with board.engine(500, fault_bucket=(10, 1, 50), restart_ports=3, dead_man=0) as engine:
            next(engine.frames())
            cycles, seen = engine.status.cycles, set[EventKind]()
            emulated.sserial[0].remote(1).inject(bad_crc=6)
            end = time.monotonic() + 20
            while EventKind.PORT_BACK not in seen and time.monotonic() < end:
                seen |= set(kinds(engine))
                time.sleep(0.005)
            assert {EventKind.PORT_GIVEN_UP, EventKind.PORT_BACK} <= seen
            assert engine.status.cycles > cycles
            assert Off.PORT in engine.off


@pytest.mark.parametrize("wait", [0.0, 0.01, 0.02, 0.04])
def test_stopping_and_closing_meanwhile_does_not_hang(wait: float) -> None:
    emulated = EmulatedBoard("5i25+7i77", sserial_channels=2)
    with hostmot2.open(emulated) as board:
        board.watchdog.timeout = 5
        board.card("7i77").start()
        engine = board.engine(500, fault_bucket=(10, 1, 20), restart_ports=100, dead_man=0).start()
        next(engine.frames())
        emulated.sserial[0].remote(1).alive = False  # it is tried again and again
        end = time.monotonic() + 20
        while not engine.status.ports_given_up[0] and time.monotonic() < end:
            time.sleep(0.002)
        time.sleep(wait)
    assert not engine.running
