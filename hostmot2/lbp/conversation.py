"""A conversation with one remote at the other end of a link, in which no wrong value is ever accepted.

An 8-bit CRC lets one damaged frame in 256 through where bytes were lost or added, and a command so damaged
may be obeyed at another address. So every operation is followed by a look at the remote's LBP status, which
tells of anything it misheard, and every read is repeated until two agree. What fails is repeated after a
resynchronisation, and reported if that does not help. Source: lbp_serial.md 2, 3, 5.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Self, TypeVar

from hostmot2.errors import StaleRequest
from hostmot2.lbp import frame
from hostmot2.lbp.errors import LbpError, LineSilent, RemoteRefused, WrongAnswer, status_names
from hostmot2.lbp.frame import Command
from hostmot2.lbp.link import NORMAL_S, Link
from hostmot2.registers import LbpLocal, LbpSpace, LbpStatus

T = TypeVar("T")

TRIES = 8
REFUSALS = 2
"""A refusal is believed when the remote has given it so often in a row, without any sign of noise."""

STABLE_READS = 8
MISHEARD = (
    LbpStatus.CRC_ERROR
    | LbpStatus.BUFFER
    | LbpStatus.INVALID_ADDRESS
    | LbpStatus.COMMAND_TIMEOUT
    | LbpStatus.FIFO_TIMEOUT
)
"""Bits of the LBP status that mean that a command was not obeyed; the watchdog's is no such bit."""


class Conversation:
    """What the operations of `LbpRemote` are made of. Not thread-safe; one program at a time may use a line.

    Opening probes for the cookie, with CRC and without. Raises LineSilent, NotLbp.
    """

    def __init__(self, link: Link, *, tries: int = TRIES) -> None:
        self.link = link
        self.tries = tries
        self._space: int | None = None  # what the remote's memory space is known to be
        self._sick = True  # something failed and the remote was not asked why
        self._known_name = ""
        self._away = False  # a space other than RAM may be selected
        self._held: int | None = None  # a space that is kept between accesses
        link.open()
        self._confirmed(lambda: self._once(frame.COOKIE))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Memory space back to RAM if it was not, then give the line back."""
        try:
            if self._away:
                with suppress(LbpError):  # the line is gone; a power cycle resets the space
                    self._confirmed(lambda: self._select(LbpSpace.RAM))
        finally:
            self.link.close()

    # -- one command, confirmed

    def _once(self, command: Command, timeout_s: float = NORMAL_S) -> bytes:
        try:
            return self.link.transact(command, timeout_s)
        except StaleRequest:
            self._sick = True  # the old one may have selected another memory space
            raise

    def _confirmed(self, operation: Callable[[], T]) -> T:
        """The operation's result once it went through and the remote says that it misheard nothing."""
        refusals = 0
        last: LbpError | None = None
        for _ in range(self.tries):
            try:
                if self._sick:
                    self._recover()
                result = operation()
                misheard = self._misheard()
            except (LineSilent, WrongAnswer) as failure:
                last, self._sick = failure, True
                misheard = self._ask_why()
            else:
                if not misheard:
                    return result
                self._sick = True
                last = WrongAnswer(
                    f"{self}: the remote misheard: {status_names(misheard)}", received=misheard
                )
            refusals = refusals + 1 if misheard in (LbpStatus.INVALID_ADDRESS, LbpStatus.BUFFER) else 0
            if refusals == REFUSALS:
                self.link.counters.refused += 1
                raise self._refused(misheard)
        assert last is not None
        last.add_note(f"tried {self.tries} times; {self.link.counters}")
        raise last

    def _refused(self, status: int) -> RemoteRefused:
        refused = RemoteRefused(f"{self}: refused, LBP status: {status_names(status)}", received=status)
        refused.status = LbpStatus(status)
        return refused

    def _misheard(self) -> int:
        return self._once(frame.read_local(LbpLocal.status.number))[0] & MISHEARD

    def _ask_why(self) -> int:
        """After silence the status tells whether the remote refused; 0 if it cannot be asked."""
        try:
            self.link.settle()
            return self._misheard()
        except (LineSilent, WrongAnswer):
            return 0

    def _recover(self) -> None:
        """Both ends start anew: frames forgotten, errors cleared, memory space RAM."""
        self._space = None
        self.link.resync()
        self._once(frame.write_local(LbpLocal.status.number, 0))
        if self._misheard():
            raise WrongAnswer(f"{self}: the LBP status cannot be cleared")
        self._select(LbpSpace.RAM)
        self._sick = False

    def _select(self, space: int) -> None:
        if self._space != space:
            self._space = None
            self._away |= space != LbpSpace.RAM
            self._once(frame.write_local(LbpLocal.memory_space.number, space))
            self._space = space
            self._away &= space != LbpSpace.RAM

    def _stable(self, operation: Callable[[], bytes]) -> bytes:
        """A value that was read twice alike. One that keeps changing passes only on a faultless line."""
        errors_before = self.link.counters.errors
        before = self._confirmed(operation)
        for _ in range(STABLE_READS):
            now = self._confirmed(operation)
            if now == before:
                return now
            before = now
        if self.link.counters.errors == errors_before:
            return before
        raise WrongAnswer(f"{self}: no two of {STABLE_READS} reads agree, and the line shows errors")

    # -- memory spaces

    @contextmanager
    def memory_space(self, space: int) -> Iterator[None]:
        """Inside, data accesses to this space do not go back to RAM in between; at the end they do."""
        with self._back_to_ram():
            before, self._held = self._held, space
            try:
                yield
            finally:
                self._held = before

    @contextmanager
    def _back_to_ram(self) -> Iterator[None]:
        """Data accesses mean RAM again afterwards, whatever happened; not while a space is held."""
        try:
            yield
        except BaseException:
            if self._away:
                with suppress(LbpError):  # a dead line: close() tries again
                    self._confirmed(lambda: self._select(LbpSpace.RAM))
            raise
        if self._space not in (LbpSpace.RAM, self._held):
            self._confirmed(lambda: self._select(LbpSpace.RAM))

    def __str__(self) -> str:
        return f"{self._known_name} at {self.link.url}" if self._known_name else self.link.url
