"""Files that end too early, or hold what no recorder writes."""

import io
import random
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.writer import Writer

from hostmot2.errors import CardNotFound
from hostmot2.recording import BrokenRecording, RecordingTooLarge, read
from hostmot2.recording.file import RecordingFile
from recording.making import DTYPE, INPUTS, OUTPUTS, record_file, records

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


FORKING = """
import os, sys
from hostmot2.record_ring import RecordRing
from hostmot2.recording import Recorder
from recording.making import DTYPE, IMAGE, INPUTS, OUTPUTS, push_all, records
ring = RecordRing(DTYPE, 8192)
with Recorder(ring, sys.argv[1], INPUTS, OUTPUTS, image=IMAGE, flush_s=float(sys.argv[2])) as recorder:
    for first in range(0, 2000, 100):
        push_all(ring, records(first, 100))
        child = os.fork()
        if child == 0:
            sys.exit(0)
        os.waitpid(child, 0)
"""


@pytest.mark.parametrize("flush_s", [0.01, 1000.0])  # the child has nothing, or all, in its buffer
def test_a_forked_child_that_ends_writes_nothing_into_its_parents_recording(tmp_path, flush_s):
    path = tmp_path / "run.mcap"
    environment = {"PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}"}
    command = [sys.executable, "-c", FORKING, str(path), str(flush_s)]
    subprocess.run(command, env=environment, cwd=ROOT, check=True, timeout=60)
    run = read(path)
    assert run.cycle.tolist() == list(range(2000))
    assert not run.missing


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


def chunk_places(whole):
    """Where each chunk's record begins and ends."""
    at, found = 8, []
    while whole[at] != Opcode.DATA_END:
        end = at + 9 + int.from_bytes(whole[at + 1 : at + 9], "little")
        if whole[at] == Opcode.CHUNK:
            found.append((at, end))
        at = end
    return found


POSITION = struct.pack("<d", records(34, 1)["inputs"][0, 0])
"""Where the axis is in cycle 34: only one chunk holds it."""


def with_chunk(whole, change, crc_of=zlib.crc32):
    """The file with the chunk of cycle 34 changed. crc_of: of the new content, None: the old CRC stays."""
    for start, end in chunk_places(whole):
        chunk = Chunk.read(ReadDataStream(io.BytesIO(whole[start + 9 : end])))
        plain = zstandard.ZstdDecompressor().decompress(chunk.data)
        if POSITION in plain:
            break
    changed = change(plain)
    crc = chunk.uncompressed_crc if crc_of is None else crc_of(changed)
    builder = RecordBuilder()
    made = Chunk("", changed, chunk.message_start_time, chunk.message_end_time, crc, len(changed))
    made.write(builder)
    return whole[:start] + builder.end() + whole[end:]


def longer_batch(plain, extra):
    """Behind the data of the message that holds cycle 34, more bytes."""
    end = 0
    while end <= plain.index(POSITION):
        at, length = end, int.from_bytes(plain[end + 1 : end + 9], "little")
        end += 9 + length
    longer = (length + len(extra)).to_bytes(8, "little")
    return plain[: at + 1] + longer + plain[at + 9 : end] + extra + plain[end:]


@pytest.mark.parametrize("size", [1, 8, records(0, 1).dtype.itemsize - 1])
def test_a_batch_that_is_not_whole_records_is_left_out_alone(whole, tmp_path, size):
    path = tmp_path / "run.mcap"
    path.write_bytes(with_chunk(whole, lambda plain: longer_batch(plain, bytes(size))))
    run = read(path)
    assert run.cycle.tolist() == [*range(30), *range(40, 60)]
    assert run["enc0.position"].tobytes() == records(0, 60)["inputs"][run.cycle, 0].tobytes()
    (said,) = run.missing
    assert "not whole records" in said


def test_a_chunk_with_a_bit_flipped_is_left_out_and_named(whole, tmp_path):
    path = tmp_path / "run.mcap"

    def flip(plain):
        at = plain.index(POSITION)
        return plain[:at] + bytes([plain[at] ^ 1]) + plain[at + 1 :]

    path.write_bytes(with_chunk(whole, flip))
    assert read(path)["enc0.position"].size == 60  # with a CRC that fits the same bytes are a recording
    path.write_bytes(with_chunk(whole, flip, crc_of=None))
    run = read(path)
    assert run.cycle.tolist() == [*range(30), *range(40, 60)]
    (said,) = run.missing
    assert "damaged" in said


def test_lengths_in_a_file_are_not_believed(whole, tmp_path):
    at = whole.index(bytes([Opcode.ATTACHMENT]), 8)
    path = tmp_path / "long.mcap"
    path.write_bytes(whole[: at + 1] + struct.pack("<Q", 1 << 62) + whole[at + 9 :])
    with pytest.raises(BrokenRecording):
        read(path)


def test_a_chunk_that_unpacks_to_more_than_it_may_is_left_out(tmp_path):
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


def test_what_a_forked_child_has_buffered_of_its_parents_recording_goes_nowhere(tmp_path):
    """The two halves of it in one process; with a real fork above."""
    path = tmp_path / "run.mcap"
    file = RecordingFile(path, DTYPE, INPUTS, OUTPUTS, 0)
    file.records(records(0, 5))
    file.flush()
    parents = path.read_bytes()
    file.records(records(5, 5))
    file.disown()
    file.finish()
    file.close()
    file.disown()  # nothing to let go of any more
    assert path.read_bytes() == parents
