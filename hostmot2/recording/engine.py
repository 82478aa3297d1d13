"""Recording what the cycle engine does."""

from __future__ import annotations

import os

from hostmot2.engine import Engine
from hostmot2.recording.attachments import attachments_of, host_metadata
from hostmot2.recording.format import Signal
from hostmot2.recording.recorder import Recorder

SLOTS = 8192  # two seconds at 4 kHz
WORDS = 128


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

    slots: of the ring between the two, a power of two; the longest stall of the disk that costs nothing is
    slots / rate. words: room for raw registers, 0 to 256. json_rate: see Recorder. Reads the card's registers
    once. Raises EngineError if the engine has been started, OSError for the file, TransportError.
    """
    board = engine.board
    ring = engine.record(slots, words)
    inputs, outputs = engine.signals
    engine_facts = {"rate": str(engine.rate), "slots": str(slots), "url": board.url}
    return Recorder(
        ring,
        path,
        [Signal(each.name, each.unit) for each in inputs],
        [Signal(each.name, each.unit) for each in outputs],
        image=lambda: [address | int(written) for address, written in engine.layout()],
        attachments=attachments_of(board),
        metadata={**host_metadata(), "hm2.engine": engine_facts},
        json_rate=json_rate,
        clock=board.now_ns,
    )
