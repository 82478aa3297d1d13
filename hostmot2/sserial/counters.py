"""What the firmware counts for each channel, from its local memory. Source: sserial.md 2.7.

The counters start from 0 at each stop and stay at 20; the event after that sets TooManyErrors. Each CRC
error and each break is followed by a timeout that is counted, too (SSLBP observed 2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hostmot2.registers import SslbpChannel, SslbpLimit

LIMIT = int(SslbpLimit.ERRORS)
"""Where a counter stays."""

_FIRST = SslbpChannel.crc_errors.number
_COUNTERS = 7  # crc_errors .. remote_faults are neighbours
_TICK_US = 2.0


@dataclass(frozen=True, slots=True)
class ChannelCounters:
    """Errors of one channel since its last stop, 0..20 each.

    remote_faults counts during the start only. receive_size (with the fault byte) and transmit_size are
    bytes of a process data exchange, exchange_us what it took in the start; 0 before one.
    """

    channel: int
    crc_errors: int
    cookie_errors: int
    overruns: int
    timeouts: int
    extra_characters: int
    serial_breaks: int
    remote_faults: int
    receive_size: int
    transmit_size: int
    exchange_us: float

    @property
    def total(self) -> int:
        """All errors."""
        return (
            self.crc_errors
            + self.cookie_errors
            + self.overruns
            + self.timeouts
            + self.extra_characters
            + self.serial_breaks
            + self.remote_faults
        )

    def __str__(self) -> str:
        names = ("crc_errors", "cookie_errors", "overruns", "timeouts", "extra_characters", "serial_breaks")
        counted = [(name.replace("_", " "), getattr(self, name)) for name in (*names, "remote_faults")]
        words = [f"{count} {name}" for name, count in counted if count]
        return ", ".join(words) or "no errors"


def read_counters(read_local: Callable[[int, int], bytes], channel: int, block: int) -> ChannelCounters:
    """The counters of a channel. read_local(address, count) gives bytes; block: address of its block."""
    crc, cookie, overruns, timeouts, extra, breaks, faults = read_local(block + _FIRST, _COUNTERS)
    receive_size, transmit_size, ticks = read_local(block + SslbpChannel.receive_size.number, 3)
    return ChannelCounters(
        channel,
        crc,
        cookie,
        overruns,
        timeouts,
        extra,
        breaks,
        faults,
        receive_size,
        transmit_size,
        ticks * _TICK_US,
    )
