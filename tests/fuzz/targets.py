"""What Python parses, fed with any bytes: each target raises for what must not be, and for nothing else.

A target takes bytes. Its seeds, and what was found once, are in `corpus/NAME/`; tests/test_fuzz_corpus.py
runs them with every test, run.py looks for more under coverage guidance.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

import hostmot2
from hostmot2 import dump
from hostmot2.bitfile import check_part, parse_bitfile
from hostmot2.emulator import catalog
from hostmot2.emulator.remote_state import RemoteState
from hostmot2.errors import BitfileError, BrokenDump, HostMot2Error
from hostmot2.fields import Direction
from hostmot2.lbp import LbpRemote, WireLink
from hostmot2.lbp.errors import LbpError
from hostmot2.recording import format as form
from hostmot2.recording import read as read_recording
from hostmot2.recording.descriptors import Descriptors
from hostmot2.recording.errors import BrokenRecording, RecordingTooLarge
from hostmot2.remotes import backup
from hostmot2.remotes.errors import WrongBackup

CORPUS = Path(__file__).parent / "corpus"
LIMIT = 1 << 22
TARGETS: dict[str, Callable[[bytes], None]] = {}


def target(function: Callable[[bytes], None]) -> Callable[[bytes], None]:
    TARGETS[function.__name__] = function
    return function


@contextmanager
def file_of(data: bytes, name: str = "input") -> Iterator[Path]:
    """The bytes as a file; in memory where the system has such a place."""
    place = "/dev/shm" if os.path.isdir("/dev/shm") else None
    with tempfile.TemporaryDirectory(dir=place, prefix="hm2fuzz") as directory:
        path = Path(directory) / name
        path.write_bytes(data)
        yield path


@target
def bitfile(data: bytes) -> None:
    """An image's data is the file's own; it is for the part that it names."""
    with suppress(BitfileError):
        image = parse_bitfile(data)
        assert image.data
        assert image.data in data
        assert image.file_size == len(data)
        check_part(image, image.part)


@target
def dump_text(data: bytes) -> None:
    """What is accepted comes back from its own text, and opens as a board or says what it lacks."""
    try:
        found = dump.from_text(data.decode("utf-8", "replace"))
    except BrokenDump:
        return
    assert all(0 <= address < 0x10000 and address % 4 == 0 for address in found.words)
    assert dump.from_text(dump.to_text(found)).words == found.words
    with (
        file_of(dump.to_text(found).encode(), "board.hm2dump") as path,
        suppress(HostMot2Error),
        hostmot2.open(f"dump://{path}") as board,
    ):
        assert repr(board)
        assert all(repr(module) for module in board.modules)


@target
def parameter_backup(data: bytes) -> None:
    """A backup holds numbers, or is refused."""
    with file_of(data, "backup.toml") as path, suppress(WrongBackup):
        found = backup.read(path)
        assert all(isinstance(value, int | float) for value in found.values.values())
        assert not backup.differences(found.values, found.values) or any(
            value != value for value in found.values.values()
        )


@target
def remote_state(data: bytes) -> None:
    """An emulated remote's state, or ValueError."""
    remote = catalog.remote("8i20")
    with file_of(data, "state.json") as path, suppress(ValueError):
        RemoteState(remote, path, "8i20")


class Answers:
    """A line on which these bytes come back, whatever is asked: a length, then so many bytes, and again."""

    url, baud = "fuzz:", 115200

    def __init__(self, data: bytes) -> None:
        self._left, self._waiting = data, b""

    def send(self, data: bytes) -> None:
        size = self._left[0] % 12 if self._left else 0
        self._waiting += self._left[1 : 1 + size]
        self._left = self._left[1 + size :]

    def receive(self, count: int, timeout_s: float) -> bytes:
        taken, self._waiting = self._waiting[:count], self._waiting[count:]
        return taken

    def flush(self) -> int:
        count, self._waiting = len(self._waiting), b""
        return count

    def pause(self, seconds: float) -> None: ...

    def close(self) -> None: ...


@target
def lbp_answers(data: bytes) -> None:
    """Any answers to the LBP client: values in their range, or an error of the line; it always ends."""
    with suppress(LbpError), LbpRemote(WireLink(Answers(data)), tries=3) as remote:
        assert remote.link.counters.commands < 10_000
        for size in (1, 2, 4, 8):
            assert 0 <= remote.read_remote(0x100, size) < 1 << 8 * size
        sizes = remote.discovery()
        assert 0 <= sizes.receive_size < 256
        assert 0 <= sizes.ptoc < 0x10000
        remote.write_remote(0x200, 0x1234, 2)
        assert len(remote.name) <= 4


class Recorded:
    """Registers of three records, as descriptors are decoded with."""

    count = 3

    def word(self, address: int, written: bool) -> np.ndarray | None:
        return np.arange(3, dtype=np.uint32) if address % 8 else None

    def fresh(self, address: int, written: bool) -> np.ndarray:
        return np.ones(3, np.bool_)


@target
def descriptors(data: bytes) -> None:
    """The attached process data: refused, or decodes what was recorded."""
    with suppress(BrokenRecording):
        found = Descriptors.parse(data)
        for direction in (Direction.INPUT, Direction.OUTPUT):
            found.units(direction)
            assert all(len(column) == 3 for column in found.columns(Recorded(), direction).values())


@target
def records_schema(data: bytes) -> None:
    """The description of the records: refused, or one whose vectors have as many places as names."""
    with suppress(BrokenRecording):
        found = form.parse_records_schema(data)
        assert found.dtype["inputs"].shape == (len(found.inputs),)
        np.zeros(2, found.dtype)


@target
def recording(data: bytes) -> None:
    """A whole file: refused, or read as far as it is whole."""
    with file_of(data, "run.mcap") as path, suppress(BrokenRecording, RecordingTooLarge):
        found = read_recording(path, limit=LIMIT)
        assert len(found.cycle) * found.records.dtype.itemsize <= LIMIT
        assert repr(found)
        assert len(found.gaps) <= len(found.records)
        _ = found.descriptors
        for name in found:
            assert len(found[name]) == len(found.records)
