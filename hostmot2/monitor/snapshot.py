"""A card at one moment, as plain data: what a view draws, made without one."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from hostmot2.sserial import ChannelCounters, ChannelStatus


@dataclass(frozen=True, slots=True)
class ChannelRow:
    """A smart-serial channel. counters: None if they cannot be had; failed: transfers without new inputs.

    cut_off: the watchdog's bite has taken the pins away, nothing is exchanged any more.
    """

    port: int
    channel: int
    name: str
    unit_number: int
    mode: str
    status: ChannelStatus
    started: bool
    counters: ChannelCounters | None = None
    failed: int = 0
    cut_off: bool = False

    @property
    def label(self) -> str:
        """Port and channel, "0.1"."""
        return f"{self.port}.{self.channel}"

    @property
    def idle(self) -> bool:
        """Nobody has started it: what its CS says is of no interest."""
        return not self.started and self.status.state == "stopped"

    @property
    def faults(self) -> tuple[str, ...]:
        """What is wrong now, in words."""
        return () if self.idle else self.status.live

    @property
    def past(self) -> tuple[str, ...]:
        """What has been wrong since the channel was started, in words."""
        return () if self.idle else self.status.sticky


@dataclass(frozen=True, slots=True)
class EncoderRow:
    """An encoder: counts as the hardware has them, position and velocity in its units."""

    name: str
    count: int
    position: float
    velocity: float


@dataclass(frozen=True, slots=True)
class ValueRow:
    """A number of a remote. low and high: its limits, equal if there are none."""

    name: str
    value: float
    unit: str
    low: float
    high: float
    is_output: bool
    signal: str = ""
    """Its name among the engine's outputs."""

    @property
    def fraction(self) -> float | None:
        """Where the value is between its limits, 0 to 1; None without limits."""
        if not self.low < self.high or not abs(self.high - self.low) < 1e12:
            return None
        return min(max((self.value - self.low) / (self.high - self.low), 0.0), 1.0)


@dataclass(frozen=True, slots=True)
class BitsRow:
    """A word of bits, bit 0 first."""

    name: str
    value: int
    width: int
    is_output: bool
    signal: str = ""

    @property
    def bits(self) -> tuple[bool, ...]:
        """All of them."""
        return tuple(bool(self.value >> n & 1) for n in range(self.width))


@dataclass(frozen=True, slots=True)
class EventRow:
    """Something that happened. explain: what `hm2 explain` takes for more, "" for nothing."""

    at: str
    text: str
    explain: str = ""


@dataclass(frozen=True, slots=True)
class LatencyView:
    """How long things took, microseconds; None before the first cycle.

    reply: from a request to the card's answer. cycle: from when a cycle was due to its end. history: the 99th
    percentile of the cycles of each half second.
    """

    reply_p99: float | None = None
    cycle_p99: float | None = None
    cycle_max: float | None = None
    history: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class RecordingView:
    """The recording that runs."""

    path: Path
    seconds: float
    records: int
    dropped: int


@dataclass(frozen=True, slots=True)
class Problem:
    """Why there are no new readings. explain: the error's code."""

    text: str
    explain: str


@dataclass(frozen=True)
class Snapshot:
    """Everything at one moment.

    access: "read-only" (nothing is ever written), "outputs off" or "ARMED". off: why outputs are off.
    lost: exchanges of `cycles` that did not come back. hints: what would show more.
    """

    card: str
    url: str
    access: str
    rate: float
    off: str = ""
    cycles: int = 0
    lost: int = 0
    overruns: int = 0
    watchdog: str = "none"
    latency: LatencyView = field(default_factory=LatencyView)
    channels: tuple[ChannelRow, ...] = ()
    encoders: tuple[EncoderRow, ...] = ()
    values: tuple[ValueRow, ...] = ()
    bits: tuple[BitsRow, ...] = ()
    events: tuple[EventRow, ...] = ()
    hints: tuple[str, ...] = ()
    recording: RecordingView | None = None
    problem: Problem | None = None
