"""Files that end too early, or hold what no recorder writes."""

import random
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.writer import Writer

from hostmot2.errors import CardNotFound
from hostmot2.recording import BrokenRecording, RecordingTooLarge, read
from recording.making import record_file, records

ROOT = Path(__file__).parents[2]
CHILD = """
import sys, time
from hostmot2.record_ring import RecordRing
from hostmot2.recording import Recorder
from recording.making import DTYPE, IMAGE, INPUTS, OUTPUTS, push_all, records
ring = RecordRing(DTYPE, 8192)
recorder = Recorder(ring, sys.argv[1], INPUTS, OUTPUTS, image=IMAGE, flush_s=0.05)
flush = recorder._sink.flush
def told():
    written = recorder.counters.records
    flush()
    print(written, flush=True)
recorder._sink.flush = told
with recorder:
    for first in range(0, 10**7, 20):
        push_all(ring, records(first, 20))
        time.sleep(0.005)
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A small recording with several chunks, as bytes."""
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    return record_file(path, records(0, 60), parts=6, json_rate=100).read_bytes()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_was_flushed_survives_kill_9(tmp_path, seed):
    path, chance = tmp_path / "run.mcap", random.Random(seed)
    command = [sys.executable, "-c", CHILD, str(path)]
    environment = {"PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, cwd=ROOT) as child:
        flushed = [int(child.stdout.readline()) for _ in range(chance.randint(2, 8))]
        try:
            child.wait(chance.random() * 0.05)
        except subprocess.TimeoutExpired:
            child.kill()
    run = read(path)
    assert len(run.records) >= flushed[-1] > 0
    expected = records(0, len(run.records))
    assert np.array_equal(run.cycle, expected["cycle"])
    assert run["enc0.position"].tobytes() == expected["inputs"][:, 0].tobytes()
    assert run.missing
    assert run.dropped == 0


def described_at(whole):
    """Where the first chunk ends: it describes the records."""
    at = 8
    while True:
        opcode, length = whole[at], int.from_bytes(whole[at + 1 : at + 9], "little")
        at += 9 + length
        if opcode == Opcode.CHUNK:
            return at


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_a_file_cut_anywhere_reads_up_to_there_and_says_so(whole, tmp_path_factory, data):
    cut = data.draw(st.integers(0, len(whole) - 1))
    path = tmp_path_factory.getbasetemp() / "cut.mcap"
    path.write_bytes(whole[:cut])
    if cut < described_at(whole):
        with pytest.raises(BrokenRecording):
            read(path)
        return
    run = read(path)
    assert np.array_equal(run.cycle, np.arange(len(run.records)))
    assert len(run.records) % 10 == 0
    complete = len(run.records) == 60
    assert complete or any("cut off" in text for text in run.missing)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_a_damaged_file_gives_true_records_or_a_typed_error(whole, tmp_path_factory, data):
    damaged = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.getbasetemp() / "damaged.mcap"
    path.write_bytes(damaged)
    try:
        run = read(path)
        names = list(run)
    except (BrokenRecording, RecordingTooLarge):
        return
    assert "cycle" in names
    assert set(run.cycle.tolist()) <= set(range(60))


def test_lengths_in_a_file_are_not_believed(whole, tmp_path):
    at = whole.index(bytes([Opcode.ATTACHMENT]), 8)
    path = tmp_path / "long.mcap"
    path.write_bytes(whole[: at + 1] + struct.pack("<Q", 1 << 62) + whole[at + 9 :])
    with pytest.raises(BrokenRecording):
        read(path)


def test_a_chunk_that_unpacks_to_more_than_it_may_is_left_out(tmp_path):
    import zstandard
    from mcap.records import Chunk

    with (tmp_path / "bomb.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        bomb = zstandard.compress(bytes(1 << 27))
        chunk = Chunk("zstd", bomb, 0, 0, 0, 1 << 20)
        chunk.write(writer._Writer__record_builder)
        writer.finish()
    with pytest.raises(BrokenRecording, match="no records are described"):
        read(tmp_path / "bomb.mcap")


def test_more_than_the_limit_is_refused(whole, tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(whole)
    with pytest.raises(RecordingTooLarge):
        read(path, limit=1000)


def test_what_is_no_recording_is_named_as_such(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("no recording " * 10)
    with pytest.raises(BrokenRecording, match="not an MCAP file"):
        read(path)
    with pytest.raises(CardNotFound):
        read(tmp_path / "nowhere.mcap")
    with (tmp_path / "other.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.finish()
    with pytest.raises(BrokenRecording, match="no records are described"):
        read(tmp_path / "other.mcap")
