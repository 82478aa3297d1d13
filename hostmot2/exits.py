"""Outputs off on every way out of the process that the process gets to see.

Interpreter exit (end of script, sys.exit, uncaught exception, Ctrl-C) closes the boards still open. So do
SIGTERM and SIGHUP, where nobody else handles them. What cannot be seen (SIGKILL, a crash, power) is the
watchdog's business. A forked child has nothing to turn off: the card is its parent's, and closed to it.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import weakref
from types import FrameType
from typing import Protocol


class Closable(Protocol):
    """What can be closed, any number of times."""

    def close(self) -> None:
        """Make safe and let go."""

    def disown(self) -> None:
        """Let go without touching the card."""


SIGNALS = (signal.SIGTERM, signal.SIGHUP)
_open: weakref.WeakSet[Closable] = weakref.WeakSet()
_told: set[int] = set()
"""Signals that came and are ignored since, so that the program ends undisturbed."""


def close_at_exit(board: Closable) -> None:
    """Close `board` on every way out, unless it is closed before."""
    _open.add(board)
    _watch_signals()


def forget(board: Closable) -> None:
    """The board has been closed."""
    _open.discard(board)


@atexit.register
def close_all() -> None:
    """Close every board; all are tried, the first failure is raised."""
    failed: BaseException | None = None
    for board in list(_open):
        try:
            board.close()
        except BaseException as error:
            failed = failed or error
    if failed is not None:
        raise failed


def _after_fork() -> None:
    for board in list(_open):
        board.disown()


os.register_at_fork(after_in_child=_after_fork)


def _watch_signals() -> None:
    """Take over the signals that would end the process unseen; a handler somebody has set stays.

    A program that caught the SystemExit of a signal and opens a board again hears the next one, too.
    Python runs handlers, and lets them be set, in the main thread only.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    for number in SIGNALS:
        handler = signal.getsignal(number)
        if handler is signal.SIG_DFL or (handler is signal.SIG_IGN and number in _told):
            signal.signal(number, _end)
        _told.discard(number)


def _end(number: int, frame: FrameType | None) -> None:
    """Outputs off now, before other threads are waited for; then the exit status a shell would show."""
    _told.add(number)
    signal.signal(number, signal.SIG_IGN)  # a second one must not stop us halfway
    try:
        close_all()
    finally:
        _end_even_if_dropped(number)
        sys.exit(128 + number)


def _end_even_if_dropped(number: int) -> None:
    """The interpreter drops every exception inside a finalizer, SystemExit too: then the signal has its way.

    Else the program would go on, deaf to the signal, with boards that are closed.
    """
    before = sys.unraisablehook

    def dropped(unraisable: sys.UnraisableHookArgs) -> None:
        if unraisable.exc_type is SystemExit:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        before(unraisable)

    sys.unraisablehook = dropped
