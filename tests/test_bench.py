"""The benchmarks' own arithmetic and documents; what they measure is not judged here."""

import json

import pytest
from click.testing import CliRunner

from hostmot2.bench import command, host
from hostmot2.bench.report import Goal, Report, Section, compare, document
from hostmot2.bench.rounds import Candidate, Timing, measure
from hostmot2.histogram import Histogram

SLOW, FAST = Timing("slow", (30.0, 10.0, 20.0)), Timing("fast", (3.0, 2.0, 2.0))


def report():
    section = Section("work", {"slow": SLOW, "fast": FAST}, "slow")
    goals = [Goal("faster", FAST.times_faster_than(SLOW), 5), Goal("time", 20.0, 10, at_least=False)]
    return Report("test", [section], goals, {"cycle": Histogram([1000] * 100)}, ["a note"])


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
    lines = [line.split(None, 1) for line in compare([report()], old).splitlines()]
    assert ["1.00", "test: work: fast"] in lines
    assert ["1.00", "test: cycle: p50_ns"] in lines
    old.write_text("[]")
    with pytest.raises(ValueError, match="not a result"):
        compare([report()], old)


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
    monkeypatch.setattr(command, "run_benchmark", lambda name, count: report())
    output = tmp_path / "out.json"
    result = CliRunner().invoke(command.bench, ["pack", "-o", str(output)])
    assert result.exit_code == 0, result.output
    assert "== test ==" in result.output
    result = CliRunner().invoke(command.bench, ["pack", "--json", "--count", "3"])
    assert json.loads(result.output)["reports"] == json.loads(output.read_text())["reports"]
    assert CliRunner().invoke(command.bench, ["nonsense"]).exit_code == 2


def test_picture_of_the_histograms(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(command, "run_benchmark", lambda name, count: report())
    picture = tmp_path / "out.png"
    result = CliRunner().invoke(command.bench, ["pack", "--plot", str(picture)])
    assert result.exit_code == 0, result.output
    assert picture.read_bytes().startswith(b"\x89PNG")


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
