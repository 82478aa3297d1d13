"""Keys, dialogs and ways out of the terminal view that are taken less often."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from monitor_source import started_source
from test_monitor_app import drive, field_io, screen, ticked, typed
from textual.widgets import Input

import hostmot2
from hostmot2.emulator import EmulatedBoard, catalog
from hostmot2.emulator.cards import CARD_NAMES
from hostmot2.errors import EngineError, LinkFailed
from hostmot2.monitor import Source, app, text
from hostmot2.monitor.app import MonitorApp
from hostmot2.monitor.help import help_text
from hostmot2.monitor.panels import PANELS
from hostmot2.monitor.recordings import file_name
from hostmot2.monitor.snapshot import BitsRow, Problem, ValueRow
from hostmot2.recording import RecordingFailed, read


@pytest.fixture
def card() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual")


@pytest.fixture
def started(card: EmulatedBoard) -> Iterator[Source]:
    with started_source(card) as source:
        yield source


def test_tab_goes_round_the_panels_but_not_behind_a_dialog(started: Source) -> None:
    async def script(view: MonitorApp, pilot: Any) -> None:
        assert view.chosen == 1
        view.action_next(1)
        assert view.chosen == 2
        view.action_next(-1)
        view.action_next(-1)
        assert view.chosen == 5
        view.action_help()
        await pilot.pause()
        view.action_next(1)
        assert view.chosen == 5

    drive(started, script)


def test_a_click_into_another_panel_chooses_it(started: Source) -> None:
    async def script(view: MonitorApp, pilot: Any) -> None:
        await ticked(view, pilot)
        view._panels[1].table.focus()
        view._panels[1].table.move_cursor(row=2)
        await pilot.pause()
        assert view.chosen == 2

    drive(started, script, size=(160, 50))


def test_enter_explains_a_line_that_is_no_output_and_asks_to_arm_on_one(started: Source) -> None:
    async def script(view: MonitorApp, pilot: Any) -> None:
        await ticked(view, pilot)
        await pilot.press("1", "enter")
        await pilot.pause()
        assert "CS=" in screen(view)
        await pilot.press("escape", "2", "enter")
        await pilot.pause()
        assert len(view.screen_stack) == 1, "an encoder has nothing to explain"
        await pilot.press("4", "down", "enter")
        await pilot.pause()
        assert "arm" in screen(view)
        assert not started.outputs.armed
        await pilot.press("escape")
        await pilot.pause()
        assert not started.outputs.armed

    drive(started, script)


def test_an_analog_output_is_asked_for_in_its_unit_and_left_by_escape(
    started: Source, card: EmulatedBoard
) -> None:
    async def script(view: MonitorApp, pilot: Any) -> None:
        started.outputs.arm()
        await ticked(view, pilot)
        await pilot.press("3")
        await ticked(view, pilot)
        row = next(n for n, line in enumerate(view.panel._lines) if line.output is not None)
        view.panel.table.move_cursor(row=row)
        await pilot.press("enter")
        assert "-10 to 10 V; now 0" in screen(view)
        await typed(pilot, "11")
        assert "outside" in screen(view)
        await pilot.press("escape")
        await ticked(view, pilot)
        assert card.sserial[0].remote(1).get("analogout0") == 0.0
        await pilot.press("enter")
        await typed(pilot, "2.5")
        await ticked(view, pilot)
        assert card.sserial[0].remote(1).get("analogout0") == pytest.approx(2.5, abs=0.01)

    drive(started, script)


def test_a_click_asks_for_the_line_that_was_clicked(started: Source) -> None:
    """Not for the one chosen in another panel."""

    async def script(view: MonitorApp, pilot: Any) -> None:
        started.outputs.arm()
        await ticked(view, pilot)
        await pilot.press("3")
        await ticked(view, pilot)
        row = next(n for n, line in enumerate(view.panel._lines) if line.output is not None)
        view.panel.table.move_cursor(row=row)
        await pilot.pause()
        for _ in range(2):
            await pilot.click(view._panels[3].table, offset=(4, 1))  # "0.0 Input", which is no output
            await pilot.pause()
            assert len(view.screen_stack) == 1
        assert view.chosen == 4

    drive(started, script, size=(160, 50))


def test_a_bidirectional_element_is_two_lines_and_enter_asks_for_the_one_chosen(card: EmulatedBoard) -> None:
    card.sserial[0].attach(2, catalog.remote("stmbl"), through_pins=True)

    async def script(view: MonitorApp, pilot: Any) -> None:
        source.outputs.arm()
        await ticked(view, pilot)
        await pilot.press("4")
        await ticked(view, pilot)
        table, lines = view.panel.table, view.panel._lines
        shown = [table.get_row_at(n)[0].plain for n in range(table.row_count)]
        assert shown == [line.cells[0].plain for line in lines]
        assert {"0.2 index_enable \N{LEFTWARDS ARROW}", "0.2 index_enable \N{RIGHTWARDS ARROW}"} <= set(shown)
        for row, line in enumerate(lines):
            table.move_cursor(row=row)
            await pilot.press("enter")
            await pilot.pause()
            asked = len(view.screen_stack) > 1
            assert asked == (line.output is not None)
            if asked:
                assert f"Set {line.output.name}" in screen(view)
                await pilot.press("escape")

    with started_source(card) as source:
        drive(source, script, size=(160, 50))


@pytest.mark.parametrize("name", CARD_NAMES)
def test_no_two_lines_of_a_panel_have_one_key(name: str) -> None:
    with started_source(EmulatedBoard(name, clock="virtual")) as source:
        now = source.look()
        for panel in PANELS:
            keys = [line.key for line in panel(1).lines(now)]
            assert len(keys) == len(set(keys))


def test_an_output_typed_after_they_went_off_is_an_error_and_not_set(
    started: Source, card: EmulatedBoard
) -> None:
    async def script(view: MonitorApp, pilot: Any) -> None:
        started.outputs.arm()
        await ticked(view, pilot)
        await pilot.press("4", "down", "enter")
        started.outputs.disarm()
        started.look()
        await typed(pilot, "3 on")
        await ticked(view, pilot)
        assert field_io(card).get("output") == 0
        assert "arm them first" in screen(view)

    drive(started, script, size=(160, 50))


def test_outputs_that_cannot_be_armed_say_why(started: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> None:
        raise EngineError("the watchdog has bitten")

    async def script(view: MonitorApp, pilot: Any) -> None:
        monkeypatch.setattr(started.outputs, "arm", refuse)
        await pilot.press("w")
        await typed(pilot, "arm")
        await ticked(view, pilot)
        assert "the watchdog has bitten" in screen(view)
        assert not started.outputs.armed

    drive(started, script, size=(160, 50))


def test_a_recording_that_fails_at_its_end_says_so(started: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    def full() -> None:
        raise RecordingFailed("no space left on the disk")

    async def script(view: MonitorApp, pilot: Any) -> None:
        with monkeypatch.context() as patched:
            patched.setattr(started.recordings, "stop", full)
            view.run_worker(view._end_recording, thread=True)
            await view.workers.wait_for_complete()
            await pilot.pause()
        assert "no space left on the disk" in screen(view)

    drive(started, script, size=(160, 50))


def test_a_recording_that_another_one_is_in_the_way_of_is_said(
    started: Source, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The view ended, and with it outputs."""

    def taken(_path: Path) -> None:
        raise RecordingFailed("another recording is being written to this file")

    async def script(view: MonitorApp, pilot: Any) -> None:
        monkeypatch.setattr(started.recordings, "start", taken)
        await pilot.press("r")
        await pilot.pause()
        assert "another recording" in screen(view)

    drive(started, script, size=(160, 50))


def test_recordings_of_one_second_are_files_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("time.strftime", lambda _form: "hm2-monitor-20261128-080000")
    names = []
    for make in (Path.touch, lambda path: path.symlink_to("nowhere"), Path.touch):
        names.append(file_name())
        make(names[-1])
    stem = "hm2-monitor-20261128-080000"
    assert [str(name) for name in names] == [f"{stem}.mcap", f"{stem}-2.mcap", f"{stem}-3.mcap"]


def test_events_are_in_the_recording_that_runs(started: Source, card: EmulatedBoard, tmp_path: Path) -> None:
    started.recordings.start(tmp_path / "run.mcap")
    started.outputs.arm()
    started.look()
    field_io(card).fault = 0x04
    for _ in range(3):
        started.look()
    started.recordings.stop()
    assert any("fault" in entry.message for entry in read(tmp_path / "run.mcap").log)


def test_without_the_package_recordings_say_what_to_install(
    card: EmulatedBoard, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hostmot2.monitor.recordings.Recordings._package", lambda self: _missing(self))
    with hostmot2.open(card) as board:
        source = Source(board, start={})
        source.start()
        with pytest.raises(ImportError, match=r"hostmot2\[record\]"):
            source.recordings.start(tmp_path / "run.mcap")
        source.close()
    assert not (tmp_path / "run.mcap").exists()


def _missing(recordings: Any) -> None:
    recordings.missing = "recordings need mcap: pip install 'hostmot2[record]'"


def test_ctrl_z_does_not_stop_the_cycle(started: Source) -> None:
    async def script(view: MonitorApp, pilot: Any) -> None:
        view.action_suspend_process()
        await ticked(view, pilot)
        assert "does not go to the background" in " ".join(screen(view).split())

    drive(started, script, size=(160, 50))


# -- ways out


def test_a_signal_turns_outputs_off_and_ends_with_its_status(started: Source, card: EmulatedBoard) -> None:
    async def script(view: MonitorApp, pilot: Any) -> None:
        started.outputs.arm()
        await ticked(view, pilot)
        started.outputs.set("sserial0.0.Output", 0xFFFF)
        await ticked(view, pilot)
        assert field_io(card).get("output") == 0xFFFF
        view.ended.set()  # it does end: nobody has to end the process
        os.kill(os.getpid(), signal.SIGTERM)
        while view._exit is False:
            await pilot.pause(0.01)

    view = drive(started, script)
    assert view.return_value == 128 + signal.SIGTERM
    started.look()
    assert not started.outputs.armed
    assert field_io(card).get("output") == 0


def test_a_view_that_hangs_after_a_signal_is_ended_with_its_outputs_off(
    started: Source, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[object] = []
    monkeypatch.setattr(app, "HUNG_SECONDS", 0.0)
    monkeypatch.setattr(app.os, "_exit", ended.append)
    monkeypatch.setattr(started, "close", lambda: ended.append("closed"))

    async def script(view: MonitorApp, pilot: Any) -> None:
        started.outputs.arm()
        await ticked(view, pilot)
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(None, view._leave, loop, 143)

    drive(started, script)
    assert ended == ["closed", 143]
    started.look()
    assert not started.outputs.armed


def test_a_view_that_hangs_is_ended_though_its_card_cannot_be_reached(
    started: Source, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[object] = []
    monkeypatch.setattr(app, "HUNG_SECONDS", 0.0)
    monkeypatch.setattr(app.os, "_exit", ended.append)

    def unreachable() -> None:
        raise LinkFailed("udp link: link given up")

    async def script(view: MonitorApp, pilot: Any) -> None:
        loop = asyncio.get_running_loop()
        with suppress(LinkFailed), monkeypatch.context() as patched:
            patched.setattr(started, "close", unreachable)
            await loop.run_in_executor(None, view._leave, loop, 143)

    drive(started, script)
    assert ended == [143]


@pytest.mark.parametrize(
    ("status", "code", "ends"), [(0, None, 0), (143, None, 143), (None, 1, 1), (None, None, 0)]
)
def test_signals_are_handled_as_before_when_the_view_is_over(
    started: Source, monkeypatch: pytest.MonkeyPatch, status: Any, code: Any, ends: int
) -> None:
    before = {number: signal.getsignal(number) for number in app.SIGNALS}

    class View:
        def __init__(self, *_arguments: object) -> None:
            self.return_code = code
            self.ended = app.threading.Event()

        def run(self) -> Any:
            for number in app.SIGNALS:
                signal.signal(number, signal.SIG_IGN)
            started.outputs.arm()
            return status

    monkeypatch.setattr(app, "MonitorApp", View)
    assert app.run(started, str) == ends
    started.look()
    assert not started.outputs.armed
    assert {number: signal.getsignal(number) for number in app.SIGNALS} == before


# -- texts


@pytest.mark.parametrize("typed_bits", ["x", "0x", "3 maybe", "1 2 3", "-1"])
def test_bits_that_are_none_are_refused_with_what_is_wanted(typed_bits: str) -> None:
    with pytest.raises(ValueError, match="`3 on`, `3 off`, or all bits as 0x0 to 0xFFFF"):
        text.parse_value(BitsRow("0.0 Output", 0, 16, is_output=True), typed_bits)


@pytest.mark.parametrize("typed_value", ["inf", "-inf", "nan", "1e999"])
def test_what_is_no_finite_number_is_refused_without_limits_too(typed_value: str) -> None:
    with pytest.raises(ValueError, match="a number is needed: any number"):
        text.parse_value(ValueRow("0.1 speed", 0.0, "", 0.0, 0.0, is_output=True), typed_value)


def test_help_says_what_looking_means() -> None:
    assert "needs --start" in help_text(driving=False, allowed=False)
    assert help_text(driving=False, allowed=False) != help_text(driving=True, allowed=False)


def test_a_filter_is_left_by_escape(started: Source) -> None:
    async def script(view: MonitorApp, pilot: Any) -> None:
        await pilot.press("slash", "x", "escape")
        await pilot.pause()
        assert view.query_one(Input).value == ""

    drive(started, script)


def test_e_explains_what_is_wrong_with_the_card_where_a_line_has_nothing_to_say(started: Source) -> None:
    async def script(view: MonitorApp, pilot: Any) -> None:
        await pilot.press("2")
        await ticked(view, pilot)
        view.now = replace(view.now, problem=Problem("no answer", "HM2-E041"))
        view.action_explain()
        await pilot.pause()
        assert "HM2-E041" in screen(view)

    drive(started, script)
