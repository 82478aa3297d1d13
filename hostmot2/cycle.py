"""One exchange with the card for everything that takes part: encoders, watchdog, I/O, SSERIAL."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import IntEnum
from typing import TYPE_CHECKING, Any

from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.handles import own
from hostmot2.registers import Gtag

if TYPE_CHECKING:
    from hostmot2.board import Board


class Order(IntEnum):
    """The order in which participants read and write within an exchange; all reads come first.

    The DPLL's phase is sampled near the start, DOIT is the last write, when all outputs are in place.
    """

    DPLL = 0
    WATCHDOG = 10
    IOPORT = 20
    ENCODERS = 30
    GENERATORS = 40
    OTHERS = 50
    SSERIAL = 60


class Cycle:
    """The board's cyclic exchange.

    Parts of the board join when they are first used. `run` reads everything, writes everything and takes
    the readings in, in one exchange: what is read shows what earlier cycles wrote.

    Thread-safety: run, read and write hold the board's lock.
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._parts: list[tuple[int, int, Any, Any]] = []
        self._after: list[Callable[[], None]] = []
        self._error = errors.new_error()
        self._handle: Any = None
        self.watched = False
        """Whether the board's watchdog is in use."""
        self.engine: object = None
        """The cycle engine that has the cycle; while it has, nobody else may exchange through it."""
        self.automatic_watchdog = not board.read_only
        """Whether the watchdog is armed by the first exchange that writes; set to False only knowingly."""

    def arm_watchdog(self) -> None:
        """Arm the card's watchdog if it has one and `automatic_watchdog` is set. Raises WatchdogBite."""
        if self.automatic_watchdog and any(m.gtag == Gtag.WATCHDOG for m in self._board.modules):
            self._board.watchdog.arm()

    def raise_for_bite(self) -> None:
        """Raise WatchdogBite if the armed watchdog has bitten, seen or not; else it is fed."""
        if self.watched:
            self._board.watchdog.confirm()

    def add(self, part: Any, keep: Any, order: Order) -> None:
        """Add a participant: `part` is a hm2_cyclic, `keep` whatever must live as long as the cycle.

        Raises EngineError while an engine has the cycle: it would not take the part along.
        """
        with self._board.lock:
            if self.engine is not None:
                raise errors.EngineError(
                    f"{self._board.name}: a part of the board is used for the first time, while the cycle "
                    "belongs to a running engine: use it before an engine is made"
                )
            self._parts.append((order, len(self._parts), part, keep))
            self._handle = None

    def after(self, action: Callable[[], None]) -> None:
        """Call `action` after each exchange; it may raise."""
        self._after.append(action)

    @property
    def handle(self) -> Any:
        """The `struct hm2_cycle *` with all participants of now."""
        if self._handle is None:
            handle: Any = ffi.new("struct hm2_cycle **")
            errors.check(lib.hm2_cycle_new(self._board.handle, handle, self._error), self._error)
            built, self._kept = own(handle[0], lib.hm2_cycle_free)
            for _, _, part, _ in sorted(self._parts, key=lambda entry: entry[:2]):
                errors.check(lib.hm2_cycle_add(built, part, self._error), self._error)
            self._handle = built
        return self._handle

    @property
    def counters(self) -> dict[str, int]:
        """`cycles` that came back whole and `failures` that did not, since a part last joined."""
        counters: Any = ffi.new("hm2_cycle_counters *")
        lib.hm2_cycle_get_counters(self.handle, counters)
        return {"cycles": counters.cycles, "failures": counters.failures}

    def __call__(
        self, rate: float = 1000.0, *, seconds: float | None = None, **options: Any
    ) -> Iterator[Any]:
        """`for frame in hm2.cycle(rate=1000)`: a loop in Python on an engine that runs as long as the loop.

        rate: cycles per second. seconds: the loop ends after so long; None: never. Other options are those of
        `hostmot2.engine.Engine`. Each frame holds the readings of one cycle; outputs that the body sets, on
        cards or in `frame.outputs`, go out with the next one. Leaving the loop by any way turns outputs off.
        """
        frames: Iterator[Any] = self._board.engine.loop(rate, seconds=seconds, **options)
        return frames

    def run(self) -> None:
        """Read, write and process: one exchange.

        Raises a TransportError when the exchange fails (values stay those of the last good one), and
        WatchdogBite while a bite has not been acknowledged.
        """
        self.arm_watchdog()
        self._do(lib.hm2_cycle_run)

    def read(self) -> None:
        """Read and process only. Errors as for run()."""
        self._do(lib.hm2_cycle_read)

    def write(self) -> None:
        """Write only. Errors as for run(); a bite is seen by what reads, so do not only write."""
        self.arm_watchdog()
        self._do(lib.hm2_cycle_write)

    def _do(self, operation: Callable[[Any, Any], int]) -> None:
        if self.engine is not None:
            raise errors.EngineError(f"{self._board.name}: the cycle belongs to a running engine")
        with self._board.lock:
            status = operation(self.handle, self._error)
            if status:
                errors.check(status, self._error)
            for action in self._after:
                action()
