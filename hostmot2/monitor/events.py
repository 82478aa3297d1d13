"""What has happened, as a list to be shown."""

from __future__ import annotations

import time
from collections import deque

from hostmot2.engine import Event, EventKind, Off
from hostmot2.errors import WatchdogBite
from hostmot2.monitor.snapshot import EventRow, Problem
from hostmot2.sserial import ChannelStatus

KEPT = 500


_OFF = {
    Off.IDLE: "not armed yet",
    Off.USER: "turned off",
    Off.DEAD_MAN: "the view has not said that it is alive",
    Off.STALE: "too many exchanges failed",
    Off.OVERRUN: "too many cycles were late",
    Off.BITE: "the watchdog has bitten",
    Off.PORT: "a smart-serial port was given up",
    Off.FAULT: "a remote reports a fault",
    Off.ERROR: "an axis left its path",
    Off.CONTROL: "a controller's output is not a number",
    Off.STOP: "the engine has stopped",
}


def off_words(off: Off) -> list[str]:
    """Why outputs are off, in words."""
    return [words for reason, words in _OFF.items() if off & reason]


class EventLog:
    """The last events, the latest first."""

    def __init__(self) -> None:
        self._rows: deque[EventRow] = deque(maxlen=KEPT)

    @property
    def rows(self) -> tuple[EventRow, ...]:
        """All that are kept."""
        return tuple(self._rows)

    def add(self, event: Event, now_ns: int, problem: Problem | None) -> EventRow:
        """One of an engine's events; now_ns is on the same clock. problem: why exchanges fail, if they do."""
        at = time.time() - (now_ns - event.time_ns) / 1e9
        clock = time.strftime("%H:%M:%S", time.localtime(at)) + f".{int(at * 1000) % 1000:03d}"
        row = EventRow(clock, _text(event, problem), _explain(event, problem))
        if event.kind is not EventKind.OVERRUN:  # on a busy computer there are many; they are counted anyway
            self._rows.appendleft(row)
        return row


def _text(event: Event, problem: Problem | None) -> str:
    if event.kind is EventKind.PORT_FAULT:
        status, new = ChannelStatus(event.words[0]), ChannelStatus(event.words[1])
        what = ", ".join((*new.live, *new.sticky)) or "transfer failed"
        failed = ", no new inputs" if event.status else ""
        return f"{event.index // 8}.{event.index % 8} {what}{failed} (CS 0x{status.word:08X})"
    if event.kind is EventKind.OFF:
        return f"outputs off: {', '.join(off_words(Off(event.value)))}"
    text = str(event).partition(": ")[2]
    return f"{text}: {problem.text}" if event.kind is EventKind.FAILED and problem else text


def _explain(event: Event, problem: Problem | None) -> str:
    if event.kind is EventKind.PORT_FAULT:
        return f"CS=0x{event.words[0]:08X}"
    if event.kind is EventKind.OFF and event.value == Off.BITE:
        return WatchdogBite.code
    if event.kind is EventKind.FAILED and problem:
        return problem.explain
    return ""
