"""The MCAP file as the recorder writes it. The container itself is the mcap package's."""

from __future__ import annotations

import fcntl
import os
import stat
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
from mcap.writer import CompressionType, Writer

from hostmot2.recording import format as form
from hostmot2.recording.errors import RecordingFailed
from hostmot2.recording.format import Signal
from hostmot2.recording.topics import Message, Messages, topics

CHUNK_BYTES = 1 << 20


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # a source tree
        return "0"


def _opened(path: str | os.PathLike[str]) -> BinaryIO:
    """The file, emptied and this recording's alone: two would spoil it for each other.

    Raises OSError, and RecordingFailed while another recording is being written to it.
    """
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        _lock(descriptor, os.fspath(path))
        if stat.S_ISREG(os.fstat(descriptor).st_mode):
            os.ftruncate(descriptor, 0)
        return os.fdopen(descriptor, "wb")
    except BaseException:
        os.close(descriptor)
        raise


def _lock(descriptor: int, path: str) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise RecordingFailed(f"{path}: another recording is being written to this file") from None
    except OSError:
        pass  # a file system without locks


@dataclass(frozen=True, slots=True)
class Attachment:
    """A file inside the file."""

    name: str
    data: bytes
    media_type: str = "application/json"


class RecordingFile:
    """Topics, schemas and messages of a recording; a `Sink` of the pump. One thread uses it.

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
        self._messages = Messages(inputs, outputs, unix_ns)
        self._batch = 0
        self._stream = _opened(path)
        _open.add(self)
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
        for topic in topics(inputs, outputs):
            number = self._writer.register_schema(topic.schema_name, "jsonschema", topic.schema)
            channels[topic.name] = self._writer.register_channel(topic.name, "json", number, topic.units)
        return channels

    def attach(self, attachments: Sequence[Attachment], metadata: Mapping[str, Mapping[str, str]]) -> None:
        """Attachments and metadata records, at once in the file."""
        now_ns = self._messages.last_ns
        for each in attachments:
            self._writer.add_attachment(now_ns, now_ns, each.name, each.media_type, each.data)
        for name, entries in metadata.items():
            self._writer.add_metadata(name, dict(entries))

    def records(self, records: npt.NDArray[Any]) -> None:
        """Whole records, in order, as one message."""
        log_ns = self._messages.time(int(records["start_ns"][0]))
        self._messages.passed(records)
        self._batch += 1
        self._writer.add_message(
            self._channels[form.RECORDS], log_ns, records.tobytes(), log_ns, self._batch & 0xFFFFFFFF
        )

    def plots(self, records: npt.NDArray[Any]) -> None:
        """The same as JSON that viewers plot, a message per record and topic."""
        for message in self._messages.plots(records):
            self._add(message)

    def image(self, registers: Sequence[int]) -> None:
        """Which registers the image's words are, from now on."""
        self._add(self._messages.image(registers))

    def counters(self, records: int, dropped: int) -> None:
        """How many records the file holds and how many found no room."""
        self._add(self._messages.counters(records, dropped))

    def log(self, board_ns: int, level: str, name: str, message: str) -> None:
        """A line for the log panel. level: debug, info, warning, error, fatal."""
        self._add(self._messages.log(board_ns, level, name, message))

    def _add(self, message: Message) -> None:
        self._writer.add_message(
            self._channels[message.topic], message.time_ns, message.data, message.time_ns, message.number
        )

    def flush(self) -> None:
        """Everything so far to the operating system: it survives the end of this process."""
        self._writer.flush()

    def finish(self) -> None:
        """Index and end of the file."""
        self._writer.finish()

    def close(self) -> None:
        """Let the file go, complete or not."""
        self._stream.close()

    def disown(self) -> None:
        """In a forked child: the file is the parent's. What is buffered here goes nowhere."""
        if self._stream.closed:
            return
        nowhere = os.open(os.devnull, os.O_WRONLY | os.O_CLOEXEC)
        os.dup2(nowhere, self._stream.fileno(), inheritable=False)
        os.close(nowhere)


_open: weakref.WeakSet[RecordingFile] = weakref.WeakSet()


def _after_fork() -> None:
    for file in list(_open):
        file.disown()


os.register_at_fork(after_in_child=_after_fork)
