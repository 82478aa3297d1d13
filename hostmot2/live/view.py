"""The live view of an engine."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from hostmot2.engine import Engine
from hostmot2.live.server import Server
from hostmot2.record_ring import RecordRing
from hostmot2.recording.engine import SLOTS, signals_of
from hostmot2.recording.format import Signal
from hostmot2.recording.foxglove import layout
from hostmot2.recording.pump import Pump, check_signals

HOST = "127.0.0.1"
PORT = 8765
"""What viewers offer when asked to connect."""
JSON_RATE = 100.0
COUNTERS_SECONDS = 1.0


class LiveView(Pump):
    """Streams what is pushed into `ring` to Foxglove, from start() to close().

    The topics are those of a recording but for its binary ones (/hm2/records, /hm2/image). Viewers may come
    and go; one that is too slow misses messages and keeps nobody waiting. Whoever reaches host and port can
    look, nobody can write.

    inputs, outputs: what the numbers of a record's vectors are. json_rate: at most so many messages per
    second and topic, None: one per cycle. clock: the board's, ns. name: of the source, as viewers show it.

    Thread-safety: start, close, log and counters from any thread. Raises ValueError when signals and records
    do not agree, LiveError if host and port cannot be had.
    """

    def __init__(
        self,
        ring: RecordRing,
        inputs: Sequence[Signal] = (),
        outputs: Sequence[Signal] = (),
        *,
        host: str = HOST,
        port: int = PORT,
        json_rate: float | None = JSON_RATE,
        clock: Callable[[], int] = time.monotonic_ns,
        name: str = "hostmot2",
    ) -> None:
        check_signals(ring, inputs, outputs)
        server = Server(host, port, name, inputs, outputs, time.time_ns() - clock())
        self.host, self.port = host, server.port
        self.layout = layout(inputs, outputs)
        """A layout for the viewer, to be imported there: JSON."""
        try:
            super().__init__(
                ring, server, self.url, json_rate=json_rate, clock=clock, flush_s=COUNTERS_SECONDS
            )
        except BaseException:
            server.close()  # or its port stays taken
            raise

    @property
    def url(self) -> str:
        """What the viewer connects to."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"ws://{host}:{self.port}"


def serve(
    engine: Engine,
    *,
    host: str = HOST,
    port: int = PORT,
    json_rate: float | None = JSON_RATE,
    slots: int = SLOTS,
) -> LiveView:
    """A live view of everything an engine does. Before the engine's start().

        with live.serve(engine), engine:
            ...

    host: an address of this computer; only 127.0.0.1 keeps it to this computer. port 0: any free one, see
    `LiveView.port`. json_rate: messages per second and topic. slots: of the ring between the two, a power of
    two. Raises EngineError if the engine has been started or is recorded, LiveError, ValueError.
    """
    ring = engine.record(slots, 0)
    inputs, outputs = signals_of(engine)
    name = f"{engine.board.name} {engine.board.url}"
    try:
        return LiveView(
            ring, inputs, outputs, host=host, port=port, json_rate=json_rate, clock=engine.now_ns, name=name
        )
    except BaseException:
        engine.drop_records()  # it may be tried again, at another port
        raise
