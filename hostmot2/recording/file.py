"""The MCAP file as the recorder writes it. The container itself is the mcap package's."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt
from mcap.writer import CompressionType, Writer

from hostmot2.record_ring import STAGES
from hostmot2.recording import format as form
from hostmot2.recording.format import Signal

CHUNK_BYTES = 1 << 20
LEVELS = {"debug": 1, "info": 2, "warning": 3, "error": 4, "fatal": 5}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # a source tree
        return "0"


@dataclass(frozen=True, slots=True)
class Attachment:
    """A file inside the file."""

    name: str
    data: bytes
    media_type: str = "application/json"


class RecordingFile:
    """Topics, schemas and messages of a recording. One thread uses it.

    `unix_ns` is added to a time of the board's clock to get the file's: ns since 1970.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        dtype: np.dtype[Any],
        inputs: Sequence[Signal],
        outputs: Sequence[Signal],
        unix_ns: int,
    ) -> None:
        self._names = {form.INPUTS: form.json_names(inputs), form.OUTPUTS: form.json_names(outputs)}
        self._unix_ns = unix_ns
        self._batch = 0
        self._last_ns = max(unix_ns, 0)
        self._json = msgspec.json.Encoder()
        self._stream = Path(path).open("wb")  # noqa: SIM115
        self._writer: Any = Writer(self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(library=f"hostmot2/{_version('hostmot2')} mcap/{_version('mcap')}")
        self._channels = self._register(dtype, inputs, outputs)

    def _register(
        self, dtype: np.dtype[Any], inputs: Sequence[Signal], outputs: Sequence[Signal]
    ) -> dict[str, int]:
        binary = self._writer.register_schema(
            form.RECORDS_SCHEMA, form.RECORDS_ENCODING, form.records_schema(dtype, inputs, outputs)
        )
        channels = {form.RECORDS: self._writer.register_channel(form.RECORDS, form.RECORDS_ENCODING, binary)}
        counters = form.object_schema(
            "hm2.recorder", records="records in the file", dropped="records lost, the ring was full"
        )
        schemas: list[tuple[str, str, bytes, Sequence[Signal]]] = [
            (form.IMAGE, "hm2.image", form.image_schema(), ()),
            (form.RECORDER, "hm2.recorder", counters, ()),
            (form.CYCLE, "hm2.cycle", form.cycle_schema(), ()),
            (form.LOG, "foxglove.Log", form.log_schema(), ()),
            (form.INPUTS, "hm2.inputs", form.signals_schema("hm2.inputs", inputs), inputs),
            (form.OUTPUTS, "hm2.outputs", form.signals_schema("hm2.outputs", outputs), outputs),
        ]
        for topic, name, schema, signals in schemas:
            number = self._writer.register_schema(name, "jsonschema", schema)
            units = dict(zip(form.json_names(signals), (each.unit for each in signals), strict=True))
            channels[topic] = self._writer.register_channel(topic, "json", number, units)
        return channels

    def attach(self, attachments: Sequence[Attachment], metadata: Mapping[str, Mapping[str, str]]) -> None:
        """Attachments and metadata records, at once in the file."""
        for each in attachments:
            self._writer.add_attachment(self._last_ns, self._last_ns, each.name, each.media_type, each.data)
        for name, entries in metadata.items():
            self._writer.add_metadata(name, dict(entries))

    def records(self, records: npt.NDArray[Any]) -> None:
        """Whole records, in order, as one message."""
        log_ns = self._time(int(records["start_ns"][0]))
        self._last_ns = self._time(int(records["start_ns"][-1]))
        self._batch += 1
        self._writer.add_message(
            self._channels[form.RECORDS], log_ns, records.tobytes(), log_ns, self._batch & 0xFFFFFFFF
        )

    def plots(self, records: npt.NDArray[Any]) -> None:
        """The same as JSON that viewers plot, a message per record and topic."""
        times, cycles = records["start_ns"].tolist(), records["cycle"].tolist()
        for topic, column in ((form.INPUTS, "inputs"), (form.OUTPUTS, "outputs")):
            if self._names[topic]:
                self._plot(topic, times, cycles, self._names[topic], records[column].tolist())
        ends: npt.NDArray[np.uint32] = records["stage_ns"]
        stages = ends[:, : len(STAGES)].astype(np.float64) / 1000
        rows = np.hstack((np.diff(stages, prepend=0.0), stages[:, -1:])).tolist()
        extra = zip(records["status"].tolist(), records["flags"].tolist(), strict=True)
        names = [*form.CYCLE_NAMES, "status", "flags"]
        self._plot(form.CYCLE, times, cycles, names, [[*r, *e] for r, e in zip(rows, extra, strict=True)])

    def _plot(
        self, topic: str, times: list[int], cycles: list[int], names: list[str], rows: list[list[float]]
    ) -> None:
        channel, keys = self._channels[topic], ("cycle", *names)
        for start_ns, cycle, row in zip(times, cycles, rows, strict=True):
            data = self._json.encode(dict(zip(keys, (cycle, *row), strict=True)))
            log_ns = self._time(start_ns)
            self._writer.add_message(channel, log_ns, data, log_ns, cycle & 0xFFFFFFFF)

    def image(self, registers: Sequence[int]) -> None:
        """Which registers the image's words are, from now on."""
        self._message(form.IMAGE, form.ImageText(list(registers)))

    def counters(self, records: int, dropped: int) -> None:
        """How many records the file holds and how many found no room."""
        self._message(form.RECORDER, form.CountersText(records, dropped))

    def log(self, board_ns: int, level: str, name: str, message: str) -> None:
        """A line for the log panel. level: debug, info, warning, error, fatal."""
        log_ns = self._time(board_ns)
        stamp = {"sec": log_ns // 1_000_000_000, "nsec": log_ns % 1_000_000_000}
        entry = {"timestamp": stamp, "level": LEVELS[level], "message": message, "name": name}
        data = self._json.encode(entry | {"file": "", "line": 0})
        self._writer.add_message(self._channels[form.LOG], log_ns, data, log_ns)

    def _message(self, topic: str, content: Any) -> None:
        self._writer.add_message(
            self._channels[topic], self._last_ns, self._json.encode(content), self._last_ns
        )

    def _time(self, board_ns: int) -> int:
        return max(board_ns + self._unix_ns, 0)

    def flush(self) -> None:
        """Everything so far to the operating system: it survives the end of this process."""
        self._writer.flush()

    def finish(self) -> None:
        """Index and end of the file."""
        self._writer.finish()

    def close(self) -> None:
        """Let the file go, complete or not."""
        self._stream.close()
