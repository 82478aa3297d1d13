"""What start and scan found on each channel, and what to check where nothing answered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from hostmot2.fields import Field, FieldKind
from hostmot2.layout import table
from hostmot2.registers import LocalFault, RemoteFault
from hostmot2.remotes.discovery import RemoteDescription
from hostmot2.sserial.counters import ChannelCounters
from hostmot2.sserial.errors import NoRemote
from hostmot2.sserial.status import ChannelStatus, Fault

CHECKLIST = """\
Check in this order:
  1. the remote's power: field power and logic supply (a 7I77's field I/O needs VIN and VFIELD);
  2. 5 V to the remote: cable power jumpers on the FPGA card and on the remote (7I77: W5, W6);
  3. the cable: both ends wired to the same standard (T568B), none of the pairs swapped;
  4. RX and TX pairs not exchanged, polarity of each pair;
  5. the remote's mode: process data (2.5 Mbaud), not its setup jumper (115200 baud);
  6. the bitfile: that it has this channel on the pins where the remote is wired."""


@dataclass(frozen=True, slots=True)
class Identity:
    """What a remote answered at the last start; name "" if it did not."""

    unit_number: int
    name: str
    toc: int
    status: ChannelStatus

    @property
    def device_code(self) -> int:
        """Top byte of the unit number, which tells kinds of remotes apart (0x12 7I77 field I/O)."""
        return self.unit_number >> 24


@dataclass(frozen=True)
class ChannelEvidence:
    """One row of a scan, or of a start that did not bring all channels up."""

    channel: int
    exists: bool
    started: bool
    identity: Identity
    counters: ChannelCounters | None
    problem: Exception | None = None
    description: RemoteDescription | None = None

    @property
    def status(self) -> ChannelStatus:
        """The CS register at the end of the start."""
        return self.identity.status

    @property
    def name(self) -> str:
        """The remote's name, "" if none answered."""
        return self.identity.name

    @property
    def unit_number(self) -> int:
        """The remote's unit number, 0 if none answered."""
        return self.identity.unit_number

    @property
    def elements(self) -> int:
        """How many process data elements the remote has, padding left out."""
        return sum(each.kind is not FieldKind.PAD for each in self._fields)

    @property
    def parameters(self) -> int:
        """How many parameters the remote has."""
        return len(self.description.parameters) if self.description else 0

    @property
    def _fields(self) -> tuple[Field, ...]:
        return self.description.fields if self.description else ()

    @property
    def found(self) -> bool:
        """Whether a remote answered, usable or not."""
        return bool(self.identity.name or self.identity.unit_number)

    @property
    def reason(self) -> str:
        """Why the channel cannot be used, "ok" if it can."""
        if not self.exists:
            return "the firmware has no such channel"
        if self.problem is not None:
            return str(self.problem)
        if self.started:
            return "ok"
        return self._why_not()

    def _why_not(self) -> str:
        local, fault = self.status.local_fault, self.status.remote_fault
        if self.found and fault & RemoteFault.ILLEGAL_MODE:
            return "the remote does not have this software mode"
        if self.found and local & LocalFault.REMOTE_FAULT:
            return f"the remote has a fault that it does not clear ({'; '.join(self.status.live)})"
        if self.found:
            return f"the remote answered, but its start did not end ({self.status.state})"
        if local & LocalFault.INVALID_COOKIE:
            return "something answers, but not as an LBP remote does"
        if local & (LocalFault.CRC | LocalFault.SERIAL_BREAK):
            return "answers arrive damaged: wiring, polarity or baud rate"
        if local & LocalFault.TIMEOUT:
            return "no answer"
        return self.status.state

    def row(self) -> tuple[str, ...]:
        """As cells of a table."""
        counted = str(self.counters) if self.counters is not None else ""
        unit = f"{self.unit_number:08X}" if self.found else "-"
        cs = f"{self.status.word:08X}"
        return str(self.channel), self.name or "-", unit, self.reason, cs, counted


DEVICE_7I77_FIELD, DEVICE_7I77_ANALOG = 0x12, 0x11
"""Top bytes of unit numbers; a 7I77 has its field I/O on the channel before its analog outputs."""


def hints(rows: Sequence[ChannelEvidence]) -> list[str]:
    """What rows say together that none says alone."""
    by_channel = {row.channel: row for row in rows}
    found = []
    for row in rows:
        before = by_channel.get(row.channel - 1)
        after = by_channel.get(row.channel + 1)
        if row.identity.device_code == DEVICE_7I77_ANALOG and before is not None and not before.found:
            found.append(
                f"The 7I77's analog outputs answer on channel {row.channel}, so cable and 5 V are good, but "
                f"its field I/O on channel {before.channel} does not: it needs VIN, 8-32 V at TB2-5 "
                "(from VFIELD if W1 is in its left position)."
            )
        if row.identity.device_code == DEVICE_7I77_FIELD and after is not None and not after.found:
            found.append(
                f"The 7I77's field I/O answers on channel {row.channel}, but its analog outputs on channel "
                f"{after.channel} do not: they take 5 V from the host or TB1, see W5."
            )
    return found


_HEADER = ("channel", "name", "unit", "result", "CS", "counted")


class Scan(tuple[ChannelEvidence, ...]):
    """What is on each channel of a port, a row each."""

    __slots__ = ()

    def __repr__(self) -> str:
        return "\n".join([table([_HEADER, *(row.row() for row in self)]), *hints(self)])


@dataclass(frozen=True)
class StartResult:
    """Masks of the channels that run, of those asked for, and of those that do not."""

    started: int
    failed: int
    channels: tuple[ChannelEvidence, ...] = field(default=(), repr=False)

    def raise_for_failed(self) -> StartResult:
        """Raises NoRemote with the evidence if a channel failed, else returns this result."""
        if self.failed:
            failed = tuple(row for row in self.channels if self.failed >> row.channel & 1)
            error = NoRemote(f"channels {self.failed:#04x} did not start\n{self}", index=failed[0].channel)
            error.channels = failed
            raise error
        return self

    def __str__(self) -> str:
        text = f"started 0x{self.started:02X}, failed 0x{self.failed:02X}"
        if not self.failed:
            return text
        silent = any(not row.found for row in self.channels if self.failed >> row.channel & 1)
        rows = table([_HEADER, *(row.row() for row in self.channels)])
        return "\n".join([text, rows, *hints(self.channels), *([CHECKLIST] if silent else [])])

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
