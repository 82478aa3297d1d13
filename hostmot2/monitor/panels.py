"""The panels of the view: tables that are filled from snapshots."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar, NamedTuple

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import DataTable, Static

from hostmot2.monitor import text
from hostmot2.monitor.snapshot import BitsRow, Snapshot, ValueRow

NOTHING = "-"


class Line(NamedTuple):
    """A row of a panel: a key that stays, its cells, and what `hm2 explain` takes for it, if anything.

    A panel's keys are all different, or lines would lie beside the table's rows. A bidirectional element is
    two lines.
    """

    key: str
    cells: tuple[Text, ...]
    explain: str = ""
    output: ValueRow | BitsRow | None = None
    detail: str = ""


class Table(DataTable[Text]):
    """A table whose cells change in place, so that cursor and scrolling stay."""

    def __init__(self, columns: Sequence[str]) -> None:
        super().__init__(cursor_type="row", zebra_stripes=False, cell_padding=1)
        self._columns = columns
        self._shown: dict[str, tuple[Text, ...]] = {}

    def on_mount(self) -> None:
        """The columns."""
        for name in self._columns:
            self.add_column(name, key=name)

    def fill(self, lines: Sequence[Line]) -> None:
        """Show these lines."""
        fresh = {line.key: line.cells for line in lines}
        if list(fresh) != list(self._shown):
            self._replace(fresh)
        else:
            for key, cells in fresh.items():
                self._update(key, cells, self._shown[key])
        self._shown = fresh

    def _replace(self, fresh: dict[str, tuple[Text, ...]]) -> None:
        at = self.cursor_row
        chosen = list(self._shown)[at] if 0 <= at < len(self._shown) else ""
        self.clear()
        for key, cells in fresh.items():
            self.add_row(*cells, key=key)
        if chosen in fresh:
            self.move_cursor(row=list(fresh).index(chosen), animate=False)

    def _update(self, key: str, cells: tuple[Text, ...], old: tuple[Text, ...]) -> None:
        for name, cell, before in zip(self._columns, cells, old, strict=True):
            if cell != before or cell.style != before.style:
                wider = len(cell.plain) > len(before.plain)
                self.update_cell(key, name, cell, update_width=wider)


class Panel(Vertical):
    """A titled table. Subclasses say what its lines are."""

    title: ClassVar[str] = ""
    columns: ClassVar[tuple[str, ...]] = ()
    has_detail: ClassVar[bool] = False

    def __init__(self, number: int) -> None:
        super().__init__(classes="panel", id=f"panel{number}")
        self.border_title = f"{number} {self.title}"
        self.table = Table(self.columns)
        self._detail = Static("", classes="detail", markup=False)
        self._lines: list[Line] = []

    def compose(self) -> ComposeResult:
        """The table, and the detail of the selected line where there is one."""
        yield self.table
        if self.has_detail:
            yield self._detail

    def lines(self, now: Snapshot) -> Iterator[Line]:
        """What there is to show."""
        raise NotImplementedError

    def show(self, now: Snapshot, wanted: str) -> None:
        """Show a snapshot; wanted: only lines with these letters in them."""
        self._lines = [
            line
            for line in self.lines(now)
            if not wanted or any(wanted in cell.plain.lower() for cell in line.cells)
        ]
        self.table.fill(self._lines)
        if self.has_detail:
            self._detail.update(self.selected.detail if self.selected else "")

    def line(self, key: str | None) -> Line | None:
        """The line of this key, None if it is not shown any more."""
        return next((line for line in self._lines if line.key == key), None)

    @property
    def selected(self) -> Line | None:
        """The line under the cursor."""
        at = self.table.cursor_row
        return self._lines[at] if 0 <= at < len(self._lines) else None


def _cells(*texts: str, style: str = "") -> tuple[Text, ...]:
    return tuple(Text(each, style) for each in texts)


class Channels(Panel):
    """Smart-serial channels: what is on them and what is wrong."""

    title = "Channels"
    columns = ("ch", "remote", "mode", "state", "CS", "faults and errors")
    has_detail = True

    def lines(self, now: Snapshot) -> Iterator[Line]:
        """A line per channel."""
        for row in now.channels:
            state, trouble = text.channel_state(row), text.channel_trouble(row)
            cells = [
                Text(each) for each in (row.label, row.name or NOTHING, row.mode.split(" ")[0] or NOTHING)
            ]
            color = "bold red" if state == "FAULT" else "green" if row.started else "dim"
            cells += [Text(state, color), Text(f"{row.status.word:08X}")]
            cells.append(
                Text(trouble, "red" if row.faults else "yellow" if trouble not in ("", "ok") else "")
            )
            explain = f"CS=0x{row.status.word:08X}"
            yield Line(row.label, tuple(cells), explain, detail=text.channel_detail(row))


class Encoders(Panel):
    """Encoders."""

    title = "Encoders"
    columns = ("encoder", f"{'count':>11}", f"{'position':>13}", f"{'velocity':>12}")

    def lines(self, now: Snapshot) -> Iterator[Line]:
        """A line per encoder."""
        for row in now.encoders:
            moving = "bold" if row.velocity else ""
            numbers = (f"{row.count:>11d}", f"{row.position:>13.3f}", f"{row.velocity:>12.1f}")
            yield Line(row.name, _cells(row.name, *numbers, style=moving))


class Values(Panel):
    """Analog inputs and outputs, voltages."""

    title = "Analog"
    columns = ("name", f"{'value':>9}", "unit", "between limits", "range")

    def lines(self, now: Snapshot) -> Iterator[Line]:
        """A line per number."""
        for row in now.values:
            name = f"{row.name} {'→' if row.is_output else '←'}"
            cells = _cells(name, f"{row.value:>9.3f}", row.unit, text.bar(row), text.limits(row))
            yield Line(name, cells, output=row if row.is_output else None)


class Bits(Panel):
    """Field I/O, enables, and the FPGA's pads."""

    title = "Bits"
    columns = ("name", "bit 0 first")

    def lines(self, now: Snapshot) -> Iterator[Line]:
        """A line per word."""
        for row in now.bits:
            arrow = "→" if row.is_output else "←"
            name = f"{row.name} {arrow}" if row.signal else row.name
            cells = (Text(name), Text(text.bits_text(row), "bold" if row.value else ""))
            yield Line(name, cells, output=row if row.is_output else None)


class Events(Panel):
    """What has happened, the latest first."""

    title = "Events"
    columns = ("time", "what")

    def lines(self, now: Snapshot) -> Iterator[Line]:
        """A line per event."""
        count = len(now.events)
        for n, row in enumerate(now.events):
            yield Line(f"{count - n} {row.at} {row.text}", _cells(row.at, row.text), row.explain)


PANELS: tuple[type[Panel], ...] = (Channels, Encoders, Values, Bits, Events)
"""By their keys, from 1 on."""
