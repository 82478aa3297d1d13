"""Recordings that go wrong: nowhere to write to, two at once, a clock that jumps, a file that is cut off."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

import hostmot2
import hostmot2.record_ring
from hostmot2.cli import main
from hostmot2.emulator import EmulatedBoard
from hostmot2.engine.signals import Signal as EngineSignal
from hostmot2.errors import EngineError
from hostmot2.recording import EngineRecords, Recorder, RecordingError, RecordingFailed, Replay, read, record
from recording.making import DTYPE, IMAGE, INPUTS, OUTPUTS, push_all, records

ROOT = Path(__file__).parents[2]
CARD = "5i25+7i77"


def engine_of(board):
    board.card("7i77").start()
    return board.engine(1000)


def run(engine, cycles):
    for _ in range(cycles):
        engine.write()
        engine.step()


@pytest.fixture
def board():
    with hostmot2.open(EmulatedBoard(CARD, clock="virtual")) as opened:
        yield opened


# -- nowhere to write


def test_without_its_directory_nothing_is_recorded_and_it_can_be_tried_again(board, tmp_path):
    engine = engine_of(board)
    for nowhere in (tmp_path / "missing" / "run.mcap", tmp_path, Path("/dev/full")):
        with pytest.raises(OSError, match=r"directory|space"):
            record(engine, nowhere)
    with record(engine, tmp_path / "run.mcap"), engine:
        run(engine, 20)
    assert len(read(tmp_path / "run.mcap").records) >= 20


def test_hm2_record_says_that_the_directory_is_missing(tmp_path, capfd):
    with pytest.raises(SystemExit) as end:
        main(["--board", f"emu://{CARD}?clock=virtual", "record", "-o", str(tmp_path / "missing" / "x.mcap")])
    assert end.value.code == 3
    assert str(tmp_path / "missing" / "x.mcap") in capfd.readouterr().err


@pytest.mark.parametrize("seconds", ["inf", "nan"])
@pytest.mark.parametrize("command", [["record", "-o", "x.mcap"], ["live", "--port", "0"]])
def test_a_time_that_is_none_is_a_wrong_use(tmp_path, monkeypatch, hm2, command, seconds):
    monkeypatch.chdir(tmp_path)
    status, _, err = hm2("--board", f"emu://{CARD}?clock=virtual", *command, "--seconds", seconds)
    assert (status, f"--seconds {seconds}: leave it out" in err) == (2, True)


def test_a_disk_that_fills_up_stops_the_recording_and_not_the_engine(tmp_path):
    """A file system of 256 KiB, in a mount namespace of the test's own."""
    program = f"""
import sys, time, hostmot2
from hostmot2.emulator import EmulatedBoard
from hostmot2.recording import RecordingFailed, read, record
with hostmot2.open(EmulatedBoard("{CARD}", sserial_channels=2)) as board:
    board.watchdog.timeout = 5
    board.card("7i77").start()
    engine = board.engine(4000, dead_man=0)
    recorder = record(engine, "disk/run.mcap").start()
    with engine:
        end = time.monotonic() + 30
        while recorder.failure is None and time.monotonic() < end:
            time.sleep(0.05)
        before = engine.status.cycles
        time.sleep(0.2)
        assert engine.status.cycles > before, "the cycle goes on"
        time.sleep(1)
    try:
        recorder.close()
    except RecordingFailed as failed:
        print(failed.os_errno)
run = read("disk/run.mcap")
assert (run.cycle == range(len(run.cycle))).all() if len(run.cycle) else True
print(len(run.records) > 100, bool(run.missing))
"""
    (tmp_path / "disk").mkdir()
    command = 'mount -t tmpfs -o size=256k hm2 disk && exec "$@"'
    arguments = ["unshare", "-rm", "sh", "-c", command, "sh", sys.executable, "-c", program]
    done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    if "mount" in done.stderr or "unshare" in done.stderr:
        pytest.skip(f"no file system of the test's own: {done.stderr.strip()}")
    assert done.stdout.splitlines() == ["28", "True True"], done.stderr


# -- two at once


def test_two_recordings_do_not_write_to_one_file(tmp_path):
    from hostmot2.record_ring import RecordRing

    path = tmp_path / "run.mcap"
    rings = [RecordRing(DTYPE, 64) for _ in range(2)]
    with Recorder(rings[0], path, INPUTS, OUTPUTS, image=IMAGE):
        push_all(rings[0], records(0, 20))
        with pytest.raises(RecordingFailed, match="another recording"):
            Recorder(rings[1], path, INPUTS, OUTPUTS, image=IMAGE)
    assert read(path).cycle.tolist() == list(range(20))
    with Recorder(rings[1], path, INPUTS, OUTPUTS, image=IMAGE):  # afterwards it is replaced
        push_all(rings[1], records(0, 5))
    assert read(path).cycle.tolist() == list(range(5))


def test_an_engine_is_recorded_once(board, tmp_path):
    engine = engine_of(board)
    with record(engine, tmp_path / "a.mcap"):
        with pytest.raises(EngineError, match="somebody already"):
            record(engine, tmp_path / "b.mcap")
        with engine:
            run(engine, 10)
    assert len(read(tmp_path / "a.mcap").records) >= 10
    assert not (tmp_path / "b.mcap").exists()


def test_an_engine_is_recorded_again_when_the_last_recording_is_whole(board, tmp_path):
    """Two that take from one ring would each have records of the other's, or the same ones twice."""
    engine = engine_of(board)
    source = EngineRecords(engine)
    with engine:
        first = source.recorder(tmp_path / "a.mcap").start()
        run(engine, 10)
        with pytest.raises(RecordingError, match=r"a\.mcap: the last recording of this engine"):
            source.recorder(tmp_path / "b.mcap")
        first.close()
        with source.recorder(tmp_path / "b.mcap"):
            run(engine, 10)
    assert read(tmp_path / "a.mcap").cycle.tolist() == list(range(10))
    assert read(tmp_path / "b.mcap").cycle.tolist() == list(range(10, 20))


def test_a_recording_is_decoded_with_the_scalings_of_its_own_run(board, tmp_path):
    engine = engine_of(board)
    source = EngineRecords(engine)
    outputs = board.sserial.channels[1].outputs
    for number, scale in enumerate((10.0, 5.0)):
        outputs.configure("analogout0", scale=scale)
        with source.recorder(tmp_path / f"{number}.mcap"), engine:
            engine.outputs["analogout0"] = 4.0
            run(engine, 10)
        decoded = read(tmp_path / f"{number}.mcap").elements["sserial0.1.AnalogOut0"]
        assert decoded[5] == pytest.approx(4.0, abs=0.01)


@pytest.mark.parametrize("add", ["add_command", "add_input", "add_pid"])
def test_what_is_added_behind_record_has_no_room_in_it_and_is_refused(board, add):
    """It was written behind the record's place in the ring."""
    engine = engine_of(board)
    engine.record(64, 16)
    if add == "add_pid":
        engine.add_pid("x", feedback="encoder0.position", output="analogout0")
    else:
        getattr(engine, add)(EngineSignal("late") if add == "add_input" else "late")
    with pytest.raises(EngineError, match="add them first"):
        engine.start()
    engine.drop_records()
    ring = engine.record(64, 16)
    with engine:
        engine.step()
    assert ring.pop()["cycle"].tolist()[0] == 0


def test_two_cards_are_recorded_at_once(tmp_path):
    with (
        hostmot2.open(EmulatedBoard(CARD, clock="virtual")) as one,
        hostmot2.open(EmulatedBoard(CARD, clock="virtual")) as two,
    ):
        engines = engine_of(one), engine_of(two)
        recorders = [record(engine, tmp_path / f"{number}.mcap") for number, engine in enumerate(engines)]
        with recorders[0], recorders[1], engines[0], engines[1]:
            for cycle in range(30):
                for number, engine in enumerate(engines):
                    engine.outputs["analogout0"] = cycle / 10 + number
                    run(engine, 1)
    for number in range(2):
        sent = read(tmp_path / f"{number}.mcap")["sserial0.1.AnalogOut0"]
        assert sent[:30].tolist() == [cycle / 10 + number for cycle in range(30)]


# -- clocks that jump


@pytest.mark.parametrize("jump", [-3600 * 10**9, 3600 * 10**9])
def test_a_step_of_the_computers_clock_is_no_step_of_the_recording(tmp_path, monkeypatch, jump):
    from hostmot2.record_ring import RecordRing

    now = [1_700_000_000 * 10**9]
    monkeypatch.setattr("time.time_ns", lambda: now[0])
    ring, path = RecordRing(DTYPE, 256), tmp_path / "run.mcap"
    recorder = Recorder(ring, path, INPUTS, OUTPUTS, image=IMAGE, clock=lambda: 10**12)
    push_all(ring, records(0, 50))
    recorder._drain()
    now[0] += jump
    push_all(ring, records(50, 50))
    recorder.log("behind the step", time_ns=10**12 + 99 * 250_000)
    recorder.close()
    assert np.diff(read(path).time_ns).tolist() == [250_000] * 99
    with path.open("rb") as stream:
        times = [m.log_time for _, _, m in make_reader(stream).iter_messages(log_time_order=False)]
    assert max(times) - min(times) < 10**9
    with path.open("rb") as stream:
        plotted = make_reader(stream).iter_messages(["/hm2/inputs"], log_time_order=False)
        values = [json.loads(message.data)["enc0_position"] for _, _, message in plotted]
    assert values == sorted(values)


# -- less than a whole file


def test_what_is_left_of_a_cut_off_file_is_replayed(board, tmp_path):
    path, cut = tmp_path / "run.mcap", tmp_path / "cut.mcap"
    engine = engine_of(board)
    recorder = record(engine, path)
    sizes = []
    with engine:
        for cycle in range(60):
            engine.outputs["analogout0"] = cycle / 10
            run(engine, 1)
            if cycle % 20 == 19:
                recorder._drain()
                recorder._flush()
                sizes.append(path.stat().st_size)
    recorder.close()
    cut.write_bytes(path.read_bytes()[: (sizes[1] + sizes[2]) // 2])
    left = read(cut)
    assert len(left.records) == 40
    assert "cut off" in left.missing[0]
    replay = Replay(left, f"emu://{CARD}?clock=virtual")
    with replay.open() as again:
        again.sserial.start(0x03).raise_for_failed()
        again.encoders  # noqa: B018 - took part then
        again.sserial.cyclic = 0x03
        outputs = again.sserial.channels[1].outputs
        commands = {name: left.elements[f"sserial0.1.{name}"] for name in outputs}
        for index in range(len(replay)):
            replay.play(index)
            again.cycle.read()
            for name, column in commands.items():
                outputs[name] = column[index]
            again.cycle.write()
        with pytest.raises(IndexError):
            replay.play(len(replay))
        replay.stop()
    assert replay.differences == []


def test_what_a_block_raised_is_kept_and_the_failed_recording_noted(tmp_path, monkeypatch):
    ring = hostmot2.record_ring.RecordRing(DTYPE, 64)

    def full(_self):
        raise RecordingFailed("no space left")

    recorder = Recorder(ring, tmp_path / "run.mcap", INPUTS, OUTPUTS, image=IMAGE)
    monkeypatch.setattr(Recorder, "close", full)
    with pytest.raises(KeyError, match="mine") as caught, recorder:
        raise KeyError("mine")
    assert any("no space left" in note for note in caught.value.__notes__)
    with pytest.raises(RecordingFailed, match="no space left"), recorder:
        pass
    monkeypatch.undo()
    recorder.close()


def test_a_recorder_that_cannot_begin_lets_its_file_go(tmp_path):
    ring = hostmot2.record_ring.RecordRing(DTYPE, 64)
    path = tmp_path / "run.mcap"
    with pytest.raises(AttributeError):
        Recorder(ring, path, INPUTS, OUTPUTS, image=IMAGE, attachments=["no attachment"])
    with Recorder(ring, path, INPUTS, OUTPUTS, image=IMAGE):
        push_all(ring, records(0, 3))
    assert len(read(path).records) == 3


def test_a_file_system_without_locks_is_written_all_the_same(tmp_path, monkeypatch):
    def refuse(*_arguments):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr("fcntl.flock", refuse)
    ring = hostmot2.record_ring.RecordRing(DTYPE, 64)
    with Recorder(ring, tmp_path / "run.mcap", INPUTS, OUTPUTS, image=IMAGE):
        push_all(ring, records(0, 3))
    assert len(read(tmp_path / "run.mcap").records) == 3
