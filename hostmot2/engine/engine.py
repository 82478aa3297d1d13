"""An engine as Python sees it; the engine itself is csrc/engine*.c."""

from __future__ import annotations

import os
import weakref
from collections.abc import Iterator
from contextlib import AbstractContextManager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, Unpack

import numpy as np

from hostmot2._core import ffi, lib
from hostmot2.board import SafeOff
from hostmot2.engine.axis import Axis, pid_of
from hostmot2.engine.build import Plan, Wiring, build
from hostmot2.engine.facts import status_of
from hostmot2.engine.frame import Frame
from hostmot2.engine.lend import lend, take_back
from hostmot2.engine.options import Options, new_config, warn_of
from hostmot2.engine.restart import Restarter
from hostmot2.engine.signals import Commands, PortData, Readings, Signal
from hostmot2.engine.vectors import Vectors, doubles
from hostmot2.engine.view import EngineView
from hostmot2.errors import EngineError, TransportClosed, check
from hostmot2.record_ring import RecordRing, record_dtype
from hostmot2.registers import Gtag

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.sserial import SserialPort

WAIT_NS = 50_000_000
_made: weakref.WeakSet[Engine] = weakref.WeakSet()


class Engine(EngineView):
    """A thread in C that reads, controls and writes everything in use on a board, `rate` times a second.

    rate: cycles per second, up to 20000. style: "pipelined" (one exchange a cycle: what was controlled in the
    last cycle goes out with the request, DOIT last), "read-modify-write" (two: control in between, so outputs
    go out in the cycle that read the inputs) or "auto" (pipelined over Ethernet up to 1.6 kHz, else the
    other).

    Outputs are off until the first write(). They go off by themselves, everything zero and enables dropped,
    when write() has not come for `dead_man` seconds (0.1); when `stale_limit` exchanges in a row (5) failed,
    or brought no result of a port that could be told from an older one; when the watchdog has bitten; when a
    remote reports a fault (its own watchdog's holds: stop() the engine, start the port, start() the engine);
    when a port's `fault_bucket` (failed exchanges add, good ones take off, limit: 10, 1, 200) is full; when
    an axis exceeds its following error; after `overrun_limit` overruns in a row (0). 0 is no limit. The loop
    goes on, events() says why, only enable() turns them on again. restart_ports: starts of a given-up port.

    overrun: "skip" leaves periods out that have passed, "catch-up" makes up for up to ten. reply_timeout:
    by default 0.8 of a period, 20 ms at most. real_time: SCHED_FIFO (True: 60, or a priority), memory locked;
    cpu: the processor; early: seconds awake before the time (60 us). Refused: a RealTimeWarning.

    On a card with virtual time there is no thread: frames() and step() run the cycles.

    Thread-safety: any thread may read, write, enable and stop. While it runs the board's cycle and its
    smart-serial ports belong to the engine (EngineError for others); registers may be read and written.
    """

    def __init__(
        self,
        board: Board,
        rate: float = 1000.0,
        *,
        restart_ports: int = 0,
        **options: Unpack[Options],
    ) -> None:
        super().__init__(board, rate, _running_ports(board))
        self.restart_ports = restart_ports
        self._vectors = Vectors(board, self._ports)
        self._plan = Plan(new_config(board, rate, **options), self._ports, self._vectors)
        self._restarter: Restarter | None = None
        self._lent: set[int] = set()
        self._pid = os.getpid()
        _made.add(self)

    # -- what it is made of

    @property
    def outputs(self) -> Commands:
        """What write() sends, by name; `outputs.array` is all of it, as long as nothing is added."""
        return self._vectors.commands

    @property
    def input_names(self) -> list[str]:
        """Names of all inputs, in the order of the vectors."""
        return list(self._vectors.input_names)

    @property
    def signals(self) -> tuple[list[Signal], list[Signal]]:
        """Inputs and outputs with their units, in the order of the vectors."""
        return list(self._vectors.inputs), list(self._vectors.outputs)

    def add_input(self, added: Signal) -> None:
        """One more input: a number in memory that a part of the board's cycle reads into. Before start()."""
        self._before_start()
        self._vectors.add_input(added)

    def add_command(self, name: str) -> None:
        """A number among the outputs that goes to controllers only. Before start()."""
        self._before_start()
        self._vectors.add_command(name)

    def add_control(self, function: Any, context: Any = None) -> None:
        """Run a compiled function in every cycle, in the engine's thread, between inputs and outputs.

        function: `void f(void *context, const double *inputs, double *outputs, double seconds, int enabled)`,
        as its address, an object with an `address` (numba's cfunc) or a pointer of cffi. inputs, outputs:
        numbers in the order of `input_names` and `outputs`; outputs holds what was written last, and what the
        function leaves there goes out. seconds: since it ran last. enabled 0: outputs are off, and nothing of
        it goes out. It is left out in cycles whose inputs could not be read. context: None, an address, a
        pointer of cffi or a writable array.

        Functions run one after the other, then the axes. They must neither block nor call Python. An output
        that is not a finite number turns outputs off (Off.CONTROL). Function and context are kept for as long
        as the engine; behind plain addresses the caller has to keep them.

        Before start(), else EngineError. Raises TypeError for what is no such function or context, ValueError
        for address 0 and for more than 8 functions.
        """
        self._before_start()
        self._plan.controls.add(function, context)

    def add_pid(
        self,
        name: str,
        *,
        feedback: str,
        output: str,
        feedback_velocity: str | None = None,
        velocity_command: bool = False,
        **settings: float,
    ) -> Axis:
        """A position controller: output follows from command `name` and feedback. Before start().

        feedback, output: names of an input and an output, "encoder0.position" and "analogout0".
        feedback_velocity: an input; by default the one beside a "....position". velocity_command: the
        command comes with its velocity. settings: see axis.SETTINGS. Raises KeyError for the names,
        ValueError for one that is there and for a 17th axis.
        """
        self._before_start()
        self._plan.raise_if_full()
        readings = self._vectors.input_names
        feedback_name = self.input_names[readings[feedback]]
        if feedback_velocity is None and feedback_name.endswith(".position"):
            beside = feedback_name.removesuffix("position") + "velocity"
            feedback_velocity = beside if beside in readings else None
        if feedback_velocity is not None:
            readings[feedback_velocity]
        self.outputs.index(output)
        pid = pid_of(settings)
        self._vectors.add_position(f"{name}.position")
        if velocity_command:
            self.add_command(f"{name}.velocity")
        axis = Axis(self, len(self._plan.axes), name, velocity_command, pid)
        self._plan.axes.append(Wiring(axis, feedback_name, output, feedback_velocity))
        return axis

    def record(self, slots: int = 8192, words: int = 128) -> RecordRing:
        """A ring that gets one record per cycle, to be emptied by one reader. Before start(), last of all.

        slots: a power of two; words: room for the raw register image. What finds no room is counted in
        `ring.counters`; the engine never waits. layout() tells what the image's words are. There is one ring:
        EngineError for the second who asks; and from start() where signals were added behind it.
        """
        self._before_start()
        if self._plan.ring is not None:
            raise EngineError("the engine's records go to somebody already")
        dtype = record_dtype(words, len(self._vectors.inputs), len(self._vectors.outputs))
        self._plan.ring = RecordRing(dtype, slots)
        return self._plan.ring

    def drop_records(self) -> None:
        """Nobody wants the records after all, and somebody else may ask for them. Before start()."""
        self._before_start()
        self._plan.ring = None

    def _before_start(self) -> None:
        if self.handle:
            raise EngineError("the engine has been started: make another one")

    # -- running

    def start(self) -> Self:
        """Arm the watchdog, take the board's cycle and begin, outputs off until write().

        Raises EngineError if another engine runs, if channels were started or stopped since this one was made
        or parts of the board used for the first time since its first start, ValueError for more signals than
        an engine has room for, WatchdogBite, TransportError.
        """
        with self.board.lock, self._lock:
            if self._started:
                return self
            cycle = self.board.cycle
            if self.board.closed:
                raise TransportClosed(f"{self.board.name}: the board has been closed")
            if cycle.engine is not None:
                raise EngineError(f"{self.board.name}: another engine is running")
            has_watchdog = cycle.automatic_watchdog and any(
                m.gtag == Gtag.WATCHDOG for m in self.board.modules
            )
            for port in self._ports:
                port.raise_if_changed()
            self._has_watchdog = has_watchdog
            if has_watchdog:
                self.board.watchdog.relax()  # locking memory may take longer than its timeout
            try:
                self._take()
            except BaseException:
                self._give_back()
                raise
            cycle.engine = self
            self.board.on_close(self.stop, SafeOff.SESSION)
            self._started = True
            try:
                self._launch()
                cycle.arm_watchdog()
            except BaseException:
                self.stop()
                raise
            if self.restart_ports and self._ports:
                threaded = not self.board.virtual_time
                self._restarter = Restarter(self, self.restart_ports, threaded=threaded)
            return self

    def _take(self) -> None:
        for port in self._ports:
            port.take()  # before the cycle is looked at: its first time makes it part of that
        cycle = self.board.cycle.handle
        if not self.handle:
            self.handle, self._kept = build(self._plan, self.board.handle, cycle)
            self._cycle = cycle
        if self._cycle is not cycle:
            raise EngineError(f"{self.board.name}: more parts are in use than at first: make another one")

    def _give_back(self) -> None:
        for port in self._ports:
            port.give_back()

    def _launch(self) -> None:
        refusals: Any = ffi.new("hm2_engine_refusals *")
        check(lib.hm2_engine_start(self.handle, refusals, self._error), self._error)
        warn_of(refusals, self._plan.config.cpu)

    def stop(self) -> None:
        """Outputs off and sent, the thread ended, the board everybody's again. Idempotent."""
        if os.getpid() != self._pid:
            return
        with self.board.lock, self._lock:
            if not self._started:
                return
            try:
                if self._restarter is not None:
                    self._restarter.stop()
            finally:
                try:
                    for number in tuple(self._lent):  # zeroes are to go there, too
                        take_back(self, number)
                    lib.hm2_engine_stop(self.handle)
                finally:
                    self._let_go()

    def _let_go(self) -> None:
        """Ctrl-C before `_started` is off: stop() is called again, and each part of it may be done twice."""
        self._restarter = None
        self._take_events()
        self._give_back()
        self._vectors.clear()
        self.board.cycle.engine = None
        self.board.forget_on_close(self.stop)
        self._started = False
        if self._has_watchdog and not self.board.watchdog.has_bitten:
            self.board.watchdog.relax()

    def _disown(self) -> None:
        lock: Any = self._lock
        if not lock._is_owned():
            lock._at_fork_reinit()
        if self.handle:
            lib.hm2_engine_abandon(self.handle)
        self._started = False

    def step(self) -> Frame:
        """One cycle, on a card with virtual time. Raises EngineError elsewhere, and when not started."""
        if not self._started or not self.board.virtual_time:
            raise EngineError("step() is for a started engine on a card with virtual time")
        with self.board.lock, self._lock:
            check(lib.hm2_engine_step(self.handle, self._error), self._error)
            if self._restarter is not None:
                self._restarter.look()
            return self.read()

    # -- values

    def write(self) -> None:
        """Send `outputs` from the next cycle on; also says that this program is alive.

        What was changed through the cards and channels of the board since the last write goes out, too.
        """
        with self._lock:
            self._require()
            lib.hm2_engine_write(self.handle, doubles(self._vectors.take_commands()))

    def read(self) -> Frame:
        """The last cycle. Its inputs are then also what the board's channels show."""
        with self._lock:
            self._require()
            status: Any = ffi.new("hm2_engine_status *")
            vectors = self._vectors
            inputs, sent = np.empty(len(vectors.inputs)), np.empty(len(vectors.outputs))
            lib.hm2_engine_read(self.handle, status, doubles(inputs), doubles(sent))
            vectors.show(inputs)
            return Frame(
                status_of(status, len(self._ports)),
                Readings(vectors.input_names, inputs),
                Readings(vectors.output_names, sent),
                self.outputs,
            )

    def frames(self, seconds: float | None = None) -> Iterator[Frame]:
        """Every cycle's frame, the latest where the loop is too slow; `outputs` go out behind each turn.

        seconds: ends after so long; None: never. Raises EngineError when the engine is stopped meanwhile.
        """
        end = None if seconds is None else round(seconds * self.rate)
        first = last = self.status.cycles
        while end is None or last - first < end:
            frame = self._next(last)
            last = frame.status.cycles
            yield frame
            if self._started:
                self.write()

    def _next(self, last: int) -> Frame:
        if self.board.virtual_time:
            return self.step()
        while True:
            self._require()
            if lib.hm2_engine_wait(self.handle, last, WAIT_NS):
                return self.read()

    def enable(self) -> None:
        """Write the outputs, and turn them on after they went off. What still holds turns them off again.

        The watchdog is armed anew if a bite has been acknowledged. Raises TransportError if that fails.
        """
        self._require()
        if self._has_watchdog and not (self.board.watchdog.armed or self.board.watchdog.has_bitten):
            with self.board.lock:
                self._require()
                self.board.watchdog.arm()
        with self._lock:
            self.write()
            lib.hm2_engine_enable(self.handle)

    def disable(self) -> None:
        """Turn outputs off until enable()."""
        with self._lock:
            self._require()
            lib.hm2_engine_disable(self.handle)

    def lend(self, port: SserialPort) -> AbstractContextManager[None]:
        """A smart-serial port of the engine's, for the time of a with block: counters(), say.

        Its channels run on and get no transfer meanwhile, so be quick: 40 ms and their watchdogs bite.
        Everything else goes on. A port that comes back with channels stopped is given up. Raises EngineError
        if the engine does not run or the port's exchanges fail.
        """
        return lend(self, port)

    def _require(self) -> None:
        if not self._started:
            raise EngineError("the engine is not running: start() it")

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


def _running_ports(board: Board) -> list[PortData]:
    if "sserial" not in board._parts:
        return []
    return [PortData(port) for port in board.sserial if port.mode == "normal" and port.started]


def _after_fork() -> None:
    """The thread and the card are the parent's, and so is a thread that had an engine locked."""
    for engine in list(_made):
        engine._disown()


os.register_at_fork(after_in_child=_after_fork)
