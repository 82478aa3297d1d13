"""The benchmarks' own arithmetic and documents; what they measure is not judged here."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import hostmot2
from hostmot2.bench import command, doit, host, lateness, peer, picture, recorded, scale, split
from hostmot2.bench.page import page
from hostmot2.bench.report import (
    Curves,
    Goal,
    Report,
    Section,
    Table,
    compare,
    document,
    earlier,
    goals_table,
)
from hostmot2.bench.rounds import Candidate, Timing, measure
from hostmot2.histogram import Histogram

SLOW, FAST = Timing("slow", (30.0, 10.0, 20.0)), Timing("fast", (3.0, 2.0, 2.0))


def report():
    section = Section("work", {"slow": SLOW, "fast": FAST}, "slow")
    goals = [Goal("faster", FAST.times_faster_than(SLOW), 5), Goal("time", 20.0, 10, at_least=False)]
    table = Table("parts", ["wire", "host"], {"a mix": [56.0, None]})
    return Report(
        "test", [section], goals, {"cycle": Histogram([1000] * 100)}, ["a note"], [table], ["x: no y"]
    )


def test_ratios_are_medians_of_rounds_not_of_times():
    assert FAST.ns == 2.0
    assert FAST.times_faster_than(SLOW) == 10.0  # of 10, 5, 10
    assert SLOW.times_faster_than(FAST) == pytest.approx(0.1)


def test_candidates_take_turns():
    calls = []
    names = ("a", "b")
    timings = measure([Candidate(n, lambda n=n: calls.append(n), 2) for n in names], rounds=3, seconds=1e-7)
    assert set(timings) == set(names)
    assert all(len(timing.rounds) == 3 for timing in timings.values())
    assert all(ns > 0 for timing in timings.values() for ns in timing.rounds)
    order = [name for i, name in enumerate(calls) if i == 0 or calls[i - 1] != name]
    assert order[-6:] == ["a", "b"] * 3


def test_report_says_what_was_missed():
    text = str(report())
    assert "met   faster: 10.00 (goal >= 5)" in text
    assert "MISS  time: 20.00 (goal <= 10)" in text
    assert "note: a note" in text


def test_document_goes_through_json_and_compares(tmp_path):
    found = document([report()], host.facts(), "normal scheduler")
    assert json.loads(json.dumps(found)) == found
    assert found["reports"][0]["goals"][0]["met"] is True
    old = tmp_path / "old.json"
    old.write_text(json.dumps(found))
    lines = [line.split(None, 1) for line in compare([report()], earlier(old)).splitlines()]
    assert ["1.00", "test: work: fast"] in lines
    assert ["1.00", "test: cycle: p50_ns"] in lines
    old.write_text("[]")
    with pytest.raises(ValueError, match="not a result"):
        earlier(old)


def test_scheduling_is_put_back():
    import gc
    import os

    before = os.sched_getscheduler(0)
    with host.quiet() as words:
        assert words
        assert not gc.isenabled()
    assert gc.isenabled()
    assert os.sched_getscheduler(0) == before


def test_command_writes_json_and_tables(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "run", lambda *_: report())
    output = tmp_path / "out.json"
    result = CliRunner().invoke(command.bench, ["pack", "-o", str(output)])
    assert result.exit_code == 0, result.output
    assert "== test ==" in result.output
    result = CliRunner().invoke(command.bench, ["pack", "--json", "--count", "3"])
    assert json.loads(result.output)["reports"] == json.loads(output.read_text())["reports"]
    assert CliRunner().invoke(command.bench, ["nonsense"]).exit_code == 2


def test_picture_of_the_histograms(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(command, "run", lambda *_: report())
    picture = tmp_path / "out.png"
    result = CliRunner().invoke(command.bench, ["pack", "--plot", str(picture)])
    assert result.exit_code == 0, result.output
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_one_table_has_every_goal_and_says_what_was_left_out():
    lines = goals_table([report(), report()]).splitlines()
    assert lines[0].split() == ["goal", "value", "limit", "of", "limit"]
    assert lines[1].split() == ["test", "met", "faster", "10.000", ">=", "5", "0.50"]
    assert lines[2].split() == ["test", "MISSED", "time", "20.000", "<=", "10", "2.00"]
    assert lines[-3:] == ["**** LEFT OUT: x: no y"] * 2 + ["2 of 4 goals met"]
    assert Goal("drops", 0, 0, at_least=False).met
    assert Goal("drops", 0, 0, at_least=False).of_limit is None


def test_the_tail_is_what_took_longer_down_to_the_last():
    times, longer = picture.tail_of(Histogram([10_000] * 90 + [20_000] * 9 + [50_000]).buckets())
    at = {round(time): part for time, part in zip(times, longer, strict=True)}
    assert longer[0] == 1.0
    assert at[10] == pytest.approx(0.10)
    assert at[20] == pytest.approx(0.01)
    assert at[50] == pytest.approx(0.01)
    start, parts = picture.distribution(Histogram([10_000] * 3 + [40_000]).buckets())
    assert np.nansum(parts) == pytest.approx(1.0)
    assert np.nanmax(parts) == pytest.approx(0.75)
    assert start[np.nanargmax(parts)] == pytest.approx(10, rel=0.08)


def test_an_earlier_runs_lines_are_in_the_picture_too(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    before = json.loads(json.dumps(document([report()], {}, "")))
    drawn = []
    monkeypatch.setattr(picture, "_draw_row", lambda row, name, new, old: drawn.append((name, new, old)))
    picture.draw([report()], tmp_path / "x.png", {"date": "today"}, before)
    ((name, new, old),) = drawn
    assert name == "test"
    assert [len(part) for part in old["cycle"]] == [len(part) for part in new["cycle"]]
    assert old["cycle"][2] == [100]


def test_the_page_is_markdown_with_goals_tables_and_reasons(tmp_path):
    text = page([report()], {"date": "today", "absent": "not installed"}, "normal scheduler")
    assert "| test | faster | 10 | >= 5 | 0.50 | met |" in text
    assert "| test | time | 20 | <= 10 | 2.00 | **missed** |" in text
    assert "| a mix | 56 |  |" in text
    assert "date today; scheduling normal scheduler." in text
    assert "* **Left out:** x: no y" in text


@pytest.mark.parametrize("mix", doit.MIXES, ids=[mix.name for mix in doit.MIXES])
def test_the_floor_of_a_mix_is_that_of_the_fact_sheet(mix):
    """sserial.md 10: characters of the longest channel at 4 us; performance.md 6: 7 reads and 5 writes."""
    wire = {"field I/O": 40, "field I/O, mode 2": 60, "analog outputs": 56, "7I77, mode 2": 60}.get(
        mix.name, 56
    )
    with mix.emulated("virtual") as card, hostmot2.open(card) as board:
        mix.start(board)
        assert split.wire_us(board.sserial[0], mix.mask) == wire
        if mix.name == "7I77, mode 2":
            assert split.words_of(board.sserial[0], mix.mask) == (7, 5)


def test_a_card_of_ones_own_is_measured_by_its_url():
    found = doit.run(20, "emu://5i25+7i77")
    ((name, cells),) = found.tables[0].rows.items()
    assert name == "5I25, channels 0x03"
    parts = dict(zip(found.tables[0].columns, cells, strict=True))
    assert parts["wire"] == 56
    assert parts["p50"] >= parts["wire"] + parts["host"]
    assert len(found.histograms[name]) == 20


def test_the_python_of_the_how_to_runs(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    text = (Path(__file__).parent.parent / "docs/how-to/measure.md").read_text()
    (block,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    exec(compile(block.replace('"doit", 100', '"doit", 5'), "measure.md", "exec"), {})
    assert (tmp_path / "doit.png").exists()


def test_cycles_are_compared_with_a_bare_loop_round_by_round():
    found = Report("cycle")
    lateness.wake(found, 1, 0.02)
    assert [len(h) for h in found.histograms.values()] == [pytest.approx(20, abs=19)] * 4
    assert len(found.goals) == 3
    recorded.pushes(found)
    assert found.goals[-1].value == 0


def test_every_peer_does_the_same_work():
    """Runs the candidates once: each is compared with ours before it is timed."""
    for package in ("cbitstruct", "bitstruct", "cantools"):
        pytest.importorskip(package)
    from hostmot2.bench import pack

    found = Report("pack")
    pack._unpack(found, 1)
    pack._pack(found, 1)
    assert [len(section.timings) for section in found.sections] == [12, 7]


def test_peers_that_are_not_there_are_left_out(monkeypatch):
    from hostmot2.bench import pack, peers

    monkeypatch.setattr(peers, "installed", lambda name: False)
    found = Report("pack")
    pack._pack(found, 1)
    assert set(found.sections[0].timings) == {pack.ONE, pack.SET, pack.PORT}
    assert found.goals == []


def test_what_cannot_be_run_is_left_out_loudly(monkeypatch):
    monkeypatch.setattr(peer, "missing", lambda: "it needs root")
    found = peer.run()
    assert "**** LEFT OUT: LinuxCNC's hm2_eth beside ours: it needs root" in str(found)
    assert found.goals == []


def test_curves_are_drawn_and_told(tmp_path):
    pytest.importorskip("matplotlib")
    curves = Curves("cost", "cards", "us", [1, 2], {"p50": [3.0, 4.0], "p99": [5.0, 6.0]})
    found = Report("scale", curves=[curves])
    assert "| 2 | 4 | 6 |" in page([found], {}, "")
    picture.draw([found, report()], tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")


def test_cost_is_measured_for_several_cards():
    found = scale._several(2, 0.05)
    assert len(found["cycle"]) > 20


def test_a_minute_with_a_stalled_disk_unless_told_otherwise():
    assert [recorded.stalled_seconds(count) for count in (None, 1, 20)] == [60, 6, 20]
