"""Recordings for other programs, as pictures, and on the command line."""

import csv
import json
import struct

import numpy as np
import pytest

from hostmot2.record_ring import RecordRing
from hostmot2.recording import Recorder, Signal, plot, read, to_csv, to_parquet
from hostmot2.recording.picture import envelope
from hostmot2.recording.play import emulator_keys, play
from recording.making import DTYPE, IMAGE, INPUTS, OUTPUTS, PERIOD_NS, push_all, record_file, records


@pytest.fixture
def path(tmp_path):
    return record_file(tmp_path / "run.mcap", records(0, 300))


def test_csv_gives_the_same_doubles_and_names_the_units(path, tmp_path):
    run = read(path)
    to_csv(run, tmp_path / "run.csv")
    with open(tmp_path / "run.csv", newline="") as stream:
        header, *rows = csv.reader(stream)
    assert header[:3] == ["time_ns", "enc0.position [mm]", "enc0.velocity [mm/s]"]
    assert [int(row[0]) for row in rows] == run.time_ns.tolist()
    assert np.array([float(row[1]) for row in rows]).tobytes() == run["enc0.position"].tobytes()


def test_parquet_keeps_types_units_and_nanoseconds(path, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    run = read(path)
    to_parquet(run, tmp_path / "run.parquet", ["enc0.position", "cycle"])
    table = parquet.read_table(tmp_path / "run.parquet")
    assert table.column_names == ["time", "enc0.position", "cycle"]
    assert table.schema.field("enc0.position").metadata == {b"unit": b"mm"}
    assert str(table.schema.field("time").type) == "timestamp[ns, tz=UTC]"
    assert table["time"].cast("int64").to_pylist() == run.time_ns.tolist()
    assert table["cycle"].to_pylist() == list(range(300))
    assert table["enc0.position"].to_numpy().tobytes() == run["enc0.position"].tobytes()


def test_a_plot_is_a_picture(path, tmp_path):
    pytest.importorskip("matplotlib")
    plot(read(path), tmp_path / "run.png")
    data = (tmp_path / "run.png").read_bytes()
    assert data.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", data[16:24])
    assert width > 500 < height


def test_few_points_keep_every_peak():
    x = np.arange(1_000_000) / 1000.0
    y = np.sin(x)
    y[123_456], y[654_321] = 50.0, -50.0
    few_x, few_y = envelope(x, y)
    assert len(few_y) < 10_000
    assert few_x[few_y.argmax()] == x[123_456]
    assert few_x[few_y.argmin()] == x[654_321]
    assert (np.diff(few_x) > 0).all()


def test_what_is_no_number_hides_no_peak_beside_it():
    y = np.full(100_000, 5.0)
    y[500::1000] = np.nan
    y[70_007], y[30_003] = 6.0, 4.0
    few = envelope(np.arange(100_000.0), y)[1]
    assert (np.nanmin(few), np.nanmax(few)) == (4.0, 6.0)
    assert np.isfinite(few).all(), "a stretch has other values"
    alone = envelope(np.arange(100_000.0), np.full(100_000, np.nan))[1]
    assert np.isnan(alone).all()


def test_what_is_not_there_cannot_be_drawn(path, tmp_path):
    pytest.importorskip("matplotlib")
    with pytest.raises(KeyError, match="enc9"):
        plot(read(path), tmp_path / "run.png", ["enc9"])
    empty = record_file(tmp_path / "empty.mcap", records(0, 0))
    with pytest.raises(ValueError, match="no records"):
        plot(read(empty), tmp_path / "run.png")


def test_a_picture_without_a_suffix_is_refused(path, tmp_path):
    """It was written to another file than the one named."""
    pytest.importorskip("matplotlib")
    for name in ("run", "run."):
        with pytest.raises(ValueError, match=r"\.png, \.svg or \.pdf"):
            plot(read(path), tmp_path / name)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_playing_sets_what_changes_at_its_time(path):
    now, calls = [0.0], []

    def sleep(seconds):
        now[0] += seconds

    run = read(path)
    refused = play(
        run,
        {"a": "enc0.position", "b": "status", "no": "analog0"},
        lambda key, value: calls.append((round(now[0], 9), key, value)) if key != "no" else refuse(),
        speed=2.0,
        sleep=sleep,
        clock=lambda: now[0],
    )

    def times(key):
        return [at for at, name, _ in calls if name == key]

    assert times("b") == [0.0]  # it never changes
    assert np.allclose(times("a"), np.arange(300) * 0.00025 / 2)
    assert list(refused) == ["no"]


def refuse():
    raise ValueError("no such key")


def test_only_what_a_machine_tells_goes_into_an_emulator(path):
    assert emulator_keys(read(path)) == {}


def test_hm2_play_prints_rows(hm2, path):
    status, out, _ = hm2("play", path, "--every", "100", "-c", "enc0.position")
    assert status == 0
    lines = out.splitlines()
    assert "300 cycles" in lines[0]
    assert lines[1].split("\t") == ["seconds", "cycle", "enc0.position [mm]"]
    assert lines[3].split("\t") == ["0.025000", "100", f"{100 / 7:.9g}"]
    document = json.loads(hm2("--json", "play", path, "-c", "cycle")[1])
    assert document["columns"] == {"cycle": list(range(300))}
    assert (document["dropped"], document["gaps"], document["missing"]) == (0, [], [])


def test_hm2_play_shows_words_and_counts_whole(hm2, tmp_path):
    made = records(0, 3)
    made["inputs"][:, 0] = [0xFFFFFFFF, -12345678, np.nan]
    made["inputs"][:, 1] = [1234.56789, 1e300, -np.inf]
    path = record_file(tmp_path / "run.mcap", made)
    lines = hm2("play", path, "-c", "enc0.position", "-c", "enc0.velocity")[1].splitlines()[2:]
    assert [line.split("\t")[2:] for line in lines] == [
        ["4294967295", "1234.56789"],
        ["-12345678", "1e+300"],
        ["nan", "-inf"],
    ]


def test_columns_have_their_units_in_whatever_capitals_they_are_asked_for(hm2, path, tmp_path):
    run = read(path)
    to_csv(run, tmp_path / "run.csv", ["ENC0.Position"])
    assert (tmp_path / "run.csv").read_text().splitlines()[0] == "time_ns,enc0.position [mm]"
    assert "enc0.position [mm]" in hm2("play", path, "-c", "ENC0.POSITION")[1]
    with pytest.raises(KeyError, match="no column 'nothing'"):
        to_csv(run, tmp_path / "none.csv", ["nothing"])


def test_a_foreign_file_does_not_steer_the_terminal(hm2, tmp_path):
    ring = RecordRing(DTYPE, 8)
    names = (Signal("x\x1b[2J\n", "mm\x07"), Signal("y"))
    with Recorder(ring, tmp_path / "run.mcap", names, OUTPUTS, clock=lambda: 10**12) as recorder:
        push_all(ring, records(0, 2))
        recorder.log("gone\x1b[1A\r\nhm2: all is well", "warning", "\x9b2K", 10**12)
    shown = hm2("play", tmp_path / "run.mcap")[1]
    assert all(each.isprintable() or each in "\n\t" for each in shown)
    assert "# ?2K: gone?[1A??hm2: all is well" in shown
    assert "x?[2J? [mm?]" in shown


def test_hm2_plot_and_export_write_files(hm2, path, tmp_path):
    assert hm2("export", path, "-o", tmp_path / "out.csv", "-c", "cycle")[0] == 0
    assert (tmp_path / "out.csv").read_text().splitlines()[0] == "time_ns,cycle"
    assert hm2("plot", path, "-o", tmp_path / "out.png")[0] == 0
    assert (tmp_path / "out.png").exists()
    status, _, err = hm2("export", path, "-o", tmp_path / "out.xls")
    assert (status, "the name must end in .csv or .parquet" in err) == (2, True)
    assert hm2("export", path, "-o", tmp_path / "out.csv", "-c", "nothing")[0] == 2
    assert hm2("play", tmp_path / "nowhere.mcap")[0] == 3
    (tmp_path / "text.mcap").write_text("x" * 100)
    status, _, err = hm2("play", tmp_path / "text.mcap")
    assert status == 6
    assert "HM2-E111" in err


def test_what_cannot_be_played_into_an_emulator_is_said_before_it_is_asked(hm2, path, tmp_path):
    status, _, err = hm2("play", path, "--control", tmp_path / "nobody")
    assert (status, "no columns an emulator takes; say which with --map" in err) == (2, True)
    status, _, err = hm2("play", path, "--control", tmp_path / "nobody", "--map", "input")
    assert (status, "'input' is not KEY=COLUMN" in err) == (2, True)


def test_columns_are_played_where_they_are_mapped(hm2, path, monkeypatch):
    told = []
    monkeypatch.setattr("hostmot2.cli.recording.ask", lambda _control, *words: told.append(words) or "ok")
    options = ("--control", "x", "--speed", "0", "--map", "encoder0_position=cycle")
    assert hm2("play", path, *options)[0] == 0
    assert told[:2] == [("set", "encoder0_position", "0"), ("set", "encoder0_position", "1")]
    assert len(told) == 300


def test_a_log_is_shown_between_the_rows_of_its_time(hm2, tmp_path):
    ring = RecordRing(DTYPE, 512)
    with Recorder(
        ring, tmp_path / "run.mcap", INPUTS, OUTPUTS, image=IMAGE, clock=lambda: 10**12
    ) as recorder:
        push_all(ring, records(0, 20))
        recorder.log("the door was opened", "warning", "machine", 10**12 + 10 * PERIOD_NS)
    lines = hm2("play", tmp_path / "run.mcap", "-c", "cycle")[1].splitlines()
    said = next(n for n, line in enumerate(lines) if line == "# machine: the door was opened")
    cycles = [line.split("\t")[1] for line in (lines[said - 1], lines[said + 1])]
    assert cycles == ["9", "10"]


def test_a_gap_is_drawn_where_records_are_missing(tmp_path, monkeypatch):
    axes = pytest.importorskip("matplotlib.axes")
    lines = []
    monkeypatch.setattr(axes.Axes, "axvline", lambda _self, x, **_options: lines.append(float(x)))
    made = np.concatenate([records(0, 50), records(80, 50)])
    run = read(record_file(tmp_path / "gap.mcap", made))
    assert [(gap.first, gap.count) for gap in run.gaps] == [(50, 30)]
    plot(run, tmp_path / "gap.png", ["enc0.position"])
    assert lines == [pytest.approx(80 * PERIOD_NS / 1e9)]
    backwards = np.concatenate(
        [records(80, 50), records(200, 50), records(0, 50)]
    )  # as a damaged file has it
    plot(read(record_file(tmp_path / "back.mcap", backwards)), tmp_path / "back.png", ["enc0.position"])
    assert len(lines) == 2
