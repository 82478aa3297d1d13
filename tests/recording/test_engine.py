"""What the cycle engine records: values, raw registers, and the same again in a replay."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from hostmot2 import Board
from hostmot2.cli import main
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.catalog import remote
from hostmot2.errors import WatchdogBite
from hostmot2.recording import Replay, read, record
from hostmot2.transports.emulated import transport_of

ROOT = Path(__file__).parents[2]
CARD = "5i25+7i77"
CYCLES = 60


def started(board):
    board.sserial.start(0x03).raise_for_failed()
    assert len(board.encoders) == 6
    return board


@pytest.fixture(scope="module", params=["pipelined", "read-modify-write"])
def recorded(request, tmp_path_factory):
    """File, style and what the program saw in each cycle."""
    path = tmp_path_factory.mktemp("engine") / "run.mcap"
    with EmulatedBoard(CARD, clock="virtual") as card, Board(transport_of(card)) as board:
        card.encoder_input(0).run(edge_period_ns=50_000.0, counts=100_000)
        field, seen = card.sserial[0].remote(0), []
        engine = started(board).engine(1000, style=request.param)
        with record(engine, path), engine:
            for cycle in range(CYCLES):
                field.inputs, field.alive = bytes([cycle, 2, 3, 255 - cycle]), not 30 <= cycle < 33
                engine.outputs["analogout0"] = cycle / 10
                engine.write()
                frame = engine.step()
                seen.append({name: frame[name] for name in engine.input_names})
    return path, request.param, seen


def test_every_input_of_every_cycle_is_in_the_file(recorded):
    path, _, seen = recorded
    run = read(path)
    for name in seen[0]:
        assert run[name][:CYCLES].tolist() == [each[name] for each in seen]
    assert len(set(run["sserial0.0.Input"].tolist())) > 40
    assert (run.dropped, run.gaps, run.missing) == (0, (), ())


def test_raw_words_decode_to_what_the_engine_made_of_them(recorded):
    run = read(recorded[0])
    decoded = [name for name in run.elements if name in {each.name for each in run.inputs}]
    assert "sserial0.0.Input" in decoded
    for name in decoded:
        assert np.array_equal(run.elements[name].astype(float), run[name])


@pytest.mark.parametrize("words", [0, 3, 256])
def test_registers_that_found_no_room_are_told_at_the_end(words, tmp_path, recwarn):
    with EmulatedBoard(CARD, clock="virtual") as card, Board(transport_of(card)) as board:
        engine = started(board).engine(1000)
        with record(engine, tmp_path / "run.mcap", words=words), engine:
            for _ in range(20):
                engine.step()
        all_of_them = len(engine.layout()) + engine.left_out
        assert (engine.left_out == 0) == (words == 256)
    told = [str(each.message) for each in recwarn if "not in the records" in str(each.message)]
    log = [line.message for line in read(tmp_path / "run.mcap").log]
    if words == 3:
        assert f"{all_of_them - 3} registers" in told[0]
        assert told == log
    else:
        assert not told
        assert not log


def test_the_driver_repeats_what_the_engine_did(recorded):
    path, style, seen = recorded
    run = read(path)
    replay = Replay(run, f"emu://{CARD}?clock=virtual")
    with replay.open() as board:
        started(board).sserial.cyclic = 0x03
        outputs = board.sserial.channels[1].outputs
        commands = {name: run.elements[f"sserial0.1.{name}"] for name in outputs}
        for index in range(CYCLES):
            replay.play(index)
            if style == "read-modify-write":
                board.cycle.read()
            for name, column in commands.items():
                outputs[name] = column[index]
            board.cycle.write() if style == "read-modify-write" else board.cycle.run()
            assert float(board.sserial.channels[0].inputs["Input"]) == seen[index]["sserial0.0.Input"]
        assert [f.channel for f in board.sserial.faults] == [0] * len(board.sserial.faults) != []
        replay.stop()
    assert replay.differences == []


def test_a_watchdog_armed_after_some_cycles_has_not_bitten_in_the_replay(recorded):
    path, style, _ = recorded
    run = read(path)
    run.records = run.records.copy()
    status, fed = run.image.index(0x0D00), run.image.index(0x0E01)
    run.records["words"][:4, status] = 1  # as it is before the watchdog was armed
    run.records["fresh"][:3, fed // 32] &= ~np.uint32(1 << fed % 32)
    replay = Replay(run, f"emu://{CARD}?clock=virtual")
    with replay.open() as board:
        started(board).sserial.cyclic = 0x03
        for index in range(10):
            replay.play(index)
            assert board.watchdog.armed == (index >= 3)
            if style == "read-modify-write":
                board.cycle.read()
            board.cycle.write() if style == "read-modify-write" else board.cycle.run()
        replay.stop()
    assert 0x0E00 not in {each.register for each in replay.differences}


def test_a_bite_is_a_bite_in_the_replay_too(recorded):
    run = read(recorded[0])
    run.records = run.records.copy()
    run.records["words"][7:, run.image.index(0x0D00)] = 1
    replay = Replay(run, f"emu://{CARD}?clock=virtual")
    with replay.open() as board:
        started(board).sserial.cyclic = 0x03
        for index in range(7):
            replay.play(index)
            board.cycle.run()
        replay.play(7)
        with pytest.raises(WatchdogBite):
            board.cycle.run()


def test_times_of_an_emulated_card_are_of_today_and_begin_at_the_beginning(tmp_path):
    with Board(transport_of(EmulatedBoard(CARD, clock="real"))) as board:
        engine = board.engine(200)
        before = time.time_ns()
        with record(engine, tmp_path / "run.mcap"), engine:
            time.sleep(0.1)
    run = read(tmp_path / "run.mcap")
    assert before <= run.time_ns[0] <= run.time_ns[-1] <= time.time_ns()


def test_hm2_record_writes_every_cycle_and_switches_nothing_on(tmp_path, capfd):
    path = tmp_path / "run.mcap"
    command = ["--board", f"emu://{CARD}?clock=virtual", "--json", "record", "-o", str(path)]
    with pytest.raises(SystemExit) as end:
        main([*command, "--rate", "500", "--seconds", "0.2"])
    assert not end.value.code
    document = json.loads(capfd.readouterr().out)
    run = read(path)
    assert document["cycles"] == len(run.records) >= 100
    assert (document["dropped"], run.dropped) == (0, 0)
    assert not run.records["outputs"].any()
    assert not run.elements["sserial0.1.AnalogEna"].any()
    assert run.metadata["hm2.engine"]["rate"] == "500.0"
    assert run.metadata["hm2.host"]["kernel"]


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_hm2_record_leaves_a_file_that_reads_however_it_ends(tmp_path, end):
    path = tmp_path / "run.mcap"
    command = [sys.executable, "-m", "hostmot2", "--board", f"emu://{CARD}", "record", "-o", str(path)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    child = subprocess.Popen([*command, "--rate", "200"], env=environment, cwd=ROOT)
    try:
        for _ in range(600):  # until a second has been flushed
            if path.exists() and path.stat().st_size > 20_000 and len(read(path).records) > 0:
                break
            time.sleep(0.05)
        child.send_signal(end)
        status = child.wait(60)
    finally:
        child.kill()
    assert status == (0 if end == signal.SIGTERM else -signal.SIGKILL)
    run = read(path)
    assert len(run.records) > 0
    assert bool(run.missing) == (end == signal.SIGKILL)
    assert run.gaps == ()


def test_the_python_of_the_how_to_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs/how-to/record.md").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert len(blocks) == 3
    names = {}
    for block in blocks:
        exec(compile(block.replace("seconds=2", "seconds=0.2"), "record.md", "exec"), names)
    assert len(names["replay"]) > 50
    assert names["run"].attachments


@pytest.mark.slow
def test_at_4_khz_with_eight_channels_a_disk_stalled_for_a_second_costs_no_record(tmp_path, monkeypatch):
    seconds = float(os.environ.get("HM2_RECORD_SECONDS", "10"))
    with EmulatedBoard(CARD, clock="real", sserial_channels=8) as card, Board(transport_of(card)) as board:
        for channel in range(2, 8):
            card.sserial[0].attach(channel, remote("7i77-io"))
        board.sserial.start(0xFF).raise_for_failed()
        engine = board.engine(4000, dead_man=0)
        recorder = record(engine, tmp_path / "run.mcap", json_rate=100)
        flush, flushes = recorder._sink.flush, []

        def stalling():
            flushes.append(None)
            if len(flushes) == 4:
                time.sleep(1.0)
            flush()

        monkeypatch.setattr(recorder._sink, "flush", stalling)
        with recorder, engine:
            time.sleep(seconds)
    run = read(tmp_path / "run.mcap")
    assert len(flushes) > 4
    assert (run.dropped, run.gaps) == (0, ())
    assert len({name.split(".")[1] for name in run.elements}) == 8
    print(f"{len(run.records)} records in {run.seconds[-1]:.1f} s")
