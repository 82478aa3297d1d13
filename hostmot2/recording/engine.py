"""Recording what the cycle engine does."""

from __future__ import annotations

import os
import weakref

from hostmot2.engine import Engine
from hostmot2.recording.attachments import attachments_of, descriptors_of, host_metadata
from hostmot2.recording.errors import RecordingError
from hostmot2.recording.format import Signal
from hostmot2.recording.recorder import Recorder

SLOTS = 8192  # two seconds at 4 kHz
WORDS = 128


def signals_of(engine: Engine) -> tuple[list[Signal], list[Signal]]:
    """What an engine's records hold: inputs, outputs."""
    inputs, outputs = engine.signals
    return [Signal(s.name, s.unit) for s in inputs], [Signal(s.name, s.unit) for s in outputs]


class EngineRecords:
    """The records of an engine and what describes them, to be had before its start(); they go to one reader.

    slots: of the ring between the two, a power of two; the longest stall of the reader that costs nothing is
    slots / rate. words: room for raw registers, 0 to 256; those without are counted (`engine.left_out`), and
    told when the recording is closed. Raises EngineError if the engine has been started.
    """

    def __init__(self, engine: Engine, *, slots: int = SLOTS, words: int = WORDS) -> None:
        self.engine = engine
        self.ring = engine.record(slots, words)
        self.inputs, self.outputs = signals_of(engine)
        self._facts = {"rate": str(engine.rate), "slots": str(slots), "url": engine.board.url}
        self._dump = attachments_of(engine.board)[0]
        self._last: weakref.ref[Recorder] | None = None

    def recorder(self, path: str | os.PathLike[str], *, json_rate: float | None = None) -> Recorder:
        """A recorder of what comes from now on. json_rate: see Recorder.

        One at a time: RecordingError until the last one is closed, its file whole. Raises OSError.
        """
        last = self._last() if self._last is not None else None
        if last is not None and not last.ended:
            raise RecordingError(f"{last.path}: the last recording of this engine has not been ended yet")
        while self.ring.pop().size:
            pass  # what nobody wanted
        recorder = Recorder(
            self.ring,
            path,
            self.inputs,
            self.outputs,
            image=lambda: [address | int(written) for address, written in self.engine.layout()],
            left_out=lambda: self.engine.left_out,
            attachments=[self._dump, descriptors_of(self.engine.board)],  # scalings may have changed
            metadata={**host_metadata(), "hm2.engine": self._facts},
            json_rate=json_rate,
            clock=self.engine.now_ns,
        )
        self._last = weakref.ref(recorder)
        return recorder


def record(
    engine: Engine,
    path: str | os.PathLike[str],
    *,
    slots: int = SLOTS,
    words: int = WORDS,
    json_rate: float | None = None,
) -> Recorder:
    """A recorder of everything an engine does. Before the engine's start().

        with record(engine, "run.mcap"), engine:
            ...

    slots, words: see EngineRecords. json_rate: see Recorder. Reads the card's registers once. Raises
    EngineError if the engine has been started, OSError for the file, RecordingFailed if another recording is
    being written to it, TransportError.
    """
    records = EngineRecords(engine, slots=slots, words=words)
    try:
        return records.recorder(path, json_rate=json_rate)
    except BaseException:
        engine.drop_records()  # it may be tried again, elsewhere
        raise
