"""Records of cycles into a file. What was flushed survives kill -9; the rest is at most `flush_s` old."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence

from hostmot2.record_ring import RecordRing
from hostmot2.recording import format as form
from hostmot2.recording.file import Attachment, RecordingFile
from hostmot2.recording.format import Signal
from hostmot2.recording.foxglove import layout
from hostmot2.recording.pump import Pump, check_signals


class Recorder(Pump):
    """Writes what is pushed into `ring` to the MCAP file `path`, from start() to close().

    inputs, outputs: what the numbers of a record's vectors are, in order. image: byte addresses of the
    image's words, bit 0 set for a written register, or a function that gives them (they may become more).
    left_out: gives how many registers found no room there; close() warns of them (HostMot2Warning).
    attachments: see `attachments_of`. metadata: name -> entries, all text. json_rate: at most so many
    messages per second and plot topic, None: one per cycle, 0: none; /hm2/records always has every record.
    clock: the board's, ns (`board.now_ns`), to which `start_ns` belongs.

    An existing file is replaced. Nothing else may pop from the ring meanwhile. Raises ValueError when signals
    and records do not agree, OSError when the file cannot be made, RecordingFailed while another recording is
    being written to it.

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
        left_out: Callable[[], int] = lambda: 0,
        attachments: Sequence[Attachment] = (),
        metadata: Mapping[str, Mapping[str, str]] | None = None,
        json_rate: float | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
        flush_s: float = 1.0,
    ) -> None:
        check_signals(ring, inputs, outputs)
        self.path = os.fspath(path)
        now_ns, unix_ns = clock(), time.time_ns()
        file = RecordingFile(path, ring.dtype, inputs, outputs, unix_ns - now_ns)
        try:
            super().__init__(
                ring,
                file,
                self.path,
                image=image,
                left_out=left_out,
                json_rate=json_rate,
                clock=clock,
                flush_s=flush_s,
            )
            run = {"format": form.FORMAT, "unix_ns_at_clock_0": str(unix_ns - now_ns)}
            picture = Attachment(form.LAYOUT_NAME, layout(inputs, outputs))
            file.attach([*attachments, picture], {form.RUN: run, **(metadata or {})})
            self._flush()  # from here on the file can be read
        except BaseException:
            file.close()
            raise
