"""What a recording file holds, read up to where it ends, however it ends.

The container is parsed by the mcap package. Around it: no length in the file is believed beyond the file's
own size, chunks are unpacked only up to a limit, and the first thing that cannot be ends the reading with a
note.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, cast

import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Attachment, Channel, Chunk, DataEnd, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from hostmot2.errors import CardNotFound, PermissionDenied
from hostmot2.recording import format as form
from hostmot2.recording.errors import BrokenRecording, RecordingTooLarge

LARGEST_CHUNK = 1 << 26  # unpacked; the recorder's have 1 MiB
LIMIT = 8 << 30

_DAMAGE = (
    McapError,
    zstandard.ZstdError,
    struct.error,
    ValueError,  # also a CRC or a text that is wrong
    OverflowError,
    MemoryError,
    KeyError,
    IndexError,
    TypeError,
)


@dataclass
class Contents:
    """What was found. `missing`: what is not there although it should be; empty for a whole file."""

    path: str
    schema: form.RecordsSchema | None = None
    batches: list[bytes] = field(default_factory=list)
    images: list[tuple[int, bytes]] = field(default_factory=list)  # before which batch, message
    counters: bytes | None = None
    log: list[tuple[int, bytes]] = field(default_factory=list)
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)


class _Bounded:
    """The file, which never gives less than was asked for: beyond its end nothing is promised or reserved."""

    def __init__(self, stream: IO[bytes], size: int) -> None:
        self._stream = stream
        self.left = size
        self.size = size

    def read(self, length: int) -> bytes:
        if length > self.left:
            raise EndOfFile()
        self.left -= length
        return self._stream.read(length)


def scan(path: str | Path, limit: int = LIMIT) -> Contents:
    """Read a recording. limit: bytes that may be taken from it, unpacked.

    Raises CardNotFound, PermissionDenied, BrokenRecording, RecordingTooLarge.
    """
    try:
        with Path(path).open("rb") as stream:
            return _Scan(str(path), stream, Path(path).stat().st_size, limit).run()
    except FileNotFoundError as error:
        raise CardNotFound(f"{path}: there is no such file") from error
    except PermissionError as error:
        raise PermissionDenied(f"{path}: this user may not read it") from error


class _Scan:
    def __init__(self, path: str, stream: IO[bytes], size: int, limit: int) -> None:
        self._found = Contents(path)
        self._bounded = _Bounded(stream, size)
        self._left = limit
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, str] = {}
        self._whole = False

    def run(self) -> Contents:
        reader = StreamReader(
            cast("IO[bytes]", self._bounded), emit_chunks=True, record_size_limit=self._bounded.size
        )
        whole_until = 0
        try:
            for record in reader.records:
                self._take(record)
                whole_until = self._bounded.size - self._bounded.left
        except RecordingTooLarge:
            raise
        except _DAMAGE as problem:
            if whole_until == 0:
                raise BrokenRecording(f"{self._found.path}: not an MCAP file") from problem
            if not self._whole:
                self._note_end(whole_until, problem)
        if self._found.schema is None:
            raise BrokenRecording(
                f"{self._found.path}: no records are described in it", received=self._bounded.size
            )
        return self._found

    def _note_end(self, whole_until: int, problem: BaseException) -> None:
        lost = self._bounded.size - whole_until
        reason = "cut off" if isinstance(problem, EndOfFile) else f"damaged ({problem})"
        self._found.missing.append(
            f"the file is {reason} after byte {whole_until}: the last {lost} bytes could not be read, and "
            "what was recorded after the last flush (1 s at most) is not in it"
        )

    def _take(self, record: Any) -> None:
        if isinstance(record, Chunk):
            self._take_chunk(record)
        elif isinstance(record, DataEnd):
            self._whole = True  # behind it only indexes
        elif isinstance(record, Attachment):
            self._spend(len(record.data))
            self._found.attachments[record.name] = record.data
        elif isinstance(record, Metadata):
            self._found.metadata[record.name] = dict(record.metadata)
        else:
            self._take_inner(record)

    def _take_chunk(self, chunk: Chunk) -> None:
        """A chunk that is whole by its length, but wrong inside, is left out and named."""
        try:
            inner = list(self._unpacked(chunk))
        except RecordingTooLarge:
            raise
        except _DAMAGE as problem:
            self._found.missing.append(f"a chunk of {len(chunk.data)} bytes is damaged: {problem}")
            return
        for record in inner:
            self._take_inner(record)

    def _unpacked(self, chunk: Chunk) -> Iterator[Any]:
        data = chunk.data
        if chunk.uncompressed_size > LARGEST_CHUNK:
            raise ValueError(f"{chunk.uncompressed_size} bytes unpacked")
        if chunk.compression == "zstd":
            # decompress() believes the frame's own idea of its size, so that must be the chunk's
            if zstandard.frame_content_size(data) not in (chunk.uncompressed_size, -1):
                raise ValueError("two sizes")
            data = zstandard.ZstdDecompressor().decompress(data, max_output_size=chunk.uncompressed_size)
        elif chunk.compression:
            raise ValueError(f"compressed with {chunk.compression!r}")
        if len(data) != chunk.uncompressed_size:
            raise ValueError(f"{len(data)} bytes instead of {chunk.uncompressed_size}")
        self._spend(len(data))
        plain = Chunk(
            compression="",
            data=data,
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            uncompressed_crc=chunk.uncompressed_crc,
            uncompressed_size=len(data),
        )
        return iter(breakup_chunk(plain, validate_crc=True))

    def _spend(self, size: int) -> None:
        self._left -= size
        if self._left < 0:
            raise RecordingTooLarge(f"{self._found.path} holds more than the limit")

    def _take_inner(self, record: Any) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._topics[record.id] = record.topic
            if record.topic == form.RECORDS and self._found.schema is None:
                self._found.schema = form.parse_records_schema(self._schemas[record.schema_id].data)
        elif isinstance(record, Message):
            self._take_message(self._topics.get(record.channel_id, ""), record)

    def _take_message(self, topic: str, message: Message) -> None:
        found = self._found
        if topic == form.RECORDS and found.schema is not None:
            if len(message.data) % found.schema.dtype.itemsize:
                found.missing.append(f"a batch of {len(message.data)} bytes is not whole records")
            else:
                found.batches.append(message.data)
        elif topic == form.IMAGE:
            found.images.append((len(found.batches), message.data))
        elif topic == form.RECORDER:
            found.counters = message.data
        elif topic == form.LOG:
            found.log.append((message.log_time, message.data))


__all__ = ["LARGEST_CHUNK", "LIMIT", "Contents", "scan"]
