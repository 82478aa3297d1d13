"""python -m tests.faults.forks [--count 10000] [--seconds S] [--seed N] [-o FILE]

A program with a card forks at random moments of its life, in virtual time. The child closes the board, tries
to write to the card, ends as the interpreter does, or leaves the program's blocks; none of it reaches the
card. The parent goes on as if nothing had been.
"""

from __future__ import annotations

import faulthandler
import gc
import os
import random
import signal
import sys
import time
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

TESTS = str(Path(__file__).resolve().parent.parent)
if TESTS not in sys.path:
    sys.path.insert(0, TESTS)

from faults import command  # noqa: E402
from faults.checks import off_when_closed  # noqa: E402
from faults.interrupts import HANG_S, PHASES, Program, measure  # noqa: E402
from faults.operations import Wrong  # noqa: E402
from faults.world import World  # noqa: E402
from hostmot2 import exits  # noqa: E402
from hostmot2.errors import TransportClosed  # noqa: E402

EACH = 4
"""Forks of one program."""
WAYS = ("close", "write", "exit", "leave the blocks")
CHILD_S = 30


class _Left(BaseException):
    """In the child: on the way out of all blocks."""


@dataclass
class Forks:
    """What came of them."""

    programs: int = 0
    forked: int = 0
    places: Counter[str] = field(default_factory=Counter)
    """What was being done."""
    wrong: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        where = ", ".join(f"{name} {count}" for name, count in self.places.most_common())
        return f"{self.programs} programs, {self.forked} forks ({where}), {len(self.wrong)} wrong"


class _Life:
    """One program with its forks."""

    def __init__(self, phase: str, lasts_s: float, draw: random.Random, result: Forks) -> None:
        self.world = World()
        self._phase, self._lasts_s, self._draw, self._result = phase, lasts_s, draw, result
        self._doing = ""
        self._left = EACH
        self._children: list[tuple[int, str]] = []
        self._steps = -1
        """In the child: accesses to the card until the fork."""

    def reached(self, phase: str) -> None:
        self._doing = phase
        if phase == self._phase:
            self._arm()
        if self._draw.random() < 0.2:
            self._fork("leave the blocks")

    def _arm(self) -> None:
        signal.setitimer(signal.ITIMER_REAL, max(1e-6, self._draw.random() * self._lasts_s * 2 / EACH))

    def on_alarm(self, _number: int, _frame: object) -> None:
        self._fork(self._draw.choice(WAYS[:3]))
        self._left -= 1
        if self._left > 0:
            self._arm()

    def _fork(self, way: str) -> None:
        child = os.fork()
        if child:
            self._children.append((child, f"{way} while {self._doing}"))
            self._result.places[self._doing] += 1
            return
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(CHILD_S)  # ends one that waits for ever
        self._steps = self.world.faults.steps
        if way == "leave the blocks":
            raise _Left
        self._end(way)

    def _end(self, way: str) -> NoReturn:
        board, status = self.world.board, 0
        try:
            if way == "close" and board is not None:
                board.close()
            if way == "write" and board is not None:
                status = _refused(board)
            exits.close_all()
            self.world.board = board = None
            gc.collect()
        except BaseException:
            status = 2
        os._exit(status or (3 if self.world.faults.steps != self._steps else 0))

    def run(self) -> None:
        """The program to its end, then its children's."""
        before = signal.signal(signal.SIGALRM, self.on_alarm)
        try:
            Program(self.world, self.reached).run()
        except _Left:
            self._end("leave the blocks")
        finally:
            self._left = 0  # one that comes just now arms no other
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)
            if self._steps >= 0:  # the child, by whatever exception
                os._exit(4)
        self.world.board = None
        off_when_closed(self.world)
        self._result.forked += len(self._children)
        for child, what in self._children:
            status = os.waitpid(child, 0)[1]
            if status:
                self._result.wrong.append(f"{what}: the child ended with {os.waitstatus_to_exitcode(status)}")


def _refused(board: Any) -> int:
    """0 if a write is refused as it has to be."""
    try:
        board.write(0x1100, 0)
    except TransportClosed:
        return 0
    return 1


def fork(count: int, seed: int, seconds: float) -> Forks:
    """Programs until there were so many forks, or so much time is over."""
    end = time.monotonic() + seconds
    draw = random.Random(seed)
    result = Forks()
    lasts = measure()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        while time.monotonic() < end and result.forked < count and len(result.wrong) < 100:
            phase = PHASES[result.programs % len(PHASES)]
            result.programs += 1
            faulthandler.dump_traceback_later(HANG_S + CHILD_S * EACH, exit=True)
            try:
                _Life(phase, lasts[phase], draw, result).run()
            except (Exception, Wrong) as error:
                result.wrong.append(f"the parent, forking while {phase}: {type(error).__name__}: {error}")
    faulthandler.cancel_dump_traceback_later()
    return result


def main() -> int:
    """Runs them and prints what came of it."""
    arguments = command.draws(__doc__, 10_000, timed=True).parse_args()
    result = fork(arguments.count, arguments.seed, arguments.seconds)
    return command.tell(result, arguments.output, count=arguments.count)


if __name__ == "__main__":
    sys.exit(main())
