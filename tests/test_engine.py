"""The cycle engine on an emulated card with virtual time: what goes out when, and what turns it off."""

from __future__ import annotations

import ctypes
import math
import subprocess
from typing import Any

import numpy as np
import pytest
from engine_steps import run

import hostmot2
from hostmot2._core import ffi, lib
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.plant import couple_dc_motor
from hostmot2.engine import EventKind, Off
from hostmot2.engine.signals import Signal
from hostmot2.errors import EngineError
from hostmot2.record_ring import STAGES
from hostmot2.registers import Gtag, Sserial

MS = 0.001


def analog(emulated: EmulatedBoard) -> Any:
    return emulated.sserial[0].remote(1)


def kinds(engine: Any) -> list[tuple[EventKind, int]]:
    return [(event.kind, event.value) for event in engine.events()]


# -- what is moved


@pytest.mark.parametrize(("style", "exchanges"), [("pipelined", 1), ("read-modify-write", 2)])
def test_a_cycle_is_one_exchange_pipelined_and_two_in_read_modify_write(
    board: Any, style: Any, exchanges: int
) -> None:
    with board.engine(style=style) as engine:
        run(engine, 5)
        before = board.counters["exchanges"]
        run(engine, 10)
        assert board.counters["exchanges"] - before == 10 * exchanges


@pytest.mark.parametrize(("style", "later"), [("pipelined", 1), ("read-modify-write", 0)])
def test_outputs_of_a_record_are_in_its_own_words_or_pipelined_in_the_next_one_s(
    board: Any, style: Any, later: int
) -> None:
    engine = board.engine(style=style)
    ring = engine.record()
    with engine:
        for volts in range(8):
            engine.outputs["analogout0"] = volts
            run(engine, 1)
        layout = engine.layout()
        records, place = ring.pop(), engine.outputs.index("analogout0")
    word = layout.index((board.module(Gtag.SSERIAL).register_address(Sserial.user0.number, 0, 1), True))
    sent = np.round((records["words"][:, word] & 0xFFF) / 409.5)
    assert sent[later:].tolist() == records["outputs"][: 8 - later, place].tolist()


@pytest.mark.parametrize("style", ["pipelined", "read-modify-write"])
def test_smart_serial_takes_seven_reads_and_five_writes_at_most(style: Any) -> None:
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        card = board.card("7i77")
        card.mode = 2  # inputs, analog inputs, field voltage: three registers
        card.start()

        def words(of: Any) -> tuple[int, int]:
            run(of, 5)
            before = board.counters
            run(of, 10)
            after = board.counters
            return tuple((after[k] - before[k]) // 10 for k in ("words_read", "words_written"))  # type: ignore

        with board.engine(style=style) as engine:
            everything = words(engine)
            doits = board.sserial.transfers["doits"]
            run(engine, 10)
            assert board.sserial.transfers["doits"] == doits + 10
        card.stop()
        with board.engine(style=style) as engine:
            others = words(engine)
        assert everything[0] - others[0] <= 7
        assert everything[1] - others[1] <= 5


@pytest.mark.parametrize(("style", "cycles"), [("pipelined", 2), ("read-modify-write", 1)])
def test_outputs_reach_the_remote_after_as_many_cycles(
    board: Any, emulated: EmulatedBoard, style: Any, cycles: int
) -> None:
    with board.engine(style=style) as engine:
        run(engine, 3)
        engine.outputs["analogout3"] = 5.0
        engine.outputs["analogena"] = 1
        engine.write()
        run(engine, cycles)
        emulated.advance(200.0)
        assert analog(emulated).get("analogout3") == pytest.approx(5.0, abs=0.01)
        assert analog(emulated).get("analogena") is True


def test_what_cards_are_told_goes_out_and_what_comes_in_they_show(
    board: Any, emulated: EmulatedBoard
) -> None:
    card = board.card("7i77")
    with board.engine() as engine:
        card.analog[2].volts = -3.0
        card.analog_enable = True
        card.outputs[5] = True
        emulated.sserial[0].remote(0).set("input", 0x80000001)
        run(engine, 4)
        assert analog(emulated).get("analogout2") == pytest.approx(-3.0, abs=0.01)
        assert emulated.sserial[0].remote(0).get("output") == 1 << 5
        assert card.inputs == 0x80000001
        assert engine.outputs["analogout2"] == -3.0


def test_an_assignment_to_the_array_wins_over_what_the_card_was_told_before(board: Any) -> None:
    card = board.card("7i77")
    with board.engine() as engine:
        card.analog[0].volts = 1.0
        engine.write()
        engine.outputs.array[engine.outputs.index("analogout0")] = 2.0
        engine.write()
        assert card.analog[0].volts == 2.0
        card.analog[0].volts = 3.0
        engine.write()
        assert engine.outputs["analogout0"] == 3.0


def test_names_work_in_any_capitals_and_by_their_unique_end(board: Any) -> None:
    engine = board.engine()
    assert engine.outputs.index("SSERIAL0.1.ANALOGOUT0") == engine.outputs.index("analogout0")
    with pytest.raises(KeyError, match=r"encoder0\.position, encoder1\.position"):
        engine._vectors.input_names["position"]


def test_a_frame_is_of_one_cycle(board: Any, emulated: EmulatedBoard) -> None:
    emulated.encoder_input(0).set_rate(100_000.0)
    with board.engine() as engine:
        frames = [engine.step() for _ in range(6)][1:]
        assert [frame.cycle for frame in frames] == [1, 2, 3, 4, 5]
        counts = [frame["encoder0.raw_count"] for frame in frames]
        assert np.diff(counts).tolist() == [100.0] * 4


# -- outputs are off until asked for, and on every way out


def test_outputs_are_off_until_the_first_write(board: Any, emulated: EmulatedBoard) -> None:
    with board.engine() as engine:
        engine.outputs["analogout0"] = 5.0
        frame = run(engine, 3, write=False)
        assert frame.off == Off.IDLE
        assert analog(emulated).get("analogout0") == 0.0
        assert run(engine, 2).off == 0
        assert kinds(engine) == [(EventKind.ON, 0)]


def test_dead_man_zeroes_outputs_drops_enables_and_only_enable_turns_them_on(
    board: Any, emulated: EmulatedBoard
) -> None:
    with board.engine(dead_man=20 * MS) as engine:
        engine.outputs.update({"analogout0": 5.0, "analogena": 1})
        assert run(engine, 5).off == 0
        assert run(engine, 19, write=False).off == 0
        frame = run(engine, 3, write=False)
        assert frame.off == Off.DEAD_MAN
        assert frame.sent["analogout0"] == frame.sent["analogena"] == 0.0
        emulated.advance(200.0)
        assert analog(emulated).get("analogena") is False
        assert analog(emulated).get("analogout0") == 0.0
        cycle = frame.cycle
        frame = run(engine, 5)
        assert frame.cycle == cycle + 5
        assert frame.off == Off.DEAD_MAN
        engine.enable()
        assert run(engine, 2).off == 0
        assert kinds(engine) == [
            (EventKind.ON, 0),
            (EventKind.OFF, Off.DEAD_MAN),
            (EventKind.ON, 0),
        ]


def test_disable_holds_until_enable(board: Any) -> None:
    with board.engine() as engine:
        engine.outputs["analogout0"] = 5.0
        run(engine, 2)
        engine.disable()
        assert run(engine, 3).off == Off.USER
        engine.enable()
        assert run(engine, 1).sent["analogout0"] == 5.0


@pytest.mark.parametrize("style", ["pipelined", "read-modify-write"])
def test_stop_sends_zeroes(board: Any, emulated: EmulatedBoard, style: Any) -> None:
    card = board.card("7i77")
    engine = board.engine(style=style).start()
    card.analog_enable = True
    card.analog[0].volts = 5.0
    run(engine, 4)
    assert analog(emulated).get("analogena") is True
    engine.stop()
    emulated.advance(200.0)
    assert analog(emulated).get("analogena") is False
    assert analog(emulated).get("analogout0") == 0.0
    assert card.analog_enable is False
    assert engine.off == Off.STOP
    emulated.advance(200_000.0)
    board.cycle.run()  # the watchdog was disarmed
    engine.stop()


def test_leaving_the_loop_by_an_exception_turns_outputs_off(board: Any, emulated: EmulatedBoard) -> None:
    card = board.card("7i77")

    def work() -> None:
        for frame in board.cycle(rate=2000):
            card.analog_enable = True
            if frame.cycle == 10:
                assert analog(emulated).get("analogena") is True
                raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        work()
    emulated.advance(200.0)
    assert analog(emulated).get("analogena") is False
    assert board.cycle.engine is None or not board.cycle.engine.running


def test_a_loop_of_so_many_seconds_has_so_many_frames(board: Any) -> None:
    assert len(list(board.cycle(rate=1000, seconds=0.05))) == 50


def test_closing_the_board_stops_the_engine(emulated: EmulatedBoard) -> None:
    with hostmot2.open(emulated) as board:
        card = board.card("7i77")
        card.start()
        engine = board.engine().start()
        card.analog_enable = True
        run(engine, 4)
    assert not engine.running
    assert analog(emulated).get("analogena") is False
    with pytest.raises(EngineError):
        engine.write()


# -- faults


def test_a_fault_of_a_remote_turns_outputs_off(board: Any, emulated: EmulatedBoard) -> None:
    with board.engine() as engine:
        run(engine, 3)
        analog(emulated).fault = 0x08
        frame = run(engine, 3)
        assert Off.FAULT in frame.off
        analog(emulated).fault = 0
        assert Off.FAULT in run(engine, 5).off
        events = engine.events()
        assert next(e.index for e in events if e.kind is EventKind.PORT_FAULT) == 1


def test_outputs_stay_off_beside_a_remote_whose_watchdog_has_bitten(
    board: Any, emulated: EmulatedBoard
) -> None:
    """Process data alone feeds it, so a pause between two runs is enough."""

    def output(engine: Any) -> tuple[Off, object]:
        engine.outputs["output"] = 8
        engine.write()
        return run(engine, 5).off, emulated.sserial[0].remote(0).get("output")

    engine = board.engine()
    with engine:
        assert output(engine) == (0, 8)
    board.pause(0.2)
    for _ in range(2):  # an edge is seen once only
        with engine:
            assert Off.FAULT in output(engine)[0]
            engine.enable()
            assert output(engine) == (Off.FAULT, 0)
    board.sserial.start(board.sserial.started).raise_for_failed()
    with engine:
        assert output(engine) == (0, 8)


def test_lost_replies_fill_the_bucket_and_good_ones_empty_it(board: Any, emulated: EmulatedBoard) -> None:
    with board.engine(fault_bucket=(10, 1, 200)) as engine:
        run(engine, 5)
        analog(emulated).inject(bad_crc=3)
        assert run(engine, 3).off == 0
        assert 20 <= engine.status.port_levels[0] <= 30
        run(engine, 40)
        assert engine.status.port_levels == (0,)
        assert engine.status.ports_given_up == (False,)


def test_a_full_bucket_gives_the_port_up(board: Any, emulated: EmulatedBoard) -> None:
    with board.engine(fault_bucket=(10, 1, 50)) as engine:
        engine.outputs["analogena"] = 1
        run(engine, 5)
        analog(emulated).inject(bad_crc=20)
        frame = run(engine, 10)
        assert Off.PORT in frame.off
        assert engine.status.ports_given_up == (True,)
        assert engine.status.port_levels[0] >= 50
        engine.enable()
        assert Off.PORT in run(engine, 2).off
        assert (EventKind.PORT_GIVEN_UP, 50) in kinds(engine)
        board.sserial.stop()  # the port is everybody's again


def test_by_policy_a_port_is_started_anew_with_its_outputs_off(board: Any, emulated: EmulatedBoard) -> None:
    with board.engine(fault_bucket=(10, 1, 50), restart_ports=1) as engine:
        engine.outputs["analogena"] = 1
        run(engine, 5)
        analog(emulated).inject(bad_crc=6)
        run(engine, 15)
        assert EventKind.PORT_BACK in [event.kind for event in engine.events()]
        frame = run(engine, 5)
        assert Off.PORT in frame.off
        assert analog(emulated).get("analogena") is False
        engine.enable()
        assert run(engine, 6).off == 0
        assert analog(emulated).get("analogena") is False  # a start makes outputs zero
        engine.outputs["analogena"] = 1
        run(engine, 4)
        assert analog(emulated).get("analogena") is True


def test_a_bite_turns_outputs_off_and_the_view_stays(board: Any, emulated: EmulatedBoard) -> None:
    with board.engine() as engine:
        run(engine, 3)
        emulated.advance(60_000.0)
        frame = run(engine, 3)
        assert Off.BITE in frame.off
        assert frame.status.failures == 0
        cycle = frame.cycle
        assert run(engine, 2).cycle == cycle + 2


def test_outputs_enabled_again_behind_a_bite_are_watched_again() -> None:
    """An engine without smart serial runs on, and if nobody arms the watchdog so do motors when it dies."""
    emulated = EmulatedBoard("7i96", clock="virtual")
    with hostmot2.open(emulated) as board, board.engine(dead_man=0) as engine:
        assert run(engine, 3).off == 0
        for _ in range(2):
            emulated.advance(60_000.0)
            assert run(engine, 2).off == Off.BITE
            engine.enable()
            assert run(engine, 2).off == Off.BITE
            board.watchdog.acknowledge()
            assert run(engine, 2).off == Off.BITE
            engine.enable()
            assert run(engine, 2).off == 0
            assert board.watchdog.armed


def test_a_bite_that_was_acknowledged_between_two_cycles_turns_outputs_off_all_the_same() -> None:
    emulated = EmulatedBoard("7i96", clock="virtual")
    with hostmot2.open(emulated) as board, board.engine(dead_man=0) as engine:
        assert run(engine, 3).off == 0
        emulated.advance(60_000.0)
        board.watchdog.acknowledge()
        assert run(engine, 2).off == Off.BITE
        engine.enable()
        assert run(engine, 2).off == 0
        assert board.watchdog.armed


# -- controllers


def test_the_built_in_pid_brings_an_axis_to_its_place(emulated: EmulatedBoard) -> None:
    motor = couple_dc_motor(emulated, axis=0)
    with hostmot2.open(emulated) as board:
        card = board.card("7i77")
        card.start()
        board.encoders[0].scale = 4000
        engine = board.engine(rate=1000)
        axis = engine.add_pid(
            "x", feedback="encoder0.position", output="analogout0", p=20, i=20, d=0.4, max_output=10
        )
        with engine:
            card.analog_enable = True
            axis.position = 0.0
            run(engine, 5)
            axis.position = 1.0
            track = [run(engine, 1)["encoder0.position"] for _ in range(1500)]
            assert motor.turns == pytest.approx(1.0, abs=0.01)
            assert max(track) < 1.25
            assert axis.error == pytest.approx(0.0, abs=0.01)


def test_exceeding_the_following_error_turns_everything_off(board: Any) -> None:
    engine = board.engine()
    axis = engine.add_pid("x", feedback="encoder0.position", output="analogout0", p=1, max_error=0.5)
    with engine:
        engine.outputs["analogena"] = 1
        axis.position = 0.0
        assert run(engine, 3).off == 0
        axis.position = 0.4
        assert run(engine, 2).off == 0
        axis.position = 0.6
        frame = run(engine, 2)
        assert frame.off == Off.ERROR
        assert frame.sent["analogena"] == 0.0
        assert EventKind.AXIS in [event.kind for event in engine.events()]
        axis.position = 0.0
        engine.enable()
        assert run(engine, 2).off == 0


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("control")
    (folder / "control.c").write_text(
        "void twice(void *context, const double *in, double *out, double seconds, int enabled)\n"
        "{ (void)in; (void)seconds; (void)enabled; out[*(int *)context] *= 2.0; }\n"
        "void nonsense(void *context, const double *in, double *out, double seconds, int enabled)\n"
        "{ (void)in; (void)seconds; if (enabled) out[*(int *)context] = 0.0 / 0.0; }\n"
    )
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", folder / "control.so", folder / "control.c"], check=True)
    return ctypes.CDLL(str(folder / "control.so"))


def control(compiled: Any, name: str, output: int) -> tuple[int, int, Any]:
    context = ctypes.c_int(output)
    address = ctypes.cast(getattr(compiled, name), ctypes.c_void_p).value
    assert address is not None
    return address, ctypes.addressof(context), context


def test_a_compiled_controller_runs_between_inputs_and_outputs(board: Any, compiled: Any) -> None:
    engine = board.engine()
    address, context, _keep = control(compiled, "twice", engine.outputs.index("analogout0"))
    engine.add_control(address, context)
    with engine:
        engine.outputs["analogout0"] = 1.5
        assert run(engine, 2).sent["analogout0"] == 3.0
        engine.disable()
        assert run(engine, 2).sent["analogout0"] == 0.0


def test_what_is_not_a_number_never_goes_out(board: Any, compiled: Any) -> None:
    engine = board.engine()
    address, context, _keep = control(compiled, "nonsense", engine.outputs.index("analogout1"))
    engine.add_control(address, context)
    with engine:
        frame = run(engine, 2)
        assert frame.off == Off.CONTROL
        assert frame.sent["analogout1"] == 0.0
        engine.outputs["analogout0"] = float("nan")
        with pytest.raises(ValueError, match="AnalogOut0"):
            engine.write()


# -- whose board it is


def test_while_it_runs_the_cycle_and_its_ports_are_the_engines(board: Any) -> None:
    with board.engine() as engine:
        run(engine, 3)
        for attempt in (board.cycle.run, board.cycle.read, board.sserial.doit, board.sserial.stop):
            with pytest.raises(EngineError):
                attempt()
        assert board.read(0x0100) == 0x55AACAFE
        assert board.sserial.channels[0].status is not None
        with pytest.raises(EngineError, match="another engine"):
            board.engine().start()
    board.sserial.doit()


def test_an_engine_that_cannot_be_made_gives_the_ports_back(
    board: Any, emulated: EmulatedBoard, monkeypatch: Any
) -> None:
    def refuse(*_arguments: Any) -> Any:
        raise MemoryError("engine")

    engine = board.engine()
    monkeypatch.setattr("hostmot2.engine.engine.build", refuse)
    with pytest.raises(MemoryError):
        engine.start()
    board.sserial.channels[1].outputs["analogena"] = 1
    board.sserial.doit()
    assert analog(emulated).get("analogena") == 1
    monkeypatch.undo()
    with engine:
        run(engine, 2)


def test_a_started_engine_takes_no_more_parts(board: Any) -> None:
    with board.engine() as engine:
        with pytest.raises(EngineError):
            engine.add_command("late")
        with pytest.raises(EngineError):
            engine.record()


def test_an_engine_starts_again_with_outputs_off(board: Any) -> None:
    engine = board.engine()
    for _ in range(3):
        with engine:
            engine.outputs["analogout0"] = 1.0
            assert run(engine, 2, write=False).off == Off.IDLE
            assert run(engine, 2).sent["analogout0"] == 1.0
        assert engine.outputs["analogout0"] == 0.0


@pytest.mark.parametrize(
    "options",
    [
        *({"rate": rate} for rate in (0, 1e6)),
        {"style": "x"},
        {"overrun": "x"},
        *({name: wrong} for name in ("dead_man", "early") for wrong in (-1, math.inf, math.nan, 1e12)),
        *({"reply_timeout": wrong} for wrong in (0, -1, math.inf, math.nan)),
        {"stale_limit": -1},
        {"overrun_limit": -1},
        {"fault_bucket": (10, -1, 200)},
        {"fault_bucket": (10, 1)},
    ],
)
def test_options_that_cannot_be_are_refused(board: Any, options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"rate|style|overrun|dead_man|reply_timeout|fault_bucket"):
        board.engine(**options)


# -- records


def test_every_cycle_has_a_record_of_registers_and_values(board: Any, emulated: EmulatedBoard) -> None:
    emulated.encoder_input(0).set_rate(100_000.0)
    engine = board.engine(style="pipelined")
    ring = engine.record(slots=256, words=64)
    with engine:
        engine.outputs["analogout0"] = 2.5
        run(engine, 20)
        records, layout = ring.pop(), engine.layout()
    assert records["cycle"].tolist() == list(range(20))
    assert np.diff(records["start_ns"]).tolist() == [1_000_000] * 19
    assert set(records["image_words"][10:]) == {len(layout)}
    assert records["outputs"][-1, engine.outputs.index("analogout0")] == 2.5
    assert records["inputs"][-1, 2] - records["inputs"][-2, 2] == 100.0
    base = next(m for m in board.modules if m.gtag == Gtag.SSERIAL).base
    command_read, command_write = layout.index((base, False)), layout.index((base, True))
    assert records["words"][-1, command_read] == 0
    assert (
        records["words"][-1, command_write] == 0x1000 | board.sserial.started
        or records["words"][-1, command_write]
    )
    fresh = records["fresh"][-1, command_write // 32] >> (command_write % 32) & 1
    assert fresh == 1
    assert records["flags"][0] == Off.IDLE or records["flags"][0] == 0


def test_the_trace_counts_every_stage_of_every_cycle(board: Any) -> None:
    with board.engine() as engine:
        run(engine, 30)
        trace = engine.trace()
        assert list(trace) == [*STAGES, "cycle", "after"]
        assert {len(histogram) for histogram in trace.values()} == {30}
        assert len(engine.slowest()) == 16
        engine.reset_trace()
        run(engine, 2)
        assert len(engine.trace()["cycle"]) <= 2


# -- what others get of it


def test_a_port_is_lent_between_two_doits_and_its_channels_run_on(
    board: Any, emulated: EmulatedBoard
) -> None:
    card = board.card("7i77")
    with board.engine() as engine:
        card.outputs[5] = True
        run(engine, 5)
        emulated.sserial[0].remote(1).inject(bad_crc=1)
        run(engine, 5)
        with engine.lend(board.sserial[0]):
            counted = board.sserial.counters()
            doits = board.sserial.transfers["doits"]
            run(engine, 3)
            assert board.sserial.transfers["doits"] == doits  # the cycle goes on without it
        assert (counted[0].crc_errors, counted[1].crc_errors) == (0, 1)
        run(engine, 5)
        assert board.sserial.transfers["doits"] > doits
        assert emulated.sserial[0].remote(0).get("output") == 1 << 5
        assert not engine.off
        assert EventKind.PORT_BACK not in [kind for kind, _ in kinds(engine)]
        with pytest.raises(EngineError):
            board.sserial.counters()


def test_a_port_that_is_not_the_engines_or_was_given_up_is_not_lent(
    board: Any, emulated: EmulatedBoard
) -> None:
    with board.engine() as engine, hostmot2.open(EmulatedBoard("5i25+7i77")) as other:
        run(engine, 3)
        with pytest.raises(EngineError, match="no running engine"), engine.lend(other.sserial[0]):
            pass
        emulated.sserial[0].remote(0).alive = False
        run(engine, 40)
        assert engine.status.ports_given_up == (True,)
        with pytest.raises(EngineError, match="given up"), engine.lend(board.sserial[0]):
            pass
    with pytest.raises(EngineError, match="no running engine"), engine.lend(board.sserial[0]):
        pass


def test_channels_stopped_while_their_port_was_lent_turn_outputs_off(board: Any) -> None:
    with board.engine(dead_man=0) as engine:
        run(engine, 3)
        with engine.lend(board.sserial[0]):
            board.sserial[0].stop(0x02)
        assert run(engine, 1).off == Off.PORT
        assert str(engine.events()[-2]).endswith("given up: its channels were stopped")
        assert run(engine, 4).status.ports_given_up == (True,)


@pytest.mark.parametrize("close", [False, True])
def test_an_engine_stopped_while_its_port_is_lent_sends_the_zeroes_and_leaves_the_port(
    board: Any, emulated: EmulatedBoard, close: bool
) -> None:
    card = board.card("7i77")
    remote = emulated.sserial[0].remote(0)
    with board.engine(dead_man=0) as engine:
        card.outputs[5] = True
        run(engine, 5)
        assert remote.get("output") == 1 << 5
        with engine.lend(board.sserial[0]):
            board.close() if close else engine.stop()
            assert remote.get("output") == 0
        if not close:
            card.outputs[6] = True
            card.exchange()
            assert remote.get("output") == 1 << 6


def test_channels_taken_out_of_a_running_engines_cycle_turn_outputs_off(board: Any) -> None:
    with board.engine(dead_man=0) as engine:
        run(engine, 3)
        board.sserial[0].cyclic = 0x01
        assert run(engine, 1).off == Off.PORT


def test_stopping_while_a_port_is_asked_for_still_sends_the_zeroes(
    board: Any, emulated: EmulatedBoard
) -> None:
    card = board.card("7i77")
    with board.engine(style="pipelined") as engine:
        card.outputs[5] = True
        run(engine, 5)
        assert emulated.sserial[0].remote(0).get("output") == 1 << 5
        lib.hm2_engine_lend_port(engine.handle, 0, 1)
        engine.step()  # held back, but a DOIT is still on its way
    emulated.advance(200.0)
    assert emulated.sserial[0].remote(0).get("output") == 0


def test_any_number_that_the_cycle_reads_can_be_an_input(board: Any) -> None:
    cs = ffi.addressof(board.sserial._core._image.cs, 1)
    engine = board.engine()
    engine.add_input(Signal("cs1", cs, lib.HM2_SIGNAL_U32))
    with engine:
        run(engine, 5)
        assert int(engine.read()["cs1"]) & 0xFF00FFFF == 0
        assert int(engine.read()["cs1"]) >> 16 & 0xFF in (0x42, 0x43)


def test_readings_before_the_first_transfer_are_the_last_ones(emulated: EmulatedBoard, board: Any) -> None:
    field = emulated.sserial[0].remote(0)
    assert field is not None
    field.inputs = bytes([1, 2, 3, 4])
    card = board.card("7i77")
    card.exchange()
    with board.engine(1000.0) as engine:
        frame = engine.step()  # its exchange brings no result yet
        assert frame.inputs["0.input"] == 0x04030201
        assert int(card.inputs) == 0x04030201


def test_commands_keep_their_values_when_something_is_added(board: Any) -> None:
    engine = board.engine()
    outputs = engine.outputs
    axis = engine.add_pid("x", feedback="encoder0.position", output="analogout0", p=1.0)
    axis.position = 0.25
    engine.outputs["analogout3"] = 3.0
    engine.add_command("later")
    assert engine.outputs is outputs
    assert (axis.position, outputs["analogout3"], outputs["later"]) == (0.25, 3.0, 0.0)
    with engine:
        assert run(engine, 2).sent["analogout3"] == 3.0
        assert run(engine, 1).sent["analogout0"] == 0.25
