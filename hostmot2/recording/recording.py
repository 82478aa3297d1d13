"""A recording as numpy columns."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from hostmot2.bulk import Columns
from hostmot2.fields import Direction
from hostmot2.record_ring import STAGES
from hostmot2.recording import format as form
from hostmot2.recording.descriptors import Descriptors
from hostmot2.recording.errors import BrokenRecording
from hostmot2.recording.format import Signal
from hostmot2.recording.scan import LIMIT, Contents, scan

Column = npt.NDArray[Any]
_NUMBER = re.compile(r"-?[0-9]{1,19}")


@dataclass(frozen=True, slots=True)
class Gap:
    """Cycles that are not in the file: `count` of them, from number `first` on."""

    first: int
    count: int


@dataclass(frozen=True, slots=True)
class LogEntry:
    """A line of the log. time_ns: since 1970. level: 1 debug to 5 fatal."""

    time_ns: int
    level: int
    name: str
    message: str


class Recording(Mapping[str, Column]):
    """What `read` found: a mapping from names to columns, one entry per recorded cycle.

    Names are those of the input and output signals (an output that is called like an input is
    `outputs.NAME`), then process data decoded from raw registers with the attached descriptors
    (`sserial0.1.input`, outputs `sserial0.2.analogout0`), then `cycle`, `status`, `flags` and
    `wake_us` .. `write_us`, `total_us`. They are found in any capitals. Columns are read-only.

    path: the file. inputs, outputs: the signals. attachments, metadata: as in the file. missing: what could
    not be read, in sentences; empty for a whole file. dropped: records that found no room in the ring, as
    the recorder counted them until the last flush.
    """

    def __init__(self, contents: Contents) -> None:
        schema = contents.schema
        assert schema is not None, "scan() gives no contents without a schema"
        self.path = contents.path
        self.inputs: tuple[Signal, ...] = schema.inputs
        self.outputs: tuple[Signal, ...] = schema.outputs
        self.attachments: Mapping[str, bytes] = MappingProxyType(contents.attachments)
        self.metadata: Mapping[str, Mapping[str, str]] = MappingProxyType(contents.metadata)
        self.missing: tuple[str, ...] = tuple(contents.missing)
        data = b"".join(contents.batches)
        contents.batches.clear()
        self.records: npt.NDArray[Any] = np.frombuffer(data, schema.dtype)
        """The records themselves, every field under its own name."""
        self.image = _last_image(contents, schema.dtype["words"].shape[0])
        """What register each word of `records["words"]` is: byte address, bit 0 set if it was written."""
        self.log: tuple[LogEntry, ...] = tuple(_log(contents))
        self.dropped = _dropped(contents)

    # -- columns

    def __getitem__(self, name: str) -> Column:
        if name in self._places:
            field, index = self._places[name]
            return self.records[field][:, index]
        if name in self.elements:
            return self.elements[name]
        if name in ("cycle", "status", "flags"):
            return self.records[name]
        if name in self.stages:
            return self.stages[name]
        return self[self.spelled(name)]

    def spelled(self, name: str) -> str:
        """A column's name as the file has it. KeyError: there is none of that name, in whatever capitals."""
        if name in self._names:
            return name
        known = next((each for each in self._names if each.casefold() == name.casefold()), None)
        if known is None:
            raise KeyError(f"{self.path} has no column {name!r}")
        return known

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    @cached_property
    def _places(self) -> dict[str, tuple[str, int]]:
        places = {signal.name: ("inputs", i) for i, signal in enumerate(self.inputs)}
        for i, signal in enumerate(self.outputs):
            name = f"outputs.{signal.name}" if signal.name in places else signal.name
            places[name] = ("outputs", i)
        return places

    @cached_property
    def _names(self) -> dict[str, None]:
        last = ("cycle", "status", "flags", *self.stages)
        return dict.fromkeys((*self._places, *self.elements, *last))

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Name -> unit of every column that has one."""
        units = {name: getattr(self, field)[i].unit for name, (field, i) in self._places.items()}
        if self.descriptors is not None:
            for direction in (Direction.OUTPUT, Direction.INPUT):
                units = {**self.descriptors.units(direction), **units}
        units |= dict.fromkeys(self.stages, "us")
        return {name: unit for name, unit in units.items() if unit and name in self._names}

    @cached_property
    def stages(self) -> Columns:
        """`wake_us` (how late the cycle began), how long each further stage took, and `total_us`."""
        ends = self.records["stage_ns"][:, : len(STAGES)].astype(np.float64) / 1000
        took = np.diff(ends, prepend=0.0)
        columns = {name: took[:, i] for i, name in enumerate(form.CYCLE_NAMES[:-1])}
        return _read_only({**columns, form.CYCLE_NAMES[-1]: ends[:, -1]})

    # -- time

    @property
    def cycle(self) -> Column:
        """Numbers of the cycles."""
        return self.records["cycle"]

    @cached_property
    def unix_ns(self) -> int:
        """What is added to a time of the board's clock for ns since 1970."""
        text = self.metadata.get(form.RUN, {}).get("unix_ns_at_clock_0", "0")
        found = int(text) if _NUMBER.fullmatch(text) else 0
        return found if abs(found) < 1 << 63 else 0

    @cached_property
    def time_ns(self) -> npt.NDArray[np.int64]:
        """When each cycle was due, ns since 1970; never jumps, whatever the computer's clock did."""
        return self.records["start_ns"] + np.int64(self.unix_ns)

    @cached_property
    def seconds(self) -> npt.NDArray[np.float64]:
        """The same from the first record on, s."""
        start = self.records["start_ns"]
        return (start - start[:1]) / 1e9 if len(start) else np.zeros(0)

    # -- what is not there

    @cached_property
    def gaps(self) -> tuple[Gap, ...]:
        """Where cycle numbers jump."""
        steps = np.diff(self.cycle.astype(np.int64))
        at = np.flatnonzero(steps > 1)
        return tuple(Gap(int(self.cycle[i]) + 1, int(steps[i]) - 1) for i in at)

    # -- raw registers

    def register(self, address: int, *, written: bool = False) -> npt.NDArray[np.uint32]:
        """The recorded words of a register, read or written. KeyError: it was not recorded."""
        word = self._slot(address | int(written))
        if word is None:
            kind = "written" if written else "read"
            raise KeyError(f"{self.path}: register 0x{address:04X} was not recorded as {kind}")
        return self.records["words"][:, word]

    def fresh(self, address: int, *, written: bool = False) -> npt.NDArray[np.bool_]:
        """In which cycles the register was moved; in the others its word is that of an earlier one."""
        word = self._slot(address | int(written))
        if word is None:
            return np.zeros(len(self.records), np.bool_)
        return (self.records["fresh"][:, word // 32] >> np.uint32(word % 32) & 1).astype(np.bool_)

    def _slot(self, register: int) -> int | None:
        return self._slots.get(register)

    @cached_property
    def _slots(self) -> dict[int, int]:
        return {register: word for word, register in enumerate(self.image)}

    @cached_property
    def descriptors(self) -> Descriptors | None:
        """The attached descriptors. Raises BrokenRecording."""
        data = self.attachments.get(form.DESCRIPTORS_NAME)
        return None if data is None else Descriptors.parse(data)

    @cached_property
    def input_elements(self) -> frozenset[str]:
        """Which of `elements` come from a remote."""
        return frozenset(self._input_columns)

    @cached_property
    def _input_columns(self) -> Columns:
        if self.descriptors is None or not self.image:
            return {}
        return self.descriptors.columns(_Words(self), Direction.INPUT)

    @cached_property
    def elements(self) -> Columns:
        """Process data decoded from the raw registers, to the last bit what the driver made of them.

        As in the driver, inputs of a failed transfer stay what they were; before the first good one they are
        those of words of 0. An output called like an input of its channel is `outputs.NAME`.
        """
        if self.descriptors is None or not self.image:
            return {}
        found = dict(self._input_columns)
        for name, values in self.descriptors.columns(_Words(self), Direction.OUTPUT).items():
            found[f"outputs.{name}" if name in found else name] = values
        return _read_only(found)

    def __repr__(self) -> str:
        count = len(self.records)
        took = f", {self.seconds[-1]:.3f} s" if count else ""
        lines = [
            f"<Recording {self.path}: {count} cycles{took}, {len(self)} columns, {self.dropped} dropped>"
        ]
        return "\n".join([*lines, *(f"  missing: {text}" for text in self.missing)])


class _Words:
    """`descriptors.Words` of a recording."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.count = len(recording.records)
        self.failed: npt.NDArray[np.bool_] = recording.records["status"] != 0

    def word(self, address: int, written: bool) -> npt.NDArray[np.uint32] | None:
        try:
            return self._recording.register(address, written=written)
        except KeyError:
            return None

    def fresh(self, address: int, written: bool) -> npt.NDArray[np.bool_]:
        return self._recording.fresh(address, written=written)


def read(path: str | Path, *, limit: int = LIMIT) -> Recording:
    """Read a recording, whole or cut off; nothing in it is executed.

    limit: bytes it may hold, unpacked. Raises CardNotFound or PermissionDenied for the file, BrokenRecording
    for one that is no recording or ends before its description, RecordingTooLarge.
    """
    return Recording(scan(path, limit))


def _read_only(columns: Columns) -> Columns:
    for column in columns.values():
        column.setflags(write=False)
    return columns


def _last_image(contents: Contents, words: int) -> tuple[int, ...]:
    """The registers of the image's words. It only ever grows, so the last message holds for all records."""
    if not contents.images:
        return ()
    registers = form.decoded(contents.images[-1][1], form.ImageText, f"{contents.path}: the image").registers
    if len(registers) > words or any(not 0 <= r < 0x10000 or r & 2 for r in registers):
        raise BrokenRecording(f"{contents.path}: an image of {len(registers)} words for {words} cannot be")
    return tuple(registers)


def _dropped(contents: Contents) -> int:
    if contents.counters is None:
        return 0
    return form.decoded(contents.counters, form.CountersText, f"{contents.path}: the counters").dropped


class _LogText(msgspec.Struct):
    level: int
    name: str
    message: str


def _log(contents: Contents) -> Iterator[LogEntry]:
    for time_ns, data in contents.log:
        text = form.decoded(data, _LogText, f"{contents.path}: the log")
        yield LogEntry(time_ns, text.level, text.name, text.message)
