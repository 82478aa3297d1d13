"""Where snapshots come from: an engine on the card, looked at ten times a second by a thread of its own.

The engine's thread never waits for a view, and a view never waits for the card: it takes `Source.latest`.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

from hostmot2.engine import Engine, Off
from hostmot2.errors import EngineError, HostMot2Error, LinkFailed
from hostmot2.modules.driven import raise_if_driven
from hostmot2.monitor.events import EventLog, off_words
from hostmot2.monitor.latency import LatencyHistory
from hostmot2.monitor.outputs import Outputs
from hostmot2.monitor.recordings import Recordings
from hostmot2.monitor.rows import Rows
from hostmot2.monitor.snapshot import Problem, Snapshot
from hostmot2.monitor.watched import Watched, module_of
from hostmot2.registers import Gtag, Id
from hostmot2.sserial import ChannelCounters, NoFirmware

if TYPE_CHECKING:
    from hostmot2.board import Board

LOOK_SECONDS = 0.1
LATENCY_SECONDS = 0.5
COUNTERS_SECONDS = 0.5
"""Between the counters of one channel and those of the next: remotes get no transfer meanwhile."""
DEAD_MAN_SECONDS = 1.0
"""Armed outputs go off when the view has not said for so long that it is alive."""

Start = Mapping[int, int]
"""Port: mask of its channels."""


class Source:
    """Snapshots of a board that this makes an engine for.

    start None: only looks; open the board with read_only=True. Else the channels of these masks are started,
    all outputs off; {}: every remote that answers. allow_write: outputs can be armed (see `outputs`). modes:
    software mode by (port, channel), for the start.

    Thread-safety: `latest`, recordings and outputs are for the view's thread.
    """

    def __init__(
        self,
        board: Board,
        *,
        start: Start | None = None,
        rate: float = 200.0,
        allow_write: bool = False,
        modes: Mapping[tuple[int, int], int] | None = None,
    ) -> None:
        self.board = board
        self.driving = start is not None
        if start is not None:
            raise_if_driven(board)
            self._start_remotes(start, modes or {})
        watched = self._watch()
        options = {} if self.driving else {"style": "pipelined"}  # in one exchange
        self.engine: Engine = board.engine(rate, dead_man=DEAD_MAN_SECONDS, **options)
        for signal in watched.signals:
            self.engine.add_input(signal)
        has_watchdog = self.driving and module_of(board, Gtag.WATCHDOG) is not None
        watchdog = board.watchdog if has_watchdog else None
        self.outputs = Outputs(self.engine, watchdog, allowed=allow_write and self.driving)
        self.recordings = Recordings(self.engine)
        self._rows = Rows(board, self.driving)
        self._events = EventLog()
        self._latency = LatencyHistory()
        self._counters: dict[tuple[int, int], ChannelCounters] = {}
        self._next_channel = 0
        self._due = {"latency": 0.0, "counters": 0.0}
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self.latest = Snapshot(card=board.name, url=board.url, access="starting", rate=rate)
        """The snapshot to show."""
        self.failure: BaseException | None = None
        """A fault of this program that ended the thread."""

    def _start_remotes(self, start: Start, modes: Mapping[tuple[int, int], int]) -> None:
        """Channels that do not start are shown as what they are."""
        if not Rows.has_sserial(self.board):
            return
        for port in self.board.sserial:
            for (number, channel), mode in modes.items():
                if number == port.number:
                    port.channels[channel].mode = mode
            mask = start.get(port.number, 0)
            if not start:
                mask = sum(1 << row.channel for row in port.scan() if row.found)
            if mask:
                port.start(mask)

    def _watch(self) -> Watched:
        watched = Watched(self.board)
        watched.watchdog()
        watched.channel_status()
        watched.directions()
        if self.driving:
            self.board.ioport  # noqa: B018 - its levels are among the engine's inputs from now on
        else:
            watched.levels()
            watched.encoders()
        return watched

    # -- running

    def start(self) -> None:
        """Start the engine, outputs off, and look from now on. On a card with virtual time call look()."""
        self.engine.start()
        if not self.board.virtual_time:
            self._thread = threading.Thread(target=self._run, name="hm2 monitor", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Outputs off, recording ended, engine stopped. Idempotent. Raises RecordingFailed."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        try:
            self.engine.stop()
        finally:
            self.recordings.stop()

    def _run(self) -> None:
        try:
            while not self._stop.wait(LOOK_SECONDS):
                self.look()
        except BaseException as problem:  # shown by the view, which then ends
            self.failure = problem

    def look(self) -> Snapshot:
        """A new `latest`."""
        if self.board.virtual_time:
            for _ in range(max(1, round(LOOK_SECONDS * self.engine.rate))):
                self.engine.step()
        now = time.monotonic()
        if self._is_due("latency", now, LATENCY_SECONDS):
            self._latency.add(self.engine.trace())
        if self.driving and self._is_due("counters", now, COUNTERS_SECONDS):
            self._read_counters()
        self.latest = self._snapshot()
        return self.latest

    def _is_due(self, what: str, now: float, period: float) -> bool:
        if now < self._due[what]:
            return False
        self._due[what] = now + period
        return True

    def _read_counters(self) -> None:
        """Of the next channel: one at a time, so that no remote waits for long."""
        if not Rows.has_sserial(self.board):
            return
        places = [(port, channel.number) for port in self.board.sserial for channel in port.channels]
        port, number = places[self._next_channel % len(places)]
        self._next_channel += 1
        try:
            with self.engine.lend(port):
                self._counters[port.number, number] = port.channel_counters(number)
        except (EngineError, NoFirmware):
            self._counters.pop((port.number, number), None)
        except HostMot2Error:
            pass  # the exchanges' failures are shown already

    # -- a snapshot

    def _snapshot(self) -> Snapshot:
        frame = self.engine.read()
        status = frame.status
        problem = self._problem(status.stale)
        for event in self.engine.events():
            row = self._events.add(event, self.engine.now_ns(), problem)
            self.recordings.log(row.text, event.time_ns)
        return Snapshot(
            card=self.board.name,
            url=self.board.url,
            access=self._access(status.off),
            off=self._why_off(status.off),
            rate=self.engine.rate,
            cycles=status.cycles,
            lost=status.failures,
            overruns=status.overruns,
            watchdog=self._rows.watchdog(frame),
            latency=self._latency.view,
            channels=self._rows.channels(frame, self._counters),
            encoders=self._rows.encoders(frame),
            values=self._rows.values(frame),
            bits=self._rows.bits(frame),
            events=self._events.rows,
            hints=self._rows.hints(frame),
            recording=self.recordings.view,
            problem=problem,
        )

    def _access(self, off: Off) -> str:
        if not self.driving:
            return "read-only"
        return "outputs off" if off else "ARMED"

    def _why_off(self, off: Off) -> str:
        """In words, unless outputs have not been armed at all."""
        if not self.driving or not off or off & (Off.IDLE | Off.USER):
            return ""
        return ", ".join(off_words(off))

    def _problem(self, stale: int) -> Problem | None:
        """While exchanges fail: what a plain read of the card says."""
        if not stale:
            return None
        try:
            self.board.read(Id.cookie.number)
        except LinkFailed as error:
            if self.driving:
                return Problem(f"{error}: quit and start the monitor anew when the card answers", error.code)
            return None if self._link_is_back() else Problem(str(error), error.code)
        except HostMot2Error as error:
            return Problem(str(error), error.code)
        return None

    def _link_is_back(self) -> bool:
        """Of a card that is only looked at: nothing was set up in it that it may have lost meanwhile."""
        try:
            with self.board._link_taken_up():
                self.board.read(Id.cookie.number)
        except HostMot2Error:
            return False
        return True
