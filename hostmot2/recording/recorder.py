"""Records of cycles from the ring into a file, in a thread of their own.

The cycle's thread only ever pushes into the ring and never waits: when the disk is slower than the ring is
long, records are dropped and counted. What was flushed survives kill -9; the rest is at most `flush_s` old.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from hostmot2.record_ring import RecordRing
from hostmot2.recording import format as form
from hostmot2.recording.errors import RecordingError, RecordingFailed
from hostmot2.recording.file import LEVELS, Attachment, RecordingFile
from hostmot2.recording.format import Signal
from hostmot2.recording.foxglove import layout

DRAIN_SECONDS = 0.02
BATCH_BYTES = 1 << 18
NOTES_KEPT = 10_000


class RecorderCounters(NamedTuple):
    """Of this recording: records written to the file, records that found no room in the ring."""

    records: int
    dropped: int


class Recorder:
    """Writes what is pushed into `ring` to the MCAP file `path`, from start() to close().

    inputs, outputs: what the numbers of a record's vectors are, in order. image: byte addresses of the
    image's words, bit 0 set for a written register, or a function that gives them (they may become more).
    attachments: see `attachments_of`. metadata: name -> entries, all text. json_rate: at most so many
    messages per second and plot topic, None: one per cycle, 0: none; /hm2/records always has every record.
    clock: the board's, ns (`board.now_ns`), to which `start_ns` belongs.

    An existing file is replaced. Nothing else may pop from the ring meanwhile. Raises ValueError when signals
    and records do not agree, OSError when the file cannot be made.

    Thread-safety: start, close, log and counters from any thread.
    """

    def __init__(
        self,
        ring: RecordRing,
        path: str | os.PathLike[str],
        inputs: Sequence[Signal] = (),
        outputs: Sequence[Signal] = (),
        *,
        image: Sequence[int] | Callable[[], Sequence[int]] = (),
        attachments: Sequence[Attachment] = (),
        metadata: Mapping[str, Mapping[str, str]] | None = None,
        json_rate: float | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
        flush_s: float = 1.0,
    ) -> None:
        for name, signals in (("inputs", inputs), ("outputs", outputs)):
            if ring.dtype[name].shape != (len(signals),):
                raise ValueError(f"{len(signals)} {name} are named, records have {ring.dtype[name].shape[0]}")
        if json_rate is not None and json_rate < 0:
            raise ValueError(f"{json_rate} messages per second")
        self.path = os.fspath(path)
        self._ring, self._clock, self._flush_s = ring, clock, flush_s
        self._image = image if callable(image) else lambda: image
        self._known_image: list[int] = []
        self._json_rate = json_rate
        self._json_slot = -1
        self._buffer = np.empty(min(ring.slots, max(16, BATCH_BYTES // ring.dtype.itemsize)), ring.dtype)
        self._records = 0
        self._dropped_before = ring.counters.dropped
        self._notes: deque[tuple[int, str, str, str]] = deque(maxlen=NOTES_KEPT)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        self._closed = False
        now_ns, unix_ns = clock(), time.time_ns()
        self._file = RecordingFile(path, ring.dtype, inputs, outputs, unix_ns - now_ns)
        try:
            run = {"format": form.FORMAT, "unix_ns_at_clock_0": str(unix_ns - now_ns)}
            picture = Attachment(form.LAYOUT_NAME, layout(inputs, outputs))
            self._file.attach([*attachments, picture], {form.RUN: run, **(metadata or {})})
            self._flush()  # from here on the file can be read
        except BaseException:
            self._file.close()
            raise

    def start(self) -> Self:
        """Begin to write. Once."""
        if self._thread is not None or self._closed:
            raise RuntimeError("a recorder is started once")
        self._thread = threading.Thread(target=self._run, name="hm2 recorder", daemon=True)
        self._thread.start()
        return self

    @property
    def counters(self) -> RecorderCounters:
        """What was written and dropped so far."""
        return RecorderCounters(self._records, self._ring.counters.dropped - self._dropped_before)

    @property
    def failure(self) -> BaseException | None:
        """Why the writer stopped before its time; None while all is well."""
        return self._failure

    def log(self, message: str, level: str = "info", name: str = "hm2", time_ns: int | None = None) -> None:
        """A line on /hm2/log at `time_ns` of the board's clock (None: now). level: debug .. fatal."""
        if level not in LEVELS:
            raise ValueError(f"level {level!r} is none of {', '.join(LEVELS)}")
        self._notes.append((self._clock() if time_ns is None else time_ns, level, name, message))

    def close(self) -> None:
        """Write what is in the ring, the counters and the index. Idempotent.

        Stop the producer first, else the last records may stay in the ring. Raises RecordingFailed if the
        writer had to stop earlier.
        """
        if self._closed:
            return
        self._closed = True
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        try:
            if self._failure is None:
                self._finish()
        except OSError as problem:
            self._failure = problem
        finally:
            self._close_file()
        failure = self._failure
        if failure is not None:
            raise RecordingFailed(
                f"{self.path}: writing stopped after {self._records} records: {failure}",
                os_errno=getattr(failure, "errno", None),
            ) from failure

    def _close_file(self) -> None:
        try:
            self._file.close()
        except OSError as problem:  # what was buffered does not fit on the disk either
            self._failure = self._failure or problem

    def _run(self) -> None:
        flush_at = time.monotonic() + self._flush_s
        try:
            while not self._stop.wait(DRAIN_SECONDS):
                self._drain()
                if time.monotonic() >= flush_at:
                    self._flush()
                    flush_at = time.monotonic() + self._flush_s
        except BaseException as problem:  # the cycle goes on; close() tells
            self._failure = problem

    def _drain(self) -> None:
        """What is in the ring now; of a producer faster than this, no more than a ringful."""
        for _ in range(-(-self._ring.slots // len(self._buffer)) + 1):
            count = self._ring.pop_into(self._buffer)
            if count:
                self._write(self._buffer[:count])
            if count < len(self._buffer):
                break
        while self._notes:
            self._file.log(*self._notes.popleft())

    def _write(self, records: npt.NDArray[Any]) -> None:
        self._look_at_image()
        self._file.records(records)
        chosen = self._decimated(records)
        if chosen.size:
            self._file.plots(chosen)
        self._records += len(records)

    def _look_at_image(self) -> None:
        image = list(self._image())
        if image != self._known_image:
            self._file.image(image)
            self._known_image = image

    def _decimated(self, records: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The first record of each period of 1 / json_rate."""
        if self._json_rate is None:
            return records
        if self._json_rate == 0:
            return records[:0]
        slots = (records["start_ns"] // (1e9 / self._json_rate)).astype(np.int64)
        chosen: npt.NDArray[Any] = records[np.diff(slots, prepend=self._json_slot) != 0]
        self._json_slot = int(slots[-1])
        return chosen

    def _flush(self) -> None:
        self._look_at_image()
        self._file.counters(*self.counters)
        self._file.flush()

    def _finish(self) -> None:
        self._drain()
        self._flush()
        self._file.finish()

    def __enter__(self) -> Self:
        return self if self._thread is not None else self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except RecordingError as failure:
            if error is None:
                raise
            error.add_note(str(failure))
