"""Records of cycles from the ring to where they are wanted, in a thread of their own.

The cycle's thread only ever pushes into the ring and never waits: when the other end is slower than the ring
is long, records are dropped and counted.
"""

from __future__ import annotations

import os
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
import numpy.typing as npt

from hostmot2._core import lib
from hostmot2.idrom import HostMot2Warning
from hostmot2.record_ring import RecordRing
from hostmot2.recording.errors import RecordingError, RecordingFailed
from hostmot2.recording.format import Signal
from hostmot2.recording.topics import LEVELS, Thinning

DRAIN_SECONDS = 0.02
BATCH_BYTES = 1 << 18
NOTES_KEPT = 10_000


class RecorderCounters(NamedTuple):
    """Records taken (written to the file, sent to viewers), and records that found no room in the ring."""

    records: int
    dropped: int


class Sink(Protocol):
    """Where records go. One thread uses it. May raise OSError: then the pump stops and tells at the end."""

    def records(self, records: npt.NDArray[Any], /) -> None:
        """Every record, in order."""

    def plots(self, records: npt.NDArray[Any], /) -> None:
        """Those of them that viewers shall see."""

    def image(self, registers: Sequence[int], /) -> None:
        """What the image's words are, before the first record and when it has grown."""

    def counters(self, records: int, dropped: int, /) -> None:
        """So far; each `flush_s`."""

    def log(self, board_ns: int, level: str, name: str, message: str, /) -> None:
        """What the program said."""

    def flush(self) -> None:
        """Each `flush_s`."""

    def finish(self) -> None:
        """Nothing more comes; not called after a failure."""

    def close(self) -> None:
        """In any case the last call."""


class Pump:
    """Takes what is pushed into `ring` to `sink`, from start() to close().

    label: what messages call the sink. image: byte addresses of the image's words, bit 0 set for a written
    register, or a function that gives them (they may become more). left_out: gives how many found no room,
    which is told at the end, as HostMot2Warning and in the log. json_rate: at most so many messages per
    second and topic for viewers, None: one per cycle, 0: none. clock: the board's, ns.

    Nothing else may pop from the ring meanwhile.

    Thread-safety: start, close, log and counters from any thread.
    """

    def __init__(
        self,
        ring: RecordRing,
        sink: Sink,
        label: str,
        *,
        image: Sequence[int] | Callable[[], Sequence[int]] = (),
        left_out: Callable[[], int] = lambda: 0,
        json_rate: float | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
        flush_s: float = 1.0,
    ) -> None:
        self._ring, self._sink, self._label = ring, sink, label
        self._clock, self._flush_s = clock, flush_s
        self._image = image if callable(image) else lambda: image
        self._known_image: list[int] = []
        self._left_out = left_out
        self._thinned = Thinning(json_rate)
        self._buffer = np.empty(min(ring.slots, max(16, BATCH_BYTES // ring.dtype.itemsize)), ring.dtype)
        self._records = 0
        self._dropped_before = ring.counters.dropped
        self._notes: deque[tuple[int, str, str, str]] = deque(maxlen=NOTES_KEPT)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        self._closed = False
        self.ended = False
        """Nothing is taken from the ring any more, the sink is closed."""
        self._owner = os.getpid()

    def start(self) -> Self:
        """Begin. Once."""
        if self._thread is not None or self._closed:
            raise RuntimeError("a recorder is started once")
        self._thread = threading.Thread(target=self._run, name="hm2 recorder", daemon=True)
        self._thread.start()
        return self

    @property
    def counters(self) -> RecorderCounters:
        """What was taken and dropped so far."""
        return RecorderCounters(self._records, self._ring.counters.dropped - self._dropped_before)

    @property
    def failure(self) -> BaseException | None:
        """Why it stopped before its time; None while all is well."""
        return self._failure

    def log(self, message: str, level: str = "info", name: str = "hm2", time_ns: int | None = None) -> None:
        """A line on /hm2/log at `time_ns` of the board's clock (None: now). level: debug .. fatal."""
        if level not in LEVELS:
            raise ValueError(f"level {level!r} is none of {', '.join(LEVELS)}")
        self._notes.append((self._clock() if time_ns is None else time_ns, level, name, message))

    def close(self) -> None:
        """Take what is in the ring, the counters and the end to the sink. Idempotent.

        Stop the producer first, else the last records may stay in the ring. In a forked child nothing
        happens. Raises RecordingFailed if the thread had to stop earlier.
        """
        if self._closed or os.getpid() != self._owner:
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
            self._close_sink()
            self.ended = True
        failure = self._failure
        if failure is not None:
            raise RecordingFailed(
                f"{self._label}: writing stopped after {self._records} records: {failure}",
                os_errno=getattr(failure, "errno", None),
            ) from failure

    def _close_sink(self) -> None:
        try:
            self._sink.close()
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
                self._take(self._buffer[:count])
            if count < len(self._buffer):
                break
        while self._notes:
            self._sink.log(*self._notes.popleft())

    def _take(self, records: npt.NDArray[Any]) -> None:
        self._look_at_image()
        self._sink.records(records)
        chosen = self._thinned(records)
        if chosen.size:
            self._sink.plots(chosen)
        self._records += len(records)

    def _look_at_image(self) -> None:
        image = list(self._image())
        if image != self._known_image:
            self._sink.image(image)
            self._known_image = image

    def _flush(self) -> None:
        """Counters, and everything so far out of this process. For the pump's thread once that runs."""
        self._look_at_image()
        self._sink.counters(*self.counters)
        self._sink.flush()

    def _finish(self) -> None:
        room, left_out = self._ring.dtype["words"].shape[0], self._left_out()
        if room and left_out:  # without any room none were wanted
            message = (
                f"{self._label}: {left_out} registers of the cycle are not in the records, whose image has "
                f"room for {room} (words=, at most {lib.HM2_RECORD_WORDS}); all inputs and outputs are"
            )
            warnings.warn(message, HostMot2Warning, stacklevel=3)
            self.log(message, "warning")
        self._drain()
        self._flush()
        self._sink.finish()

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


def check_signals(ring: RecordRing, inputs: Sequence[Signal], outputs: Sequence[Signal]) -> None:
    """Raises ValueError when signals and records do not agree, or two signals have one name."""
    for name, signals in (("inputs", inputs), ("outputs", outputs)):
        if len({signal.name for signal in signals}) < len(signals):
            raise ValueError(f"two {name} have the same name: who reads the recording would find one of them")
        if ring.dtype[name].shape != (len(signals),):
            raise ValueError(f"{len(signals)} {name} are named, records have {ring.dtype[name].shape[0]}")
