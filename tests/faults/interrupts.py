"""python -m tests.faults.interrupts [--count 10000] [--seed N] [-o FILE]

Ctrl-C at random moments of a program's life with a card: opening, looking for remotes, starting, exchanging,
an engine, closing. Afterwards the board can be closed, nothing is driven, nobody hangs.
"""

from __future__ import annotations

import faulthandler
import random
import signal
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

TESTS = str(Path(__file__).resolve().parent.parent)
if TESTS not in sys.path:
    sys.path.insert(0, TESTS)

from faults import command  # noqa: E402
from faults.checks import off_when_closed  # noqa: E402
from faults.operations import Wrong  # noqa: E402
from faults.world import World  # noqa: E402

HANG_S = 60
"""A run that takes longer hangs: where is printed, and the process ends."""


@dataclass
class Interrupts:
    """What came of them."""

    count: int = 0
    interrupted: int = 0
    """Runs that the interrupt ended; in the others it came too late."""
    places: Counter[str] = field(default_factory=Counter)
    """What was being done."""
    wrong: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        where = ", ".join(f"{name} {count}" for name, count in self.places.most_common())
        return f"{self.count} runs, {self.interrupted} interrupted ({where}), {len(self.wrong)} wrong"


PHASES = ("opening", "looking for remotes", "starting", "exchanging", "engine", "closing")


class Program:
    """The user's program. `reached` is told which phase begins."""

    def __init__(self, world: World, reached: Callable[[str], None]) -> None:
        self.world = world
        self.reached = reached

    def run(self) -> None:
        """From open to close, as a with block does it."""
        world = self.world
        self.reached("opening")
        with world.open() as board:
            self.reached("looking for remotes")
            world.port.scan()
            self.reached("starting")
            card = world.seven
            card.start()
            self.reached("exchanging")
            card.analog[0].volts = 2.0
            card.analog_enable = True
            card.field_io_channel.outputs["output"] = 0xFFFF
            for _ in range(20):
                card.exchange()
            self.reached("engine")
            with board.engine(1000.0) as engine:
                for _ in range(20):
                    engine.outputs["analogout0"] = 1.0
                    engine.write()
                    engine.step()
            self.reached("closing")


def _interrupt(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt


def measure() -> dict[str, float]:
    """How long each phase lasts undisturbed."""
    lasts: dict[str, list[float]] = {phase: [] for phase in PHASES}
    for _ in range(9):
        moments: list[float] = []
        Program(World(), lambda _phase, moments=moments: moments.append(time.perf_counter())).run()
        moments.append(time.perf_counter())
        for phase, first, last in zip(PHASES, moments[:-1], moments[1:], strict=True):
            lasts[phase].append(last - first)
    return {phase: sorted(times)[4] for phase, times in lasts.items()}


def once(phase: str, moment_s: float, result: Interrupts) -> None:
    """One program, and an interrupt so long after a phase has begun."""
    world = World()
    doing = [""]

    def reached(begins: str) -> None:
        doing[0] = begins
        if begins == phase:
            signal.setitimer(signal.ITIMER_REAL, max(1e-6, moment_s))

    program = Program(world, reached)
    result.count += 1
    try:
        try:
            program.run()
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
    except KeyboardInterrupt:
        result.interrupted += 1
        result.places[doing[0]] += 1
    _look(world, doing[0], result)


def _look(world: World, doing: str, result: Interrupts) -> None:
    """What the interpreter's exit would do, and what must be so then."""
    board = world.board
    try:
        if board is not None and not board.closed:
            board.close()
        world.board = None
        world.card.advance(1.0)  # the watchdog lets go of pins within a few clocks
        off_when_closed(world)
        world.settle()
        world.open()
        world.port.scan()
        world.close()
    except (Exception, Wrong) as error:
        result.wrong.append(f"interrupted while {doing}: {type(error).__name__}: {error}")
    finally:
        world.board = None


def interrupt(count: int, seed: int) -> Interrupts:
    """Programs until so many have been interrupted."""
    draw = random.Random(seed)
    result = Interrupts()
    before = signal.signal(signal.SIGALRM, _interrupt)
    lasts = measure()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # interrupted before anybody could know the board
        while result.interrupted < count and result.count < 10 * count:
            phase = PHASES[result.count % len(PHASES)]
            faulthandler.dump_traceback_later(HANG_S, exit=True)
            once(phase, draw.random() * lasts[phase], result)
    faulthandler.cancel_dump_traceback_later()
    signal.signal(signal.SIGALRM, before)
    return result


def main() -> int:
    """Runs them and prints what came of it."""
    arguments = command.draws(__doc__, 10_000).parse_args()
    return command.tell(interrupt(arguments.count, arguments.seed), arguments.output)


if __name__ == "__main__":
    sys.exit(main())
