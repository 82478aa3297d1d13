"""What operations of a port give back: a scan, a start, an exchange."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from hostmot2.layout import table
from hostmot2.sserial.checklist import Advice, advise
from hostmot2.sserial.errors import NoRemote
from hostmot2.sserial.evidence import ChannelEvidence
from hostmot2.sserial.status import Fault

HEADER = ("channel", "name", "unit", "result", "CS", "counted", "where")


def no_remote(
    message: str, failed: Sequence[ChannelEvidence], everything: Sequence[ChannelEvidence]
) -> NoRemote:
    """The exception for channels that did not start: what they showed, and what to check in which order."""
    advice = advise(failed, everything)
    rows = table([HEADER, *(row.row() for row in failed)]).splitlines()
    error = NoRemote(message, index=failed[0].channel, evidence=(*rows, *advice.seen), causes=advice.checks)
    error.channels = tuple(failed)
    return error


class Scan(tuple[ChannelEvidence, ...]):
    """What is on each channel of a port, a row each."""

    __slots__ = ()

    @property
    def wrong(self) -> tuple[ChannelEvidence, ...]:
        """The rows of channels where a remote should have answered and cannot be used."""
        return tuple(row for row in self if row.exists and not row.usable and not row.expected_empty)

    @property
    def advice(self) -> Advice:
        """What the rows say together, and what to check where a remote should have answered."""
        advice = advise(self.wrong, self)
        empty = [row for row in self if row.expected_empty]
        said = (f"Channel {row.channel}: {row.place}, empty if nothing is plugged in." for row in empty)
        return Advice((*advice.seen, *said), advice.checks)

    def __repr__(self) -> str:
        return "\n".join([table([HEADER, *(row.row() for row in self)]), *self.advice.lines()])


@dataclass(frozen=True)
class StartResult:
    """Masks of the channels that run, of those asked for, and of those that do not.

    channels: what those asked for show, if one failed; others: the rest of the port, as last seen.
    repeated: mask of those that were started more than once, because answers got lost or damaged meanwhile.
    """

    started: int
    failed: int
    channels: tuple[ChannelEvidence, ...] = field(default=(), repr=False)
    others: tuple[ChannelEvidence, ...] = field(default=(), repr=False)
    repeated: int = 0

    @property
    def advice(self) -> Advice:
        """What to check, in order, for the channels that did not start."""
        failed = [row for row in self.channels if self.failed >> row.channel & 1]
        return advise(failed, (*self.channels, *self.others))

    def raise_for_failed(self) -> StartResult:
        """Raises NoRemote with the evidence if a channel failed, else returns this result."""
        if self.failed:
            failed = [row for row in self.channels if self.failed >> row.channel & 1]
            said = "; ".join(f"channel {row.channel}: {row.reason}" for row in failed)
            message = f"smart serial channels {self.failed:#04x} did not start ({said})"
            raise no_remote(message, failed, (*self.channels, *self.others))
        return self

    def __str__(self) -> str:
        text = f"started 0x{self.started:02X}, failed 0x{self.failed:02X}"
        if self.repeated:
            text += f", repeated 0x{self.repeated:02X}"
        if not self.failed:
            return text
        rows = table([HEADER, *(row.row() for row in self.channels)])
        return "\n".join([text, rows, *self.advice.lines()])

    def __repr__(self) -> str:
        return f"<StartResult {self}>"


@dataclass(frozen=True, slots=True)
class DoitResult:
    """failed: mask of the channels whose transfer failed, so that their inputs are not new; named ones that
    are not started belong to them. requested: the channels this speaks of. faults: what is new."""

    failed: int
    requested: int = 0
    faults: tuple[Fault, ...] = ()

    def __repr__(self) -> str:
        faults = "".join(f"; {fault}" for fault in self.faults)
        return f"<DoitResult of 0x{self.requested:02X}: failed 0x{self.failed:02X}{faults}>"
