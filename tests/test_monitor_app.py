"""The terminal view, driven through textual's Pilot: what is on the screen and what the keys do."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from monitor_source import started_source
from textual.widgets import Input

import hostmot2
from hostmot2 import recording
from hostmot2.cli.monitor import explanation
from hostmot2.emulator import EmulatedBoard
from hostmot2.monitor import Source
from hostmot2.monitor.app import SIGNALS, MonitorApp

Script = Callable[[MonitorApp, Any], Awaitable[None]]
SIZES = [(80, 24), (160, 50)]


@pytest.fixture
def card() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual")


@pytest.fixture
def started(card: EmulatedBoard) -> Iterator[Source]:
    with started_source(card, modes={(0, 0): 2}) as source:
        yield source


@pytest.fixture
def looking(card: EmulatedBoard) -> Iterator[Source]:
    with hostmot2.open(card, read_only=True) as board:
        source = Source(board)
        source.start()
        yield source
        source.close()


def drive(source: Source, script: Script, size: tuple[int, int] = (80, 24)) -> MonitorApp:
    """Run the app on a screen of that size and do what the script says; give signals back."""
    app = MonitorApp(source, explanation)
    handlers = {number: signal.getsignal(number) for number in SIGNALS}

    async def run() -> None:
        async with app.run_test(size=size, notifications=True) as pilot:
            await pilot.pause()
            await script(app, pilot)

    try:
        asyncio.run(run())
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return app


def screen(app: MonitorApp) -> str:
    """The characters on the screen."""
    strips = app.screen._compositor.render_strips()
    return "\n".join("".join(segment.text for segment in strip) for strip in strips)


async def ticked(app: MonitorApp, pilot: Any) -> None:
    """One more picture, now."""
    app._tick()
    await pilot.pause()


async def typed(pilot: Any, text: str) -> None:
    await pilot.press(*("space" if each == " " else each for each in text), "enter")


def field_io(card: EmulatedBoard) -> Any:
    return card.sserial[0].remote(0)


# -- what is shown


@pytest.mark.parametrize("size", SIZES, ids=["80x24", "160x50"])
def test_everything_fits(started: Source, card: EmulatedBoard, size: tuple[int, int]) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        field_io(card).fault = 0x04
        await ticked(app, pilot)
        shown = screen(app)
        assert "OUTPUTS OFF  5I25" in shown
        assert "watchdog armed" in shown
        assert "p99: reply" in shown
        assert "lost 0 of" in shown
        assert "q Quit" in shown
        seen = {}
        for number, words in {
            1: ("0.0  7I77", "FAULT", "over temperature", "counted: CRC 0"),
            2: ("encoder5",),
            3: ("0.0 FieldVoltage", "0.1 AnalogOut5", "-10 to 10 V"),
            4: ("0.0 Input", "········ ········ ········ ········", "P2 driven"),
            5: ("over temperature",),
        }.items():
            await pilot.press(str(number))
            await ticked(app, pilot)
            seen[number] = all(word in screen(app) for word in words)
        assert seen == dict.fromkeys(range(1, 6), True)

    drive(started, script, size)


def test_all_panels_at_once_only_where_they_fit(started: Source) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        assert "encoder5" not in screen(app)
        await pilot.resize_terminal(160, 50)
        await pilot.pause(0.2)
        await ticked(app, pilot)
        assert all(word in screen(app) for word in ("0.0  7I77", "encoder5", "0.1 AnalogOut5", "P2 driven"))
        await pilot.resize_terminal(160, 20)
        await pilot.pause(0.2)
        await ticked(app, pilot)
        assert "encoder5" not in screen(app)

    drive(started, script)


def test_only_looking_says_so_and_what_would_show_more(looking: Source) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        assert "READ-ONLY" in screen(app)
        assert "--start all" in screen(app)

    drive(looking, script)


# -- keys


def test_e_explains_the_selected_word_as_hm2_explain_does(started: Source, card: EmulatedBoard) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        field_io(card).fault = 0x04
        await ticked(app, pilot)
        await pilot.press("e")
        assert "over temperature" in screen(app)
        assert "CS=0x0442" in screen(app)
        await pilot.press("escape")
        await pilot.press("2", "e")  # nothing to explain
        assert len(app.screen_stack) == 1

    drive(started, script)


def test_space_holds_the_picture_and_nothing_else(started: Source, card: EmulatedBoard) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        await pilot.press("space")
        held = app.now.cycles
        await ticked(app, pilot)
        assert app.now.cycles == held < app.source.latest.cycles
        assert "PAUSED" in screen(app)
        await pilot.press("space")
        await ticked(app, pilot)
        assert app.now.cycles > held

    drive(started, script)


def test_the_filter_leaves_lines_with_these_letters(started: Source) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        await pilot.press("3", "slash", *"Out3", "enter")
        await ticked(app, pilot)
        assert "AnalogOut3" in screen(app)
        assert "AnalogOut2" not in screen(app)
        assert "filter: out3" in screen(app)
        await pilot.press("slash", "escape")
        await ticked(app, pilot)
        assert "AnalogOut2" in screen(app)
        assert not app.query_one("#filter", Input).has_focus

    drive(started, script)


def test_r_records_until_r(started: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    async def script(app: MonitorApp, pilot: Any) -> None:
        await pilot.press("r")
        for _ in range(5):
            await ticked(app, pilot)
        assert "REC 00:0" in screen(app)
        await pilot.press("r")
        await app.workers.wait_for_complete()
        await ticked(app, pilot)
        assert "REC" not in screen(app).splitlines()[0]

    drive(started, script)
    (path,) = tmp_path.glob("hm2-monitor-*.mcap")
    run = recording.read(path)
    assert len(run.records) >= 100
    assert not run.missing


def test_a_recording_that_cannot_be_begun_is_said(
    started: Source, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("hostmot2.monitor.app.file_name", lambda: tmp_path / "none" / "run.mcap")

    async def script(app: MonitorApp, pilot: Any) -> None:
        await pilot.press("r")
        await pilot.pause()
        assert "No such file" in screen(app)
        assert app.source.recordings.view is None

    drive(started, script)


def test_help_fits_and_says_what_may_be_done(started: Source) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        await pilot.press("question_mark")
        assert "begin or end a recording" in screen(app)
        await pilot.press("escape")
        assert len(app.screen_stack) == 1

    drive(started, script)


# -- outputs


def test_nothing_is_armed_when_only_looking(looking: Source) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        await pilot.press("w")
        await pilot.pause()
        assert len(app.screen_stack) == 1
        assert "--allow-write" in screen(app)

    drive(looking, script)


def test_outputs_are_armed_by_the_word_set_by_enter_and_off_at_the_end(
    started: Source, card: EmulatedBoard
) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        await pilot.press("w")
        await typed(pilot, "yes")
        assert not started.outputs.armed
        assert "Only `arm` arms" in screen(app)
        app.screen.query_one(Input).value = ""
        await typed(pilot, "arm")
        await ticked(app, pilot)
        assert "ARMED" in screen(app)
        await pilot.press("4", "down", "enter")
        await typed(pilot, "99 on")
        assert "bits 0 to 15" in screen(app)
        app.screen.query_one(Input).value = ""
        await typed(pilot, "3 on")
        await ticked(app, pilot)
        assert field_io(card).get("output") == 1 << 3
        await pilot.press("q")

    app = drive(started, script)
    assert app.return_value == 0
    started.look()
    assert field_io(card).get("output") == 0


def test_w_turns_armed_outputs_off_at_once(started: Source, card: EmulatedBoard) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        started.outputs.arm()
        await ticked(app, pilot)
        started.outputs.set("sserial0.0.Output", 0xFFFF)
        await ticked(app, pilot)
        assert field_io(card).get("output") == 0xFFFF
        await pilot.press("w")
        await ticked(app, pilot)
        assert field_io(card).get("output") == 0

    drive(started, script)


def test_a_fault_turns_outputs_off_and_is_said(started: Source, card: EmulatedBoard) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        started.outputs.arm()
        await ticked(app, pilot)
        field_io(card).fault = 0x04
        await ticked(app, pilot)
        assert "Outputs went off: a remote reports a fault. w arms them anew." in screen(app)

    drive(started, script)


def test_a_fault_of_the_view_itself_turns_outputs_off(started: Source, card: EmulatedBoard) -> None:
    async def script(app: MonitorApp, pilot: Any) -> None:
        started.outputs.arm()
        await ticked(app, pilot)
        started.outputs.set("sserial0.0.Output", 0xFFFF)
        await ticked(app, pilot)
        started.failure = RuntimeError("a bug")
        await asyncio.sleep(0.3)

    with pytest.raises(RuntimeError, match="a bug"):
        drive(started, script)
    started.close()
    assert field_io(card).get("output") == 0


# -- a card that vanishes


def test_a_card_that_vanishes_is_a_typed_error_on_the_screen_and_no_traceback() -> None:
    command = [sys.executable, "-m", "hostmot2", "emulate", "7i92+7i77", "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout
        url = server.stdout.readline().split()[1]

        async def script(app: MonitorApp, pilot: Any) -> None:
            server.kill()
            server.wait()
            end = time.monotonic() + 20
            while "HM2-E" not in screen(app) and time.monotonic() < end:
                await pilot.pause(0.1)
            assert "HM2-E" in screen(app)
            assert app.now.lost > 0
            await pilot.press("e")
            await pilot.pause()
            assert "hm2 explain" not in screen(app)
            assert len(app.screen_stack) == 2

        with hostmot2.open(url, read_only=True) as board:
            source = Source(board, rate=50)
            source.start()
            app = drive(source, script)
            source.close()
        assert app._exception is None


# -- hm2 monitor


def hm2(*arguments: str, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "hostmot2", "--board", "emu://5i25+7i77", *arguments]
    environment = os.environ | (env or {})
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=60)


@pytest.mark.parametrize("options", [[], ["--start", "0x03"], ["--allow-write"], ["--json"]])
def test_without_a_terminal_it_says_so(options: list[str]) -> None:
    done = hm2("monitor", *options)
    assert done.returncode == 2
    assert "needs a terminal" in done.stdout + done.stderr


@pytest.mark.parametrize(
    "options", [["--start", "nine"], ["--start", "all", "--start", "1"], ["--mode", "0=2"], ["--mode", "x"]]
)
def test_options_that_cannot_be_are_refused(options: list[str]) -> None:
    done = hm2("monitor", *options)
    assert done.returncode == 2
    assert "needs a terminal" not in done.stderr
