import json
import threading

import numpy as np
import pytest
from mcap.reader import make_reader

from hostmot2.record_ring import STAGES, RecordRing, record_dtype
from hostmot2.recording import Recorder, RecordingFailed, Signal, read
from recording.making import DTYPE, IMAGE, INPUTS, OUTPUTS, PERIOD_NS, push_all, record_file, records


def messages(path, topic):
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [(m.log_time, json.loads(m.data)) for _, _, m in reader.iter_messages(topic)]


def test_every_bit_of_a_record_comes_back(tmp_path):
    made = records(0, 500)
    noise = np.random.default_rng(1)
    for field in ("words", "inputs", "outputs"):
        as_bytes = noise.integers(0, 256, made[field].nbytes, np.uint8)
        made[field] = as_bytes.view(made[field].dtype).reshape(made[field].shape)
    made["inputs"][0] = [-0.0, np.inf]
    made["status"] = noise.integers(-40, 1, 500)
    made["flags"] = noise.integers(0, 1 << 32, 500)
    found = read(record_file(tmp_path / "run.mcap", made, parts=7)).records
    assert len(found) == 500
    for field in set(made.dtype.names) - {"pad", "reserved"}:
        assert found[field].tobytes() == made[field].tobytes()


def test_columns_are_found_by_name_with_their_units(tmp_path):
    made = records(100, 50)
    run = read(record_file(tmp_path / "run.mcap", made))
    assert np.array_equal(run["enc0.position"], made["inputs"][:, 0])
    assert np.array_equal(run["analog0"], made["outputs"][:, 0])
    assert np.array_equal(run["cycle"], np.arange(100, 150))
    assert run.units["enc0.velocity"] == "mm/s"
    assert run.units["total_us"] == "us"
    assert list(run["wake_us"]) == [1.0] * 50
    assert list(run["total_us"]) == [float(len(STAGES))] * 50
    assert set(run) >= {"enc0.position", "analog0", "status", "write_us"}
    assert all(len(run[name]) == 50 for name in run)
    with pytest.raises(KeyError, match="no column 'enc9'"):
        run["enc9"]


def test_an_output_called_like_an_input_keeps_both(tmp_path):
    ring = RecordRing(record_dtype(0, 1, 1), 8)
    made = records(0, 3, ring.dtype)
    with Recorder(ring, tmp_path / "run.mcap", [Signal("x")], [Signal("x")]):
        push_all(ring, made)
    run = read(tmp_path / "run.mcap")
    assert np.array_equal(run["x"], made["inputs"][:, 0])
    assert np.array_equal(run["outputs.x"], made["outputs"][:, 0])


def test_registers_are_found_by_address_and_direction(tmp_path):
    made = records(0, 10)
    run = read(record_file(tmp_path / "run.mcap", made))
    assert run.image == IMAGE
    assert np.array_equal(run.register(0x5B00), made["words"][:, 0])
    assert np.array_equal(run.register(0x5B00, written=True), made["words"][:, 2])
    assert run.fresh(0x5B00).all()
    assert not run.fresh(0x5C00).any()
    with pytest.raises(KeyError, match="0x5C00 was not recorded as written"):
        run.register(0x5C00, written=True)


def test_the_image_may_grow_while_recording(tmp_path):
    known = [0x5B00]
    ring = RecordRing(DTYPE, 64)
    recorder = Recorder(ring, tmp_path / "run.mcap", INPUTS, OUTPUTS, image=lambda: known)
    push_all(ring, records(0, 5))
    recorder._drain()
    known.append(0x5C00)
    push_all(ring, records(5, 5))
    recorder.close()
    assert read(tmp_path / "run.mcap").image == (0x5B00, 0x5C00)


def test_times_are_those_of_the_cycles_and_never_jump(tmp_path, monkeypatch):
    monkeypatch.setattr("time.time_ns", lambda: 1_700_000_000_000_000_007)
    run = read(record_file(tmp_path / "run.mcap", records(0, 20)))
    assert list(run.time_ns) == [1_700_000_000_000_000_007 + i * PERIOD_NS for i in range(20)]
    plotted = messages(tmp_path / "run.mcap", "/hm2/inputs")
    assert [time for time, _ in plotted] == list(run.time_ns)


def test_viewers_find_flat_numbers_with_plain_names(tmp_path):
    path = record_file(tmp_path / "run.mcap", records(0, 3))
    assert messages(path, "/hm2/inputs")[2][1] == {
        "cycle": 2,
        "enc0_position": 2 / 7,
        "enc0_velocity": 2 / 7 + 1,
    }
    cycle = messages(path, "/hm2/cycle")[0][1]
    assert cycle == {"cycle": 0, "status": 0, "flags": 0, "total_us": 7.0} | {f"{s}_us": 1.0 for s in STAGES}
    with open(path, "rb") as stream:
        summary = make_reader(stream).get_summary()
    channel = next(each for each in summary.channels.values() if each.topic == "/hm2/inputs")
    schema = json.loads(summary.schemas[channel.schema_id].data)
    assert schema["type"] == "object"
    assert schema["properties"]["enc0_position"] == {
        "type": "number",
        "description": "enc0.position [mm]: where the axis is",
    }
    assert channel.metadata == {"enc0_position": "mm", "enc0_velocity": "mm/s"}


def test_names_that_look_alike_to_viewers_stay_apart(tmp_path):
    ring = RecordRing(record_dtype(0, 4, 0), 8)
    signals = [Signal("a.b"), Signal("a b"), Signal("7i77"), Signal("cycle")]
    with Recorder(ring, tmp_path / "run.mcap", signals):
        push_all(ring, records(0, 1, ring.dtype))
    assert list(messages(tmp_path / "run.mcap", "/hm2/inputs")[0][1].values()) == [0, 0, 1, 2, 3]


def test_the_layout_plots_paths_that_exist(tmp_path):
    path = record_file(tmp_path / "run.mcap", records(0, 2))
    layout = json.loads(read(path).attachments["layout.foxglove.json"])
    plotted = [p["value"] for panel in layout["configById"].values() for p in panel.get("paths", ())]
    assert {"/hm2/inputs.enc0_position", "/hm2/outputs.analog0", "/hm2/cycle.total_us"} <= set(plotted)
    for each in plotted:
        topic, field = each.rsplit(".", 1)
        assert field in messages(path, topic)[0][1]

    def panels(node):
        return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])

    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])


def test_json_rate_thins_out_what_viewers_get_and_nothing_else(tmp_path):
    path = record_file(tmp_path / "run.mcap", records(0, 400), json_rate=1000, parts=5)  # 4 kHz
    assert [m["cycle"] for _, m in messages(path, "/hm2/inputs")] == list(range(0, 400, 4))
    assert len(read(path).records) == 400
    assert messages(record_file(tmp_path / "none.mcap", records(0, 9), json_rate=0), "/hm2/cycle") == []


def test_drops_are_counted_exactly_and_seen_as_gaps(tmp_path):
    ring = RecordRing(DTYPE, 8)
    push_all(ring, records(0, 20))  # 12 dropped before the recording began: not its own
    ring.pop()
    recorder = Recorder(ring, tmp_path / "run.mcap", INPUTS, OUTPUTS)
    assert push_all(ring, records(0, 100)) == 8
    recorder._drain()
    assert push_all(ring, records(100, 3)) == 3
    recorder.close()
    assert recorder.counters == (11, 92)
    run = read(tmp_path / "run.mcap")
    assert run.dropped == 92
    assert [(gap.first, gap.count) for gap in run.gaps] == [(8, 92)]


def test_a_disk_that_stalls_for_a_second_costs_no_record(tmp_path, monkeypatch):
    ring = RecordRing(DTYPE, 8192)
    recorder = Recorder(ring, tmp_path / "run.mcap", INPUTS, OUTPUTS, flush_s=0.02, json_rate=100)
    stalled, go_on, flush = threading.Event(), threading.Event(), recorder._sink.flush

    def stall():
        stalled.set()
        go_on.wait(60)
        flush()

    with recorder:
        push_all(ring, records(0, 4000))
        monkeypatch.setattr(recorder._sink, "flush", stall)
        assert stalled.wait(60)
        push_all(ring, records(4000, 4000))  # what 4 kHz brings in a second
        go_on.set()
        push_all(ring, records(8000, 4000)[:192])
    run = read(tmp_path / "run.mcap")
    assert (run.dropped, run.gaps) == (0, ())
    assert np.array_equal(run.cycle, np.arange(8192))


def test_a_full_disk_stops_the_writer_not_the_cycle(tmp_path):
    ring = RecordRing(DTYPE, 64)
    recorder = Recorder(ring, tmp_path / "run.mcap", INPUTS, OUTPUTS)

    def full(*_):
        raise OSError(28, "No space left on device")

    recorder._sink.records = full
    recorder.start()
    push_all(ring, records(0, 5))
    recorder._thread.join(60)
    assert push_all(ring, records(5, 100)) < 100  # the ring fills, nobody waits
    with pytest.raises(RecordingFailed, match="No space left") as caught:
        recorder.close()
    assert caught.value.os_errno == 28
    assert len(read(tmp_path / "run.mcap").records) == 0


@pytest.mark.parametrize("part", ["finish", "close"])
def test_a_disk_that_is_full_only_at_the_end_is_told_and_what_was_flushed_reads(tmp_path, part):
    ring = RecordRing(DTYPE, 64)
    recorder = Recorder(ring, tmp_path / "run.mcap", INPUTS, OUTPUTS).start()
    push_all(ring, records(0, 5))
    sink, done = recorder._sink, getattr(recorder._sink, part)

    def full():
        done()
        raise OSError(28, "No space left on device")

    setattr(sink, part, full)
    with pytest.raises(RecordingFailed, match=r"after 5 records: .*No space left") as caught:
        recorder.close()
    assert caught.value.os_errno == 28
    assert isinstance(recorder.failure, OSError)
    assert len(read(tmp_path / "run.mcap").records) == 5
    recorder.close()  # said once


def test_a_recorder_is_started_once(tmp_path):
    recorder = Recorder(RecordRing(DTYPE, 64), tmp_path / "run.mcap", INPUTS, OUTPUTS)
    with recorder, pytest.raises(RuntimeError, match="started once"):
        recorder.start()
    with pytest.raises(RuntimeError, match="started once"):
        recorder.start()
    with pytest.raises(ValueError, match="level 'loud'"):
        recorder.log("text", "loud")


def test_the_log_is_kept_with_its_times(tmp_path):
    ring = RecordRing(DTYPE, 64)
    with Recorder(ring, tmp_path / "run.mcap", INPUTS, OUTPUTS, clock=lambda: 0) as recorder:
        recorder.log("channel 1: timeout", "error", "sserial", time_ns=5)
    run = read(tmp_path / "run.mcap")
    assert [(e.time_ns, e.level, e.name, e.message) for e in run.log] == [
        (run.unix_ns + 5, 4, "sserial", "channel 1: timeout")
    ]


def test_signals_have_names_of_their_own(tmp_path):
    twice = [Signal("x"), Signal("x", "mm")]
    with pytest.raises(ValueError, match="two inputs have the same name"):
        Recorder(RecordRing(DTYPE, 8), tmp_path / "run.mcap", twice, OUTPUTS)
    assert not (tmp_path / "run.mcap").exists()


def test_columns_cannot_be_changed(tmp_path):
    run = read(record_file(tmp_path / "run.mcap", records(0, 3)))
    for name, column in run.items():
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 1
        assert not column.flags.writeable, name


def test_signals_and_records_must_agree(tmp_path):
    with pytest.raises(ValueError, match="1 inputs are named, records have 2"):
        Recorder(RecordRing(DTYPE, 8), tmp_path / "run.mcap", [Signal("x")], OUTPUTS)
    assert not (tmp_path / "run.mcap").exists()
