"""An engine as Python sees it; the engine itself is csrc/engine*.c."""

from __future__ import annotations

import os
import threading
import time
import weakref
from collections import deque
from collections.abc import Iterator
from contextlib import AbstractContextManager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, Unpack

import numpy as np

from hostmot2._core import ffi, lib
from hostmot2.board import SafeOff
from hostmot2.engine import signals as signal
from hostmot2.engine.axis import Axis, pid_of
from hostmot2.engine.control import Controls
from hostmot2.engine.facts import EngineStatus, Event, Off, event_of, status_of
from hostmot2.engine.frame import Frame
from hostmot2.engine.lend import lend
from hostmot2.engine.options import Options, new_config, warn_of
from hostmot2.engine.restart import Restarter
from hostmot2.engine.signals import Commands, Names, Readings, Signal
from hostmot2.errors import EngineError, check, new_error
from hostmot2.handles import own
from hostmot2.histogram import Histogram
from hostmot2.record_ring import STAGES, RecordRing, record_dtype
from hostmot2.registers import Gtag

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.sserial import SserialPort

EVENTS_KEPT = 10_000
WAIT_NS = 50_000_000
_running: weakref.WeakSet[Engine] = weakref.WeakSet()


class Engine:
    """A thread in C that reads, controls and writes everything in use on a board, `rate` times a second.

    rate: cycles per second, up to 20000. style: "pipelined" (one exchange a cycle: what was controlled in the
    last cycle goes out with the request, DOIT last), "read-modify-write" (two: control in between, so outputs
    go out in the cycle that read the inputs) or "auto" (pipelined over Ethernet up to 1.6 kHz, else the
    other).

    Outputs are off until the first write(). They go off by themselves, everything zero and enables dropped,
    when write() has not come for `dead_man` seconds (0: never); when `stale_limit` exchanges in a row
    failed; when the watchdog has bitten; when a remote reports a fault; when a port's fault bucket
    (`fault_bucket`: added by a failed exchange with its remotes, taken off by a good one, limit) is full;
    when an axis exceeds its following error; after `overrun_limit` overruns in a row (0: never). The loop
    goes on, events() says why, and only enable() turns them on again. restart_ports: how often a port given
    up is started anew; its outputs stay off.

    overrun: "skip" leaves periods out that have passed, "catch-up" makes up for up to ten. real_time:
    SCHED_FIFO (True, or a priority), memory locked; cpu: the processor to run on; early: seconds awake before
    the time. What is refused is a RealTimeWarning.

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
        self.board = board
        self.rate = rate
        self.restart_ports = restart_ports
        self.handle: Any = None
        self._lock = threading.RLock()  # behind the board's lock, where both are needed
        self._error = new_error()
        self._config = new_config(board, rate, **options)
        self._ports = [signal.PortData(p) for p in self._running_ports()]
        self._collect()
        self._axes: list[tuple[Axis, tuple[str, str, str | None, str]]] = []
        self._controls = Controls()
        self._ring: RecordRing | None = None
        self._events: deque[Event] = deque(maxlen=EVENTS_KEPT)
        self._started = False
        self._restarter: Restarter | None = None
        self.restart_problems: list[str] = []
        """Why ports that were given up could not be started anew, in sentences, oldest first."""
        self._pid = os.getpid()

    # -- what it is made of

    def _running_ports(self) -> list[Any]:
        if "sserial" not in self.board._parts:
            return []
        return [port for port in self.board.sserial if port.mode == "normal" and port.started]

    def _collect(self) -> None:
        stepgen_inputs, stepgen_outputs = signal.stepgen_signals(self.board)
        self._input_signals = signal.encoder_signals(self.board) + stepgen_inputs
        self._output_signals = list(stepgen_outputs)
        for port in self._ports:
            self._input_signals += port.inputs
            self._output_signals += port.outputs
        self._input_signals += signal.gpio_signals(self.board)
        self._name()

    def _name(self) -> None:
        """Vectors for the signals there are now."""
        self._input_names = Names(each.name for each in self._input_signals)
        outputs = Names(each.name for each in self._output_signals)
        self.outputs = Commands(outputs, np.zeros(len(outputs)))
        """What write() sends, by name; `outputs.array` is all of it."""
        self._mirrors_in = signal.c_signals(self._input_signals, mirrors=True)
        self._mirrors_out = signal.c_signals(self._output_signals, mirrors=True)
        self._mirrored = np.zeros(len(outputs))
        lib.hm2_signals_load(self._mirrors_out, len(outputs), _doubles(self._mirrored))
        has_mirror = np.array([each.mirror is not None for each in self._output_signals], bool)
        self.outputs.array[has_mirror] = self._mirrored[has_mirror]
        self._has_mirror = has_mirror

    @property
    def input_names(self) -> list[str]:
        """Names of all inputs, in the order of the vectors."""
        return list(self._input_names)

    @property
    def signals(self) -> tuple[list[Signal], list[Signal]]:
        """Inputs and outputs with their units, in the order of the vectors."""
        return list(self._input_signals), list(self._output_signals)

    def add_input(self, added: Signal) -> None:
        """One more input: a number in memory that a part of the board's cycle reads into. Before start()."""
        self._before_start()
        if added.name in self.input_names:
            raise ValueError(f"there is an input {added.name!r} already")
        self._input_signals.append(added)
        self._name()

    def add_command(self, name: str) -> None:
        """A number among the outputs that goes to controllers only. Before start()."""
        self._before_start()
        if name in list(self.outputs):
            raise ValueError(f"there is an output {name!r} already")
        self._output_signals.append(Signal(name, hold=True))
        self._name()

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
        self._controls.add(function, context)

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
        command comes with its velocity. settings: see axis.SETTINGS. Raises KeyError for the names.
        """
        self._before_start()
        feedback_name = self.input_names[self._input_names[feedback]]
        if feedback_velocity is None and feedback_name.endswith(".position"):
            beside = feedback_name.removesuffix("position") + "velocity"
            feedback_velocity = beside if beside in self._input_names else None
        if feedback_velocity is not None:
            self._input_names[feedback_velocity]
        self.outputs.index(output)
        pid = pid_of(settings)
        self.add_command(f"{name}.position")
        if velocity_command:
            self.add_command(f"{name}.velocity")
        axis = Axis(self, len(self._axes), name, velocity_command, pid)
        self._axes.append((axis, (feedback_name, output, feedback_velocity, name)))
        return axis

    def record(self, slots: int = 8192, words: int = 128) -> RecordRing:
        """A ring that gets one record per cycle, to be emptied by one reader. Before start().

        slots: a power of two; words: room for the raw register image. What finds no room is counted in
        `ring.counters`; the engine never waits. layout() tells what the image's words are. There is one ring:
        EngineError for the second who asks.
        """
        self._before_start()
        if self._ring is not None:
            raise EngineError("the engine's records go to somebody already")
        dtype = record_dtype(words, len(self._input_signals), len(self._output_signals))
        self._ring = RecordRing(dtype, slots)
        return self._ring

    def layout(self) -> list[tuple[int, bool]]:
        """Address, and whether written, of each word of the records' image. Grows in the first cycles."""
        if not self.handle:
            return []
        words: Any = ffi.new("uint32_t[]", lib.HM2_RECORD_WORDS)
        count = lib.hm2_engine_layout(self.handle, words, lib.HM2_RECORD_WORDS)
        return [(word & ~1, bool(word & 1)) for word in words[0:count]]

    def _before_start(self) -> None:
        if self.handle:
            raise EngineError("the engine has been started: make another one")

    # -- running

    @property
    def running(self) -> bool:
        """Whether it has the board: between start() and stop()."""
        return self._started

    def start(self) -> Self:
        """Arm the watchdog, take the board's cycle and begin, outputs off until write().

        Raises EngineError if another engine runs or channels were started or stopped since this one was made,
        ValueError for more signals than an engine has room for, WatchdogBite, TransportError.
        """
        with self.board.lock, self._lock:
            if self._started:
                return self
            cycle = self.board.cycle
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
            self._started = True
            _running.add(self)
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
        if not self.handle:
            self._build(self.board.cycle.handle)
            self.board.on_close(self.stop, SafeOff.SESSION)

    def _give_back(self) -> None:
        for port in self._ports:
            port.give_back()

    def _build(self, cycle: Any) -> None:
        inputs, outputs = signal.c_signals(self._input_signals), signal.c_signals(self._output_signals)
        handle = ffi.new("struct hm2_engine **")
        sizes = len(self._input_signals), len(self._output_signals)
        if max(sizes) > lib.HM2_ENGINE_SIGNALS:
            raise ValueError(
                f"{max(sizes)} inputs or outputs, an engine moves {lib.HM2_ENGINE_SIGNALS} of each"
            )
        status = lib.hm2_engine_new(
            self.board.handle, cycle, self._config, inputs, sizes[0], outputs, sizes[1], handle, self._error
        )
        check(status, self._error)
        # the engine works on all of this for as long as it lives
        self._keep = (cycle, self._ports, self._controls, self._ring, self._config)
        made, self._kept = own(handle[0], lib.hm2_engine_free)
        for port in self._ports:
            check(lib.hm2_engine_add_port(made, port.port._core.handle, self._error), self._error)
        for control in self._controls.pointers:
            check(lib.hm2_engine_add_control(made, *control, self._error), self._error)
        for axis, names in self._axes:
            self._build_axis(made, axis, *names)
        if self._ring is not None:
            words = self._ring.dtype.fields["words"][0].shape[0] if self._ring.dtype.fields else 0
            lib.hm2_engine_set_record_ring(made, self._ring.handle, words)
        self.handle = made  # whole, or start() may be tried again

    def _build_axis(
        self, made: Any, axis: Axis, feedback: str, output: str, velocity: str | None, name: str
    ) -> None:
        command_velocity = self.outputs.index(f"{name}.velocity") if axis._with_velocity else -1
        status = lib.hm2_engine_add_pid(
            made,
            axis.pid,
            self.outputs.index(f"{name}.position"),
            command_velocity,
            self._input_names[feedback],
            -1 if velocity is None else self._input_names[velocity],
            self.outputs.index(output),
            self._error,
        )
        check(status, self._error)

    def _launch(self) -> None:
        refusals: Any = ffi.new("hm2_engine_refusals *")
        check(lib.hm2_engine_start(self.handle, refusals, self._error), self._error)
        warn_of(refusals, self._config.cpu)

    def stop(self) -> None:
        """Outputs off and sent, the thread ended, the board everybody's again. Idempotent."""
        if os.getpid() != self._pid:
            return
        with self.board.lock, self._lock:
            if not self._started:
                return
            self._started = False
            if self._restarter is not None:
                self._restarter.stop()
                self._restarter = None
            try:
                lib.hm2_engine_stop(self.handle)
            finally:
                self._let_go()

    def _let_go(self) -> None:
        self._take_events()
        _running.discard(self)
        self.board.cycle.engine = None
        self._give_back()
        self.outputs.array[:] = 0.0
        self._mirrored[:] = 0.0
        if self._has_watchdog and not self.board.watchdog.has_bitten:
            self.board.watchdog.relax()

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
            array, count = self.outputs.array, len(self.outputs.array)
            theirs = self._mirrored.copy()
            lib.hm2_signals_load(self._mirrors_out, count, _doubles(theirs))
            changed = (theirs != self._mirrored) & self._has_mirror
            array[changed] = theirs[changed]
            if not np.isfinite(array).all():
                bad = [name for name, value in self.outputs.items() if not np.isfinite(value)]
                raise ValueError(f"not a number: {', '.join(bad)}")
            lib.hm2_signals_store(self._mirrors_out, count, _doubles(array))
            self._mirrored[:] = array
            lib.hm2_engine_write(self.handle, _doubles(array))

    def read(self) -> Frame:
        """The last cycle. Its inputs are then also what the board's channels show."""
        with self._lock:
            self._require()
            status: Any = ffi.new("hm2_engine_status *")
            inputs, sent = np.empty(len(self._input_signals)), np.empty(len(self._output_signals))
            lib.hm2_engine_read(self.handle, status, _doubles(inputs), _doubles(sent))
            lib.hm2_signals_store(self._mirrors_in, len(inputs), _doubles(inputs))
            for port in self._ports:
                port.show_counts()
            return Frame(
                status_of(status, len(self._ports)),
                Readings(self._input_names, inputs),
                Readings(self.outputs._names, sent),
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
        """Write the outputs, and turn them on after they went off. What still holds turns them off again."""
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
        Everything else goes on. Raises EngineError if the engine does not run or the port's exchanges fail.
        """
        return lend(self, port)

    # -- looking at it

    def now_ns(self) -> int:
        """The clock of records' and events' times: CLOCK_MONOTONIC, or the card's virtual time."""
        return self.board.now_ns() if self.board.virtual_time else time.monotonic_ns()

    @property
    def status(self) -> EngineStatus:
        """The state behind the last cycle."""
        status: Any = ffi.new("hm2_engine_status *")
        if self.handle:
            lib.hm2_engine_read(self.handle, status, ffi.NULL, ffi.NULL)
        return status_of(status, len(self._ports))

    @property
    def off(self) -> Off:
        """Why outputs are off; 0: they are on."""
        return self.status.off if self._started else Off.STOP

    def events(self) -> list[Event]:
        """What has happened since the last call, oldest first; the last EVENTS_KEPT at most."""
        with self._lock:
            self._take_events()
            taken = list(self._events)
            self._events.clear()
            return taken

    def _take_events(self) -> None:
        if not self.handle:
            return
        buffer: Any = ffi.new("hm2_engine_event[]", 64)
        while count := lib.hm2_engine_take_events(self.handle, buffer, 64):
            self._events.extend(event_of(event) for event in buffer[0:count])

    def trace(self) -> dict[str, Histogram]:
        """How long each stage of STAGES took ("wake": how late it began), "cycle": all of them, "after": what
        followed, which is the trace, the record and the publishing of the values.
        """
        result = {}
        for number, name in enumerate((*STAGES, "cycle", "after")):
            result[name] = Histogram()
            if self.handle:
                lib.hm2_engine_get_histogram(self.handle, number, result[name].core)
        return result

    def slowest(self) -> np.ndarray[Any, Any]:
        """Headers of the slowest cycles' records, slowest first; `stage_ns` is indexed as STAGES."""
        records = np.zeros(lib.HM2_ENGINE_SLOWEST, record_dtype())
        count = 0
        if self.handle:
            count = lib.hm2_engine_slowest(
                self.handle, ffi.cast("hm2_record *", records.ctypes.data), len(records)
            )
        found = records[:count]
        return found[np.argsort(-found["stage_ns"][:, len(STAGES) - 1].astype(np.int64), kind="stable")]

    def reset_trace(self) -> None:
        """Begin histograms and slowest cycles anew."""
        if self.handle:
            lib.hm2_engine_reset_trace(self.handle)

    def _require(self) -> None:
        if not self._started:
            raise EngineError("the engine is not running: start() it")

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def __repr__(self) -> str:
        state = self.status
        off = state.off.name if state.off else "on"
        return (
            f"<Engine {self.rate:g} Hz, {'running' if self._started else 'stopped'}, cycle {state.cycles}, "
            f"outputs {off if self._started else 'off'}, {state.failures} failures, "
            f"{state.overruns} overruns>"
        )


def _doubles(array: np.ndarray[Any, Any]) -> Any:
    return ffi.cast("double *", array.ctypes.data)


def _after_fork() -> None:
    """The thread and the card are the parent's."""
    for engine in list(_running):
        lib.hm2_engine_abandon(engine.handle)
        engine._started = False
    _running.clear()


os.register_at_fork(after_in_child=_after_fork)
