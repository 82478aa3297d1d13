"""Every benchmark runs to its end with little to do, and finds what does not depend on the machine."""

import pytest

from hostmot2.bench import cycle, lateness, recorded, rtt
from hostmot2.bench.report import Report


def goals(report):
    return {goal.text: goal.value for goal in report.goals}


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(rtt, "EXCHANGES", 30)


def test_a_cycle_over_udp_is_one_datagram_each_way(few):
    found = Report("rtt")
    rtt._cycle(found, 1)
    assert goals(found)["datagrams per cycle, both ways"] == 2
    (section,) = found.sections
    assert set(section.timings) == {rtt.BARE, rtt.ENGINE, rtt.FROM_PYTHON, rtt.WITH_VALUES}
    # what is sent and awaited: the numbers around it, and 27 words of registers and three rows of channels
    assert f"{rtt.REPLY_SIZE} back" in section.title


def test_an_emulated_card_answers_as_many_requests_as_are_under_way(few):
    found = Report("rtt")
    rtt._emulator(found, 1)
    assert [set(section.timings) for section in found.sections] == [{rtt.ANSWERER, rtt.CARD}] * 2
    assert len(rtt._register_request()) == 4 + 4 * (len(rtt.READS) + len(rtt.USER)) + 8 + 4


def test_at_a_fixed_rate_nothing_is_lost_and_late_cycles_are_accounted_for(monkeypatch):
    monkeypatch.setattr(rtt, "PERIODIC_HZ", 200)
    found = Report("rtt")
    rtt._periodic(found, seconds=1)
    assert list(goals(found).values()) == [0, 0]
    assert found.notes[0].startswith("200 cycles in 1 s at 200 Hz")


def test_the_whole_benchmark_in_order(few, monkeypatch):
    monkeypatch.setattr(rtt, "PERIODIC_HZ", 50)
    found = rtt.run(1)
    assert len(found.sections) == 3
    assert found.notes[-1].startswith("both ends on this machine")


@pytest.mark.parametrize("style", ["pipelined", "read-modify-write"])
def test_smart_serial_moves_as_few_registers_as_promised(style):
    found = Report("cycle")
    cycle._words(found, style)
    assert all(goal.met for goal in found.goals)
    assert len(found.goals) == 2


def test_a_computing_thread_is_compared_with_an_idle_one(monkeypatch):
    monkeypatch.setattr(lateness, "BUSY_RATE", 500)
    found = Report("cycle")
    lateness.busy(found, 1, 0.1)
    assert set(found.histograms) == {"cycle, Python idle", "cycle, Python computing"}
    assert all(len(histogram) > 0 for histogram in found.histograms.values())


def test_recording_is_compared_with_not_recording(monkeypatch):
    monkeypatch.setattr(recorded, "RATE", 500)
    monkeypatch.setattr(recorded, "_served", lateness._started)  # a busy machine would lose the link
    found = Report("cycle")
    recorded.cost(found, 1, 0.2)
    (table,) = found.tables
    assert len(table.rows) == 4
    assert len(found.goals) == 3


def test_a_disk_that_stalls_costs_no_record(monkeypatch):
    monkeypatch.setattr(recorded, "STALL_SECONDS", 0.2)
    monkeypatch.setattr(recorded, "FAST", 500)
    found = Report("cycle")
    recorded.stalled_disk(found, 1.0)
    assert list(goals(found).values()) == [0, 0]


@pytest.mark.parametrize("stride", [12, 16])
def test_bulk_decode_gives_what_the_peers_give(monkeypatch, stride):
    pytest.importorskip("numpy")
    from hostmot2.bench import pack

    monkeypatch.setattr(pack, "RECORDS", 2000)
    found = Report("pack")
    pack._bulk(found, 1, stride)
    assert all(timing.ns > 0 for section in found.sections for timing in section.timings.values())
    assert found.sections
