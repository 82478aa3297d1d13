"""The terminal view of a card. It draws snapshots and never touches the card."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar

from textual import on
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container, Horizontal
from textual.events import Resize
from textual.widgets import DataTable, Footer, Input, Sparkline, Static

from hostmot2.errors import HostMot2Error
from hostmot2.monitor import text
from hostmot2.monitor.dialogs import QuestionDialog, TextDialog, arm_dialog
from hostmot2.monitor.help import help_text
from hostmot2.monitor.panels import PANELS, Line, Panel
from hostmot2.monitor.recordings import file_name
from hostmot2.monitor.snapshot import BitsRow, Snapshot
from hostmot2.monitor.source import Source
from hostmot2.monitor.style import CSS

REFRESH_SECONDS = 0.1
WIDE = (120, 32)
"""Columns and rows from which all panels are shown at once."""
GRID = (1, 3, 2, 4, 5)
"""The order in which the panels fill the two columns."""
LINES = ("access", "status", "reply", "lost", "banner", "tabs")
SIGNALS = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
HUNG_SECONDS = 3.0
"""A terminal that takes nothing any more (Ctrl-S, a dead connection) holds up a signal's end no longer."""


class MonitorApp(App[int]):
    """Shows what `source` tells. explain: what is known of a CS word ("CS=0x04422140") or an error's code.

    Closing the source is the caller's; the app turns outputs off when it ends, by whatever way it sees.
    """

    CSS = CSS
    ENABLE_COMMAND_PALETTE = False
    TITLE = "hm2 monitor"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("q", "quit", "Quit"),
        Binding("ctrl+c,ctrl+q", "quit", "Quit", show=False, priority=True),
        Binding("question_mark,f1", "help", "Help", key_display="?"),
        Binding("space", "pause", "Pause"),
        Binding("r", "record", "Record"),
        Binding("e", "explain", "Explain"),
        Binding("slash", "filter", "Filter", key_display="/"),
        Binding("w", "arm", "Arm"),
        Binding("tab", "next(1)", "Panel", show=False, priority=True),
        Binding("shift+tab", "next(-1)", "Panel", show=False, priority=True),
        *(Binding(str(n), f"choose({n})", show=False) for n in range(1, len(PANELS) + 1)),
    ]

    def __init__(self, source: Source, explain: Callable[[str], str]) -> None:
        super().__init__()
        self.source = source
        self.explain = explain
        self.paused = False
        self.wanted = ""
        """What lines must have in them to be shown."""
        self.now: Snapshot = source.latest
        self.chosen = 1
        self._was_armed = False
        self.ended = threading.Event()
        self._panels: list[Panel] = [cls(n) for n, cls in enumerate(PANELS, 1)]
        self._lines = {name: Static("", id=name, markup=False) for name in LINES}
        self._history: Sparkline = Sparkline([], id="history", summary_function=max)
        self._filter = Input(placeholder="only lines with ...", id="filter")

    # -- what is on the screen

    def compose(self) -> ComposeResult:
        """Two lines, a banner, the panels, keys."""
        with Horizontal(id="top"):
            yield self._lines["access"]
            yield self._lines["status"]
        with Horizontal(id="latency"):
            yield self._lines["reply"]
            yield self._history
            yield self._lines["lost"]
        yield self._lines["banner"]
        yield self._lines["tabs"]
        with Container(id="panels"):
            yield from (self._panels[n - 1] for n in GRID)
        yield self._filter
        yield Footer(compact=True)

    def on_mount(self) -> None:
        """Signals, the first picture, and ten more each second."""
        self._take_signals()
        self.action_choose(1)
        self._tick()
        self.set_interval(REFRESH_SECONDS, self._tick)

    def on_resize(self, event: Resize) -> None:
        """All panels where they fit, else one of them."""
        wide = event.size.width >= WIDE[0] and event.size.height >= WIDE[1]
        self.screen.set_class(wide, "wide")

    def _tick(self) -> None:
        if self.source.failure is not None:
            raise self.source.failure
        if self.source.board.virtual_time:
            self.source.look()
        self.source.outputs.alive()
        self._watch_outputs()
        if not self.paused:
            self.now = self.source.latest
        self._show()

    def _watch_outputs(self) -> None:
        armed = self.source.outputs.armed
        if self._was_armed and not armed and self.source.latest.off:
            self.notify(f"Outputs went off: {self.source.latest.off}", severity="error", timeout=10)
        self._was_armed = armed

    def _show(self) -> None:
        now = self.now
        access = self._lines["access"]
        access.update(f" {now.access.upper()} ")
        access.set_class(now.access == "ARMED", "armed")
        self._lines["status"].update(text.status_line(now, self.paused))
        self._lines["reply"].update(text.latency_text(now))
        self._history.data = list(now.latency.history)
        lost = self._lines["lost"]
        lost.update(text.lost_text(now))
        lost.set_class(bool(now.lost), "bad")
        self._show_banner(now)
        self._show_tabs(now)
        for panel in self._panels:
            panel.show(now, self.wanted)

    def _show_banner(self, now: Snapshot) -> None:
        banner, bad = self._lines["banner"], ""
        if now.problem is not None:
            bad = now.problem.text
        elif now.off:
            bad = f"Outputs went off: {now.off}." + (
                " w arms them anew." if self.source.outputs.allowed else ""
            )
        lines = [*([bad] if bad else []), *now.hints]
        banner.update("\n".join(lines))
        banner.set_class(bool(bad), "bad")
        banner.display = bool(lines)

    def _show_tabs(self, now: Snapshot) -> None:
        names = (
            f"[{n} {panel.title}]" if n == self.chosen else f" {n} {panel.title} "
            for n, panel in enumerate(self._panels, 1)
        )
        filtered = f"  filter: {self.wanted}" if self.wanted else ""
        self._lines["tabs"].update("".join(names) + filtered)

    # -- keys

    @property
    def panel(self) -> Panel:
        """The chosen panel."""
        return self._panels[self.chosen - 1]

    def action_choose(self, number: int) -> None:
        """Panel `number`, from 1."""
        self.chosen = number
        for n, panel in enumerate(self._panels, 1):
            panel.set_class(n == number, "chosen")
        self.panel.table.focus()

    def action_next(self, step: int) -> None:
        """The panel after this one, or before it."""
        if len(self.screen_stack) == 1:
            self.action_choose((self.chosen - 1 + step) % len(self._panels) + 1)

    @on(DataTable.RowHighlighted)
    def _clicked(self, event: DataTable.RowHighlighted) -> None:
        owner = event.data_table.parent
        if event.data_table.has_focus and isinstance(owner, Panel) and owner is not self.panel:
            self.action_choose(self._panels.index(owner) + 1)

    def action_pause(self) -> None:
        """Hold the picture; cycle, recording and outputs go on."""
        self.paused = not self.paused

    def action_help(self) -> None:
        """What there is to see and to press."""
        self.push_screen(TextDialog("Help", help_text(self.source.driving, self.source.outputs.allowed)))

    def action_explain(self) -> None:
        """The selected line's CS word or error, in plain words."""
        line = self.panel.selected
        what = line.explain if line is not None and line.explain else ""
        if not what and self.now.problem is not None:
            what = self.now.problem.explain
        if not what:
            self.notify("Nothing to explain here: choose a channel or an event.")
            return
        self.push_screen(TextDialog(what, self.explain(what)))

    def action_filter(self) -> None:
        """Show only lines with some letters in them."""
        line = self._filter
        line.display = True
        line.focus()

    @on(Input.Changed, "#filter")
    def _filter_changed(self, event: Input.Changed) -> None:
        self.wanted = event.value.strip().lower()

    @on(Input.Submitted, "#filter")
    def _filter_taken(self) -> None:
        self._filter.display = False
        self.panel.table.focus()

    def on_key(self, event: object) -> None:
        """Escape leaves the filter."""
        if getattr(event, "key", "") == "escape" and self._filter.has_focus:
            self._filter.value = ""
            self._filter_taken()

    def action_record(self) -> None:
        """Begin a recording of every cycle, or end it."""
        if self.source.recordings.view is None:
            path = file_name()
            try:
                self.source.recordings.start(path)
            except (OSError, ImportError, HostMot2Error) as problem:
                self.notify(str(problem), severity="error", timeout=10)
            else:
                self.notify(f"Recording into {path}")
        else:
            self.run_worker(self._end_recording, thread=True, exclusive=True)

    def _end_recording(self) -> None:
        """In a thread: the disk may be slow."""
        try:
            done = self.source.recordings.stop()
        except (HostMot2Error, OSError) as problem:
            self.call_from_thread(self.notify, str(problem), severity="error", timeout=10)
            return
        if done is not None:
            dropped = f", {done.dropped} dropped" if done.dropped else ""
            self.call_from_thread(self.notify, f"{done.path}: {done.records} cycles{dropped}", timeout=10)

    # -- outputs

    def action_arm(self) -> None:
        """Ask whether outputs shall be driven; turn them off at once if they are."""
        outputs = self.source.outputs
        if outputs.armed:
            outputs.disarm()
            self.notify("Outputs are off.")
        elif not outputs.allowed:
            self.notify(
                "Nothing is written: start the monitor with --allow-write for that.", severity="warning"
            )
        else:
            self.push_screen(arm_dialog(), self._armed)

    def _armed(self, typed: str | None) -> None:
        if typed is None:
            return
        try:
            self.source.outputs.arm()
            self._was_armed = True
        except HostMot2Error as problem:
            self.notify(str(problem), severity="error", timeout=10)

    @on(DataTable.RowSelected)
    def _chosen_line(self, event: DataTable.RowSelected) -> None:
        """Enter, or a click, on an output sets it, elsewhere it explains.

        The line is the event's: a click may be into a panel that is not the chosen one.
        """
        owner = event.data_table.parent
        if not isinstance(owner, Panel):
            return
        if owner is not self.panel:
            self.action_choose(self._panels.index(owner) + 1)
        line = owner.line(event.row_key.value)
        if line is None or line.output is None:
            if line is not None and line.explain:
                self.action_explain()
        elif self.source.outputs.armed:
            self._ask_for(line)
        else:
            self.action_arm()

    def _ask_for(self, line: Line) -> None:
        row = line.output
        assert row is not None
        if isinstance(row, BitsRow):
            commanded = int(self.source.outputs.commanded(row.signal))
            row = replace(row, value=commanded)
            question = f"now {text.bits_text(row)} (bit 0 first). `3 on`, `3 off`, or all bits as 0x0F."
            question = "on or off" if row.width == 1 else question
        else:
            question = f"{text.limits(row)}; now {row.value:g}"
        self._question(row.name, row.signal, question, lambda typed: text.parse_value(row, typed))

    def _question(self, name: str, output: str, question: str, parse: Callable[[str], float]) -> None:
        def refuse(typed: str) -> str:
            try:
                parse(typed)
            except ValueError as problem:
                return str(problem)
            return ""

        def take(typed: str | None) -> None:
            if typed is None:
                return
            try:
                self.source.outputs.set(output, parse(typed))
            except HostMot2Error as problem:  # they went off meanwhile
                self.notify(str(problem), severity="error", timeout=10)

        self.push_screen(QuestionDialog(f"Set {name}", question, refuse), take)

    # -- ways out

    def _take_signals(self) -> None:
        """With Python's handlers, not the loop's: the loop stands still while the terminal takes nothing."""
        loop = asyncio.get_running_loop()

        def handle(number: int, frame: object) -> None:
            threading.Thread(target=self._leave, args=(loop, 128 + number), daemon=True).start()

        for number in SIGNALS:
            signal.signal(number, handle)

    def _leave(self, loop: asyncio.AbstractEventLoop, code: int) -> None:
        self.source.outputs.disarm()
        if not loop.is_closed():
            loop.call_soon_threadsafe(self.exit, code)
        if not self.ended.wait(HUNG_SECONDS):
            try:
                self.source.close()
            finally:  # a card that cannot be reached any more is its watchdog's
                os._exit(code)

    def _end(self, code: int) -> None:
        self.source.outputs.disarm()
        self.exit(code)

    async def action_quit(self) -> None:
        """Outputs off, then the end."""
        self._end(0)

    def action_suspend_process(self) -> None:
        """Not while the card is driven: the engine would stop with the process, and its watchdog bite."""
        self.notify("The monitor does not go to the background: its cycle would stop.")


def run(source: Source, explain: Callable[[str], str]) -> int:
    """Show a started source until the user leaves; the exit status. Signal handlers are then as before."""
    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    app = MonitorApp(source, explain)
    try:
        status = app.run()
    finally:
        app.ended.set()
        source.outputs.disarm()
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return app.return_code or 0 if status is None else status
