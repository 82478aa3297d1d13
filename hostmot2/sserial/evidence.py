"""What start and scan found on each channel."""

from __future__ import annotations

from dataclasses import dataclass

from hostmot2.fields import Field, FieldKind
from hostmot2.registers import LocalFault, RemoteFault
from hostmot2.remotes.discovery import RemoteDescription
from hostmot2.sserial.counters import ChannelCounters
from hostmot2.sserial.places import Place
from hostmot2.sserial.status import ChannelStatus

_NOWHERE = Place("")


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
    place: Place = _NOWHERE

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
    def expected_empty(self) -> bool:
        """Whether nothing answers where nothing has to be: a connector for further remotes."""
        silent = not self.found and self.problem is None
        return silent and self.place.remote is not None and not self.place.remote.needed

    @property
    def reason(self) -> str:
        """Why the channel cannot be used, "ok" if it can."""
        if not self.exists:
            return "the firmware has no such channel"
        if self.problem is not None:
            return str(getattr(self.problem, "message", self.problem))
        if self.started:
            return "ok"
        return self._why_not()

    def _why_not(self) -> str:
        local, fault = self.status.local_fault, self.status.live_fault
        if self.found and fault & RemoteFault.ILLEGAL_MODE:
            return "the remote does not have this software mode"
        if self.found and local & LocalFault.REMOTE_FAULT:
            words = "; ".join(self.status.fault_names) or self.status.state
            return f"the remote has a fault that it does not clear ({words})"
        if self.found:
            return f"the remote answered, but its start did not end ({self.status.state})"
        if local & LocalFault.INVALID_COOKIE:
            return "something answers, but not as an LBP remote does"
        if local & (LocalFault.CRC | LocalFault.SERIAL_BREAK):
            return "answers arrive damaged: wiring, polarity or baud rate"
        if local & LocalFault.TIMEOUT:
            return "no answer"
        return self.status.state

    @property
    def usable(self) -> bool:
        """Whether a remote answered and nothing speaks against starting it."""
        return self.exists and self.found and self.problem is None

    def row(self) -> tuple[str, ...]:
        """As cells of a table."""
        counted = str(self.counters) if self.counters is not None else ""
        unit = f"{self.unit_number:08X}" if self.found else "-"
        cs = f"{self.status.word:08X}"
        return str(self.channel), self.name or "-", unit, self.reason, cs, counted, str(self.place)
