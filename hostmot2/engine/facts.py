"""What an engine tells: why outputs are off, events, counters."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Any

from hostmot2._core import lib


class Off(IntFlag):
    """Why outputs are off. 0: they are on."""

    IDLE = lib.HM2_OFF_IDLE
    """Nobody has written outputs yet."""
    USER = lib.HM2_OFF_USER
    """disable() was called."""
    DEAD_MAN = lib.HM2_OFF_DEAD_MAN
    """Outputs were not refreshed in time."""
    STALE = lib.HM2_OFF_STALE
    """Too many exchanges in a row failed, or brought no new result of a port."""
    OVERRUN = lib.HM2_OFF_OVERRUN
    """Too many cycles in a row took too long."""
    BITE = lib.HM2_OFF_BITE
    """The card's watchdog has bitten."""
    PORT = lib.HM2_OFF_PORT
    """A smart-serial port was given up."""
    FAULT = lib.HM2_OFF_FAULT
    """A remote has reported a new fault, or its watchdog has bitten: such a remote must be started anew."""
    ERROR = lib.HM2_OFF_ERROR
    """An axis has exceeded its following error."""
    CONTROL = lib.HM2_OFF_CONTROL
    """A controller's output was not a number."""
    STOP = lib.HM2_OFF_STOP
    """The engine stops, or does not run."""


class EventKind(IntEnum):
    """What happened."""

    ON = lib.HM2_EVENT_ON
    OFF = lib.HM2_EVENT_OFF
    OVERRUN = lib.HM2_EVENT_OVERRUN
    FAILED = lib.HM2_EVENT_FAILED
    RECOVERED = lib.HM2_EVENT_RECOVERED
    PORT_FAULT = lib.HM2_EVENT_PORT_FAULT
    PORT_GIVEN_UP = lib.HM2_EVENT_PORT_GIVEN_UP
    PORT_BACK = lib.HM2_EVENT_PORT_BACK
    AXIS = lib.HM2_EVENT_AXIS
    CONTROL = lib.HM2_EVENT_CONTROL


_GIVEN_UP = {
    lib.HM2_GIVEN_UP_DOIT_HUNG: "its DOIT never ended",
    lib.HM2_GIVEN_UP_CHANNELS_STOPPED: "its channels were stopped",
}


@dataclass(frozen=True, slots=True)
class Event:
    """time_ns is on the board's clock; index, status, value and words mean what hm2.h says of the kind."""

    time_ns: int
    cycle: int
    kind: EventKind
    index: int
    status: int
    value: int
    words: tuple[int, ...]

    def __str__(self) -> str:
        what = {
            EventKind.ON: "outputs on",
            EventKind.OFF: f"outputs off: {Off(self.value).name if self.kind == EventKind.OFF else ''}",
            EventKind.OVERRUN: f"overrun, {self.value} periods",
            EventKind.FAILED: f"exchange failed (status {self.status})",
            EventKind.RECOVERED: f"exchanges good again after {self.value} failed",
            EventKind.PORT_FAULT: (
                f"port {self.index // 8} channel {self.index % 8}: CS 0x{self.words[0]:08X}, "
                f"new 0x{self.words[1]:08X}{', transfer failed' if self.status else ''}"
            ),
            EventKind.PORT_GIVEN_UP: (
                f"port {self.index} given up: " + _GIVEN_UP.get(self.value, f"fault level {self.value}")
            ),
            EventKind.PORT_BACK: f"port {self.index} is back",
            EventKind.AXIS: f"axis {self.index}: following error exceeded",
            EventKind.CONTROL: f"output {self.index} is not a number",
        }[self.kind]
        return f"cycle {self.cycle}: {what}"


@dataclass(frozen=True, slots=True)
class EngineStatus:
    """The state behind one cycle. Counters run since the engine was made."""

    cycles: int
    start_ns: int
    outputs_number: int
    failures: int
    overruns: int
    skipped: int
    events_lost: int
    outputs_age_ns: int
    off: Off
    status: int
    stale: int
    running: bool
    port_levels: tuple[int, ...]
    """Fault buckets of the ports."""
    ports_given_up: tuple[bool, ...]
    ports_stale: tuple[int, ...]
    """Results of the ports, in a row, that were lost, or might have been old ones and were not taken."""


def event_of(event: Any) -> Event:
    """From the C struct."""
    return Event(
        event.time_ns,
        event.cycle,
        EventKind(event.kind),
        event.index,
        event.status,
        event.value,
        tuple(event.words),
    )


def status_of(status: Any, ports: int) -> EngineStatus:
    """From the C struct."""
    return EngineStatus(
        status.cycles,
        status.start_ns,
        status.outputs,
        status.failures,
        status.overruns,
        status.skipped,
        status.events_lost,
        status.outputs_age_ns,
        Off(status.off),
        status.status,
        status.stale,
        bool(status.running),
        tuple(status.port_level)[:ports],
        tuple(bool(state) for state in status.port_state)[:ports],
        tuple(status.port_stale)[:ports],
    )
