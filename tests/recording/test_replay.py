"""A recording in the card's place: the driver's behaviour over it is that of the day it was made."""

from types import SimpleNamespace

import numpy as np
import pytest

import hostmot2
from hostmot2 import Board, errors
from hostmot2._core import ffi, lib
from hostmot2.cli import main
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.control import Controls, ControlServer, ask
from hostmot2.emulator.ethernet import EthernetServer
from hostmot2.record_ring import RecordRing, record_dtype
from hostmot2.recording import Recorder, Replay, Signal, Tap, attachments_of, read, record, remote_inputs
from hostmot2.recording.bus import BusAround
from hostmot2.recording.play import emulator_keys, play
from hostmot2.transports.emulated import transport_of
from recording.making import record_file, records

CARD = "5i25+7i77"
MASK = 0x03
CYCLES = 60


def started(board):
    board.sserial.channels[0].mode = 2  # analog inputs and the field voltage, too
    board.sserial.start(MASK).raise_for_failed()
    board.sserial.cyclic = MASK
    board.encoders[0].scale = 100.0
    return board


def channels(board):
    """Channels of the 7I77's field I/O and analog output, by what they have."""
    inputs = {name.lower(): c for c in board.sserial.channels if c.description for name in c.inputs}
    outputs = {name.lower(): c for c in board.sserial.channels if c.description for name in c.outputs}
    return inputs, outputs


def one_cycle(board, cycle):
    """A step of a program; what it saw."""
    inputs, outputs = channels(board)
    outputs["analogout0"].outputs["analogout0"] = cycle / 10
    outputs["output"].outputs["output"] = cycle * 257 & 0xFFFF
    try:
        board.cycle.run()
        failed = None
    except Exception as problem:
        failed = type(problem).__name__
    result = board.sserial.last_cycle
    seen = {name: inputs[name].inputs[name] for name in ("input", "analogin1", "fieldvoltage")}
    return {
        "count": board.encoders[0].count,
        "inputs": {name: float(value) for name, value in seen.items()},
        "failed": (failed, result.failed, result.requested),
        "faults": [(f.channel, f.status.word, f.rising, f.failed, str(f)) for f in result.faults],
    }


def disturb(card, cycle):
    """What happens to the machine meanwhile."""
    field = card.sserial[0].remote(0)
    field.inputs = bytes([cycle, 255 - cycle, cycle * 3 & 255, 7, *range(len(field.inputs) - 4)])
    if cycle == 20:
        field.inject(bad_crc=1)
    field.alive = not 30 <= cycle < 33
    if cycle == 45:
        field.fault = 0x08


class Losing(BusAround):
    """A bus whose exchanges are carried out while it is `losing`, but never answered."""

    losing = False

    def finish(self, deadline_ns, error):
        status = super().finish(deadline_ns, error)
        if not self.losing:
            return status
        error.status = lib.HM2_ERR_TIMEOUT
        ffi.memmove(error.where, b"lost", 5)
        return lib.HM2_ERR_TIMEOUT


LOST = range(50, 53)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A run on an emulated card: the file, and what the program saw in each cycle."""
    path = tmp_path_factory.mktemp("replay") / "run.mcap"
    with EmulatedBoard(CARD, clock="virtual") as card:
        card.encoder_input(0).run(edge_period_ns=50_000.0, counts=100_000)
        line = Losing(transport_of(card))
        tap = Tap(line.transport)
        with Board(tap.transport) as board:
            about = attachments_of(started(board))
            tap.ring = RecordRing(record_dtype(words=64, inputs=1), 1024)
            recorder = Recorder(
                tap.ring,
                path,
                [Signal("count", "counts")],
                image=lambda: tap.registers,
                attachments=about,
                clock=board.now_ns,
            )
            seen = []
            for cycle in range(CYCLES):
                disturb(card, cycle)
                line.losing = cycle in LOST
                seen.append(one_cycle(board, cycle))
                tap.push([seen[-1]["count"]])
                board.pause(0.001)
            recorder.close()
            tap.ring = None
    return path, seen


@pytest.fixture
def replay(recorded):
    with EmulatedBoard(CARD, clock="virtual") as card:
        made = Replay(read(recorded[0]), transport_of(card))
        with made.open() as board:
            yield made, started(board)


def test_the_run_was_worth_replaying(recorded):
    seen = recorded[1]
    assert len({str(each["inputs"]) for each in seen}) > 40
    assert seen[-1]["count"] - seen[0]["count"] > 1000
    assert sum(bool(each["faults"]) for each in seen) >= 3
    assert [i for i, each in enumerate(seen) if each["failed"][0] == "TransportTimeout"] == list(LOST)


def test_the_driver_reports_the_same_values_and_faults_and_writes_the_same(recorded, replay):
    made, board = replay
    for index, then in enumerate(recorded[1]):
        made.play(index)
        now = one_cycle(board, index)
        assert now["inputs"] == then["inputs"], index
        assert now["failed"] == then["failed"], index
        assert now["faults"] == then["faults"], index
        assert now["count"] - recorded[1][0]["count"] == then["count"] - recorded[1][0]["count"]
    made.stop()
    assert made.differences == []


def test_a_program_that_does_otherwise_is_found_out(replay):
    made, board = replay
    for index in range(5):
        made.play(index)
        one_cycle(board, index if index != 3 else 40)
    made.stop()
    assert {each.index for each in made.differences} == {3}
    assert "register 0x" in str(made.differences[0])


def test_nothing_reaches_the_card_below_while_replaying(recorded):
    with EmulatedBoard(CARD, clock="virtual") as card:
        made = Replay(read(recorded[0]), transport_of(card))
        with made.open() as board:
            started(board)
            before = [card.sserial[0].remote(n).outputs for n in range(2)]
            for index in range(10):
                made.play(index)
                one_cycle(board, index)
            card.advance(1000.0)
            assert [card.sserial[0].remote(n).outputs for n in range(2)] == before


def test_the_emulated_remotes_can_be_driven_with_the_recorded_inputs(recorded):
    path, seen = recorded
    run = read(path)
    with EmulatedBoard(CARD, clock="virtual") as card, Board(transport_of(card)) as board:
        board.sserial.start(MASK).raise_for_failed()
        inputs, _ = channels(board)
        for index in range(5, 15):  # without faults
            for (port, channel), data in remote_inputs(run, index).items():
                card.sserial[port].remote(channel).inputs = data
            assert not board.sserial.doit(MASK).failed
            assert float(inputs["input"].inputs["input"]) == seen[index]["inputs"]["input"]


def test_decoded_columns_are_what_the_driver_saw(recorded):
    path, seen = recorded
    run = read(path)
    assert run["count"].tolist() == [each["count"] for each in seen]
    prefix = next(name for name in run if name.endswith(".Input")).removesuffix("Input")
    for name in seen[0]["inputs"]:
        got = run[prefix + name].astype(float)
        assert got.tolist() == [each["inputs"][name] for each in seen]


def test_written_process_data_is_decoded_too(recorded):
    run = read(recorded[0])
    outputs = next(name for name in run if name.endswith(".Output"))
    assert run[outputs].tolist()[:10] == [cycle * 257 & 0xFFFF for cycle in range(10)]
    volts = run[next(name for name in run if name.endswith(".AnalogOut0"))]
    assert np.allclose(volts[:20], np.arange(20) / 10, atol=0.003)
    assert run.units[next(name for name in run if name.endswith(".AnalogOut0"))] == "V"


def test_the_card_is_in_the_file(recorded):
    run = read(recorded[0])
    assert run.attachments["board.hm2dump"].startswith(b"# hm2dump 1")
    assert run.descriptors.text.board == "MESA5I25"
    assert {c.name for c in run.descriptors.text.ports[0].channels} >= {"7I77"}


def test_a_recording_without_registers_cannot_be_replayed(tmp_path):
    ring = RecordRing(record_dtype(), 8)
    with Recorder(ring, tmp_path / "run.mcap"):
        ring.push(np.zeros(1, ring.dtype))
    with EmulatedBoard(CARD, clock="virtual") as card, pytest.raises(ValueError, match="no raw registers"):
        Replay(read(tmp_path / "run.mcap"), transport_of(card))


def test_hm2_play_moves_the_inputs_of_a_served_card(recorded, tmp_path):
    path, seen = recorded
    with EmulatedBoard("7i92+7i77", clock="real") as card:
        server = EthernetServer(card, "127.0.0.1", 0)
        try:
            with ControlServer(tmp_path / "control", Controls(card, server)):
                command = ["play", str(path), "--control", str(tmp_path / "control"), "--speed", "0"]
                with pytest.raises(SystemExit) as end:
                    main(command)
                assert not end.value.code
                assert float(ask(tmp_path / "control", "get", "input")) == seen[-1]["inputs"]["input"]
        finally:
            server.close()


def test_a_bite_comes_again_in_its_cycle_and_the_replay_goes_on(tmp_path):
    with hostmot2.open(f"emu://{CARD}?clock=virtual") as board:
        board.sserial.start(MASK).raise_for_failed()
        engine = board.engine(rate=1000)
        with record(engine, tmp_path / "run.mcap"), engine:
            for frame in engine.frames(seconds=0.04):
                engine.outputs["analogout0"] = 5.0
                if frame.cycle == 20:
                    board.pause(0.1)
    made = Replay(read(tmp_path / "run.mcap"), f"emu://{CARD}?clock=virtual")
    bitten = []
    with made.open() as board:
        board.sserial.start(MASK)
        board.sserial.cyclic = MASK
        for index in range(len(made)):
            made.play(index)
            try:
                board.cycle.read()
                board.cycle.write()
            except errors.WatchdogBite:
                bitten.append(index)
    assert len(made) > 40
    assert bitten == list(range(bitten[0], len(made)))
    assert made.recording["sserial0.1.AnalogOut0"][bitten[0] - 1] == 5.0
    assert not made.recording["sserial0.1.AnalogOut0"][bitten[0] + 1 :].any()


def test_who_waits_during_a_replay_sees_time_pass(replay):
    made, board = replay
    made.play(3)
    before = board.now_ns()
    board.pause(0.001)
    assert board.now_ns() - before == 1_000_000
    made.play(3)
    assert board.now_ns() == before


def test_a_register_that_was_not_recorded_is_read_from_the_card_below(recorded):
    with EmulatedBoard(CARD, clock="virtual") as card:
        made = Replay(read(recorded[0]), transport_of(card))
        with made.open() as board:
            made.play(3)
            assert board.read(0x0100) == 0x55AACAFE
            assert 0x0100 not in made.recording.image
            with pytest.raises(IndexError, match=f"record {CYCLES} of {CYCLES}"):
                made.play(CYCLES)


def test_a_recording_without_descriptors_has_no_inputs_of_remotes(tmp_path):
    run = read(record_file(tmp_path / "run.mcap", records(0, 3)))
    assert remote_inputs(run, 0) == {}


def test_keys_of_an_emulator_are_inputs_and_positions_not_outputs(recorded):
    run = read(recorded[0])
    keys = emulator_keys(run)
    assert keys["input"] == "sserial0.0.Input"
    assert not any("analogout" in key for key in keys)
    counts = SimpleNamespace(inputs=(), input_elements=frozenset())
    names = ["encoder3.raw_count", "encoder3.velocity", "x"]
    seen = type("Run", (SimpleNamespace,), {"__iter__": lambda self: iter(names)})(**vars(counts))
    assert emulator_keys(seen) == {"encoder3_position": "encoder3.raw_count"}


def test_a_value_that_is_refused_later_ends_the_playing_and_one_refused_at_once_is_left_out(tmp_path):
    run = read(record_file(tmp_path / "run.mcap", records(0, 5)))
    told = []

    def set_value(key, value):
        if key == "velocity" or value > 0.3:
            raise ValueError(f"{value} is too much")
        told.append(key)

    keys = {"position": "enc0.position", "velocity": "enc0.velocity"}
    with pytest.raises(ValueError, match="too much"):
        play(run, keys, set_value, speed=0)
    assert told == ["position"] * 3
    assert play(run, {"velocity": "enc0.velocity"}, set_value, speed=0) == {"velocity": "1.0 is too much"}


def test_a_tap_without_a_ring_records_nothing_and_one_without_room_keeps_what_has_some():
    with EmulatedBoard(CARD, clock="virtual") as card:
        tap = Tap(transport_of(card))
        with Board(tap.transport) as board:
            with pytest.raises(ValueError, match="the tap has no ring"):
                tap.push([])
            tap.ring = RecordRing(record_dtype(words=2), 8)
            for register in (0x0100, 0x0104, 0x0108):
                board.read(register)
            assert tap.push([])
            (made,) = tap.ring.pop(8)
            assert tap.registers == [0x0100, 0x0104]
            assert made["words"].tolist() == [board.read(0x0100), board.read(0x0104)]


class Refusing(BusAround):
    """A bus that takes no exchange while it is `refusing`, as a socket of a network that is down."""

    refusing = False

    def begin(self, transfers, count, error):
        return lib.HM2_ERR_IO if self.refusing else super().begin(transfers, count, error)


def test_a_tap_notes_an_exchange_that_did_not_even_begin():
    with EmulatedBoard(CARD, clock="virtual") as card:
        line = Refusing(transport_of(card))
        tap = Tap(line.transport)
        with Board(tap.transport) as board:
            tap.ring = RecordRing(record_dtype(words=4), 8)
            for line.refusing in (False, True, False):
                for _ in range(2):  # what comes back later does not undo it
                    try:
                        board.read(0x0100)
                    except errors.TransportError:
                        line.refusing = False
                tap.push()
            assert tap.ring.pop()["status"].tolist() == [0, lib.HM2_ERR_IO, 0]
            tap.ring = None


def test_a_tap_takes_as_many_values_as_its_records_have():
    with EmulatedBoard(CARD, clock="virtual") as card:
        tap = Tap(transport_of(card))
        with Board(tap.transport):
            tap.ring = RecordRing(record_dtype(words=4, inputs=2, outputs=1), 8)
            for inputs, outputs in (([1.0], [2.0]), ([1.0, 2.0], []), ([], [1.0])):
                with pytest.raises(ValueError, match="the records have"):
                    tap.push(inputs, outputs)
            assert tap.push([1.0, 2.0], [3.0])
            assert tap.ring.pop()["inputs"].tolist() == [[1.0, 2.0]]
            tap.ring = None


def test_remotes_with_the_same_elements_are_played_to_daughter_cards_of_their_own():
    names = ["sserial0.0.Input", "sserial0.1.AnalogIn", "sserial0.3.Input", "sserial0.4.AnalogIn"]
    made = type("Run", (SimpleNamespace,), {"__iter__": lambda self: iter(names)})
    assert emulator_keys(made(inputs=(), input_elements=frozenset(names))) == {
        "input": names[0],
        "analogin": names[1],
        "1.input": names[2],
        "1.analogin": names[3],
    }


def test_an_exception_in_a_bus_between_is_an_error_of_the_exchange(caplog):
    class Broken(BusAround):
        def begin(self, transfers, count, error):
            raise RuntimeError("a mistake")

    with EmulatedBoard(CARD, clock="virtual") as card, pytest.raises(errors.HostMot2Error):
        Board(Broken(transport_of(card)).transport)
    assert "a mistake" in caplog.text
