"""What the monitor knows of a card: snapshots, without a terminal."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from monitor_source import started_source

import hostmot2
from hostmot2 import recording
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.cards import card as described
from hostmot2.emulator.ethernet import EthernetServer, Fault
from hostmot2.errors import CardBusy, EngineError, HostMot2Error, TransportTimeout
from hostmot2.modules import driven
from hostmot2.monitor import Source, text
from hostmot2.monitor.snapshot import BitsRow, ChannelRow, Snapshot, ValueRow
from hostmot2.registers import Gtag
from hostmot2.sserial import ChannelStatus, NoFirmware
from hostmot2.transports.emulated import transport_of
from tests.write_witness import Witness


@pytest.fixture
def card() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual")


@pytest.fixture
def source(card: EmulatedBoard) -> Iterator[Source]:
    with started_source(card, modes={(0, 0): 2}) as made:
        yield made


def field_io(card: EmulatedBoard) -> Any:
    return card.sserial[0].remote(0)


def analog(card: EmulatedBoard) -> Any:
    return card.sserial[0].remote(1)


def row(rows: Any, name: str) -> Any:
    return next(each for each in rows if each.name == name)


# -- only looking


def test_looking_writes_nothing_from_opening_to_closing(card: EmulatedBoard) -> None:
    witness = Witness(transport_of(card))
    with hostmot2.Board(witness.transport, read_only=True) as board:
        looking = Source(board)
        looking.start()
        for _ in range(15):  # long enough for all that is done now and then
            now = looking.look()
        looking.close()
    assert now.access == "read-only"
    assert (now.cycles, now.lost) == (300, 0)
    assert witness.written == []


def test_looking_shows_what_another_program_does(card: EmulatedBoard) -> None:
    with hostmot2.open(card) as driver:
        driver.watchdog.timeout = 1.0  # a look takes 0.1 s here
        driver.card("7i77").start()
        driver.encoders  # noqa: B018 - set up by who drives
        card.encoder_input(3).run(edge_period_ns=100_000.0, counts=1_000_000)
        with hostmot2.open(card, read_only=True) as board:
            looking = Source(board)
            looking.start()
            for _ in range(5):
                driver.card("7i77").exchange()
                now = looking.look()
            looking.close()
        moving = row(now.encoders, "encoder3")
        assert moving.velocity == pytest.approx(10_000, rel=0.01)
        assert [channel.status.state for channel in now.channels] == ["running", "running", "stopped"]
        assert not any(channel.started for channel in now.channels)  # not by this program
        assert now.watchdog.startswith(("armed", "bitten"))
        assert row(now.bits, "P3 driven").value == card.read(0x1100) & 0x1FFFF
        assert row(now.bits, "P2 pads").value == card.read(0x1004) & 0x1FFFF
        assert "--start all" in now.hints[0]


def until(source: Source, wanted: Callable[[Snapshot], bool]) -> Snapshot:
    end = time.monotonic() + 20
    while not wanted(source.latest):
        assert source.failure is None
        assert time.monotonic() < end, source.latest
        time.sleep(0.02)
    return source.latest


def test_looking_goes_on_when_the_network_is_back() -> None:
    """A link is given up after some lost exchanges; whoever only looks has nothing to set up anew."""
    served = EmulatedBoard("7i92+7i77", clock="real")
    with EthernetServer(served) as server, hostmot2.open(server.url, read_only=True) as board:
        looking = Source(board)
        looking.start()
        until(looking, lambda now: now.cycles > 0)
        server.set_fault(Fault(loss=1.0))
        until(looking, lambda now: now.problem is not None and now.problem.explain == "HM2-E090")
        server.set_fault(Fault())
        back = until(looking, lambda now: now.problem is None)
        until(looking, lambda now: now.cycles > back.cycles + 20 and now.lost == back.lost)
        looking.close()


def test_who_drives_is_told_to_begin_anew_when_the_link_was_given_up() -> None:
    served = EmulatedBoard("7i92+7i77", clock="real")
    with EthernetServer(served) as server, hostmot2.open(server.url) as board:
        driving = Source(board, start={}, allow_write=True)
        driving.start()
        server.set_fault(Fault(loss=1.0))
        told = until(driving, lambda now: now.problem is not None and now.problem.explain == "HM2-E090")
        assert told.problem is not None
        assert "quit and start the monitor anew" in told.problem.text
        server.set_fault(Fault())
        time.sleep(0.5)
        assert driving.latest.problem is not None, "nothing goes on by itself"
        with suppress(HostMot2Error):
            driving.close()


def test_outputs_cannot_be_armed_when_only_looking(card: EmulatedBoard) -> None:
    with hostmot2.open(card, read_only=True) as board:
        looking = Source(board, allow_write=True)
        looking.start()
        with pytest.raises(EngineError, match="--allow-write"):
            looking.outputs.arm()
        looking.close()


def test_a_card_whose_watchdog_is_fed_is_not_taken_over(monkeypatch: pytest.MonkeyPatch) -> None:
    served = EmulatedBoard("5i25+7i77", clock="real")
    with hostmot2.open(served) as other:
        other.watchdog.arm(timeout=30.0)
        assert not driven.is_driven(other)  # it runs down, nobody feeds it
        monkeypatch.setattr(driven.time, "sleep", lambda _seconds: other.watchdog.feed())
        assert driven.is_driven(other)
        with pytest.raises(CardBusy, match="feeds its watchdog"):
            Source(other, start={})


# -- started


def test_a_remote_whose_own_watchdog_has_bitten_is_told_with_what_helps(
    source: Source, card: EmulatedBoard
) -> None:
    assert not any("bitten" in hint for hint in source.look().hints)
    analog(card).fault = 0x01
    source.look()
    assert source.look().hints[0] == "Its own watchdog has bitten, start the monitor anew: 0.1."


def test_channels_with_mode_state_and_counters(source: Source, card: EmulatedBoard) -> None:
    first, second, third = source.look().channels
    assert (first.name, first.unit_number, first.mode) == ("7I77", 0x12000001, "2 IO_Ana_FV")
    assert (second.name, second.mode, second.started) == ("7I77", "0 Standard", True)
    assert (third.name, third.started, third.idle) == ("", False, True)
    assert first.faults == second.past == ()
    analog(card).inject(bad_crc=1)
    for _ in range(15):
        found = source.look().channels[1]
        source._due["counters"] = 0.0
    assert found.past == ("communication error", "CRC error", "timeout")
    assert found.counters is not None
    assert (found.counters.crc_errors, found.counters.timeouts) == (1, 1)
    assert found.failed == 1
    assert "CRC error" in text.channel_trouble(found)
    assert source.look().events[0].explain.startswith("CS=0x")


def test_a_remotes_fault_is_shown_in_words_and_turns_outputs_off(source: Source, card: EmulatedBoard) -> None:
    source.outputs.arm()
    assert source.look().access == "ARMED"
    field_io(card).fault = 0x04
    now = source.look()
    assert now.channels[0].faults == ("over temperature",)
    assert text.channel_state(now.channels[0]) == "FAULT"
    assert (now.access, now.off) == ("outputs off", "a remote reports a fault")
    assert not source.outputs.armed
    assert any("over temperature" in event.text for event in now.events)


def test_values_and_bits_are_those_of_the_card(source: Source, card: EmulatedBoard) -> None:
    field_io(card).set("input", 0x80000005)
    field_io(card).set("fieldvoltage", 24.0)
    field_io(card).set("analogin1", 12.0)
    now = source.look()
    bits = row(now.bits, "0.0 Input")
    assert (bits.value, bits.width) == (0x80000005, 32)
    assert row(now.values, "0.0 FieldVoltage").value == pytest.approx(24.0, abs=0.2)
    assert row(now.values, "0.0 AnalogIn1").value == pytest.approx(12.0, abs=0.2)
    assert row(now.values, "0.0 AnalogIn1").unit == "V"
    assert [b.name for b in now.bits if b.is_output] == ["0.0 Output", "0.1 AnalogEna", "0.1 SpinEna"]


def test_outputs_are_off_until_armed_and_forgotten_when_disarmed(source: Source, card: EmulatedBoard) -> None:
    signal = "sserial0.1.AnalogOut2"
    with pytest.raises(EngineError, match="arm them first"):
        source.outputs.set(signal, 5.0)
    source.look()
    assert analog(card).get("analogout2") == 0.0
    source.outputs.arm()
    source.look()
    source.outputs.set(signal, 5.0)
    assert row(source.look().values, "0.1 AnalogOut2").value == 5.0
    assert analog(card).get("analogout2") == pytest.approx(5.0, abs=0.01)
    source.outputs.disarm()
    source.look()
    assert analog(card).get("analogout2") == 0.0
    source.outputs.arm()
    source.look()
    assert analog(card).get("analogout2") == 0.0


def test_a_view_that_hangs_loses_its_outputs(source: Source, card: EmulatedBoard) -> None:
    source.outputs.arm()
    source.look()
    source.outputs.set("sserial0.0.Output", 0xFF)
    for _ in range(9):
        source.look()
        source.outputs.alive()
    assert field_io(card).get("output") == 0xFF
    for _ in range(12):
        now = source.look()
    assert field_io(card).get("output") == 0
    assert now.off == "the view has not said that it is alive"


def test_closing_turns_outputs_off(source: Source, card: EmulatedBoard) -> None:
    source.outputs.arm()
    source.look()
    source.outputs.set("sserial0.0.Output", 0xFF)
    source.look()
    source.close()
    source.close()
    assert field_io(card).get("output") == 0


def test_recordings_begin_and_end_while_it_runs(source: Source, tmp_path: Path, card: EmulatedBoard) -> None:
    source.look()
    for n in range(2):
        source.recordings.start(tmp_path / f"{n}.mcap")
        field_io(card).set("input", n + 1)
        for _ in range(5):
            source.look()
        assert source.look().recording is not None
        done = source.recordings.stop()
        assert done is not None
        assert (done.records, done.dropped) == (120, 0)
        run = recording.read(tmp_path / f"{n}.mcap")
        assert run["sserial0.0.Input"][-1] == n + 1
        assert len(run.records) == 120
        assert not run.gaps
    assert source.look().recording is None


def test_a_bite_is_shown_and_its_channels_are_cut_off(source: Source, card: EmulatedBoard) -> None:
    source.look()
    card.advance(2_000_000.0)  # microseconds without a cycle
    now = source.look()
    assert now.watchdog == "BITTEN"
    assert now.off == ""  # outputs had never been on
    assert text.channel_state(now.channels[0]) == "cut off"
    assert any(event.explain == "HM2-E041" for event in now.events)
    assert "start the monitor anew" in now.hints[0]


def test_a_card_without_smart_serial_has_its_pads() -> None:
    with hostmot2.open(EmulatedBoard("7i80hd", clock="virtual")) as board:
        made = Source(board, start={})
        made.start()
        now = made.look()
        assert now.bits
        assert now.channels == now.values == ()
        made.close()


# -- text


VOLTS = ValueRow("0.1 AnalogOut0", 5.0, "V", -10.0, 10.0, True)
BITS = BitsRow("0.0 Output", 0b1001, 16, True)


def test_a_bar_goes_from_zero_to_the_value() -> None:
    assert text.bar(VOLTS) == "▕      ███   ▏"
    assert text.bar(ValueRow("", -10.0, "V", -10.0, 10.0, True)) == "▕██████      ▏"
    assert text.bar(ValueRow("", 36.3, "V", 0.0, 36.3, False)) == "▕████████████▏"
    assert text.bar(ValueRow("", 3.0, "", 0.0, 0.0, False)) == ""


def test_bits_are_written_bit_0_first() -> None:
    assert text.bits_text(BITS) == "●··●···· ········"


@pytest.mark.parametrize(
    ("row", "typed", "value"),
    [
        (VOLTS, "-2.5", -2.5),
        (BITS, "1 on", 0b1011),
        (BITS, "3 off", 0b0001),
        (BITS, "2=1", 0b1101),
        (BITS, "0xFFFF", 0xFFFF),
        (BitsRow("", 0, 1, True), "on", 1),
        (BitsRow("", 1, 1, True), "0", 0),
    ],
)
def test_what_is_typed_becomes_a_value(row: Any, typed: str, value: float) -> None:
    assert text.parse_value(row, typed) == value


@pytest.mark.parametrize(
    ("row", "typed"),
    [(VOLTS, "10.5"), (VOLTS, "nan"), (VOLTS, "five"), (VOLTS, ""), (BITS, "16 on"), (BITS, "0x10000")],
)
def test_what_cannot_be_is_refused_and_not_limited(row: Any, typed: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        text.parse_value(row, typed)


def test_every_fault_of_a_channel_is_said(source: Source) -> None:
    found = ChannelRow(0, 2, "8I20", 0, "0", ChannelStatus(0x0442_2141), started=True)
    assert text.channel_trouble(found) == (
        "over temperature; since start: remote fault, communication error, CRC error, remote fault"
    )
    assert "8I20: running" in text.channel_detail(found)


def test_lines_of_a_snapshot_that_has_nothing_yet() -> None:
    now = Snapshot(card="5I25", url="pci://", access="starting", rate=200.0)
    assert text.status_line(now, True) == "5I25 pci://  200 Hz  watchdog none  PAUSED"
    assert text.latency_text(now) == "p99 of reply and cycle: -"


def test_a_mistake_in_looking_is_kept_for_the_view(source: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    def stumble() -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr(source, "look", stumble)
    source._run()
    assert isinstance(source.failure, RuntimeError)


@pytest.mark.parametrize("error", [NoFirmware("none"), EngineError("given up"), TransportTimeout("lost")])
def test_counters_that_cannot_be_read_are_not_shown_as_old_ones(
    source: Source, monkeypatch: pytest.MonkeyPatch, error: HostMot2Error
) -> None:
    """But for a lost exchange, which says nothing about them."""

    def refuse(_self: object, _number: int) -> None:
        raise error

    for _ in range(len(source.board.sserial[0].channels)):
        source._read_counters()
    before = dict(source._counters)
    assert before
    monkeypatch.setattr(type(source.board.sserial[0]), "channel_counters", refuse)
    for _ in range(len(source.board.sserial[0].channels)):
        source._read_counters()
    assert source._counters == (before if isinstance(error, TransportTimeout) else {})


def test_while_exchanges_fail_a_card_that_still_answers_is_no_problem(source: Source) -> None:
    assert source._problem(0) is None
    assert source._problem(9) is None


def test_a_card_without_a_watchdog_says_so() -> None:
    description = described("7i80hd")
    modules = tuple(module for module in description.modules if module.gtag != Gtag.WATCHDOG)
    with hostmot2.open(EmulatedBoard(replace(description, modules=modules), clock="virtual")) as board:
        made = Source(board)
        made.start()
        assert made.look().watchdog == "none"
        made.close()
