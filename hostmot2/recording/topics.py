"""What viewers get: topics with their schemas, and records as JSON messages. The same in a file and live."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from hostmot2.record_ring import STAGES
from hostmot2.recording import format as form
from hostmot2.recording.format import Signal

LEVELS = {"debug": 1, "info": 2, "warning": 3, "error": 4, "fatal": 5}


class Topic(NamedTuple):
    """A topic of JSON messages; schema is JSON Schema, units are signals' by their names in the messages."""

    name: str
    schema_name: str
    schema: bytes
    units: dict[str, str]


class Message(NamedTuple):
    """A JSON message. time_ns: since 1970. number: of the cycle, where it is of one."""

    topic: str
    time_ns: int
    data: bytes
    number: int = 0


def topics(inputs: Sequence[Signal], outputs: Sequence[Signal]) -> list[Topic]:
    """All topics of JSON messages for these signals."""
    counters = form.object_schema(
        "hm2.recorder", records="records taken so far", dropped="records lost, the ring was full"
    )
    rows: list[tuple[str, str, bytes, Sequence[Signal]]] = [
        (form.IMAGE, "hm2.image", form.image_schema(), ()),
        (form.RECORDER, "hm2.recorder", counters, ()),
        (form.CYCLE, "hm2.cycle", form.cycle_schema(), ()),
        (form.LOG, "foxglove.Log", form.log_schema(), ()),
        (form.INPUTS, "hm2.inputs", form.signals_schema("hm2.inputs", inputs), inputs),
        (form.OUTPUTS, "hm2.outputs", form.signals_schema("hm2.outputs", outputs), outputs),
    ]
    return [
        Topic(name, title, schema, dict(zip(form.json_names(of), (each.unit for each in of), strict=True)))
        for name, title, schema, of in rows
    ]


class Messages:
    """Makes the messages. `unix_ns` is added to a time of the board's clock to get ns since 1970."""

    def __init__(self, inputs: Sequence[Signal], outputs: Sequence[Signal], unix_ns: int) -> None:
        self._names = {form.INPUTS: form.json_names(inputs), form.OUTPUTS: form.json_names(outputs)}
        self._unix_ns = unix_ns
        self._encode = msgspec.json.Encoder().encode
        self.last_ns = time.time_ns()  # a viewer's time line begins with the first message
        """The time of the last record, for messages without one of their own."""

    def time(self, board_ns: int) -> int:
        """A time of the board's clock in ns since 1970."""
        return max(board_ns + self._unix_ns, 0)

    def passed(self, records: npt.NDArray[Any]) -> None:
        """These records were taken, in order."""
        self.last_ns = self.time(int(records["start_ns"][-1]))

    def plots(self, records: npt.NDArray[Any]) -> Iterator[Message]:
        """A message per record and topic."""
        times, cycles = records["start_ns"].tolist(), records["cycle"].tolist()
        for topic, column in ((form.INPUTS, "inputs"), (form.OUTPUTS, "outputs")):
            if self._names[topic]:
                yield from self._plot(topic, times, cycles, self._names[topic], records[column].tolist())
        ends: npt.NDArray[np.uint32] = records["stage_ns"]
        stages = ends[:, : len(STAGES)].astype(np.float64) / 1000
        rows = np.hstack((np.diff(stages, prepend=0.0), stages[:, -1:])).tolist()
        extra = zip(records["status"].tolist(), records["flags"].tolist(), strict=True)
        names = [*form.CYCLE_NAMES, "status", "flags"]
        columns = [[*r, *e] for r, e in zip(rows, extra, strict=True)]
        yield from self._plot(form.CYCLE, times, cycles, names, columns)

    def _plot(
        self, topic: str, times: list[int], cycles: list[int], names: list[str], rows: list[list[float]]
    ) -> Iterator[Message]:
        keys = ("cycle", *names)
        for start_ns, cycle, row in zip(times, cycles, rows, strict=True):
            data = self._encode(dict(zip(keys, (cycle, *row), strict=True)))
            yield Message(topic, self.time(start_ns), data, cycle & 0xFFFFFFFF)

    def image(self, registers: Sequence[int]) -> Message:
        """Which registers the image's words are, from now on."""
        return Message(form.IMAGE, self.last_ns, self._encode(form.ImageText(list(registers))))

    def counters(self, records: int, dropped: int) -> Message:
        """How many records were taken and how many found no room."""
        return Message(form.RECORDER, self.last_ns, self._encode(form.CountersText(records, dropped)))

    def log(self, board_ns: int, level: str, name: str, message: str) -> Message:
        """A line for the log panel; level as in LEVELS."""
        time_ns = self.time(board_ns)
        stamp = {"sec": time_ns // 1_000_000_000, "nsec": time_ns % 1_000_000_000}
        entry = {"timestamp": stamp, "level": LEVELS[level], "message": message, "name": name}
        return Message(form.LOG, time_ns, self._encode(entry | {"file": "", "line": 0}))


class Thinning:
    """Leaves the first record of each period of 1 / rate; rate None: all, 0: none."""

    def __init__(self, rate: float | None) -> None:
        if rate is not None and not 0 <= rate < math.inf:
            raise ValueError(f"{rate} messages per second")
        self._rate = rate
        self._slot = -1

    def __call__(self, records: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Of these records, which follow those of the last call."""
        if self._rate is None:
            return records
        if self._rate == 0:
            return records[:0]
        slots = (records["start_ns"] // (1e9 / self._rate)).astype(np.int64)
        chosen: npt.NDArray[Any] = records[np.diff(slots, prepend=self._slot) != 0]
        self._slot = int(slots[-1])
        return chosen
