"""What to check when a remote does not answer: in which order depends on which others do.

The terminals, jumpers and LEDs are those of hostmot2/wiring, from the cards' manuals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hostmot2.errors.base import numbered, wrapped
from hostmot2.registers import LocalFault, RemoteFault
from hostmot2.sserial.errors import NoRemote, SetupJumper
from hostmot2.sserial.evidence import ChannelEvidence
from hostmot2.wiring import WIRING

_DAMAGED = (
    "the wires of a pair exchanged (polarity), or RX and TX pair swapped",
    "the remote's baud rate: NVBAUDRATE other than 2.5 Mbaud, or its set-up jumper in place",
    "a missing termination, ground or shield; cables along motor leads",
)
_BROKEN_OFF = (
    "a remote that stays busy while it clears its faults or is enabled: its supply, its enable input",
    *_DAMAGED[2:],
)
_STRANGER = (
    "something that is no smart-serial remote hangs on the channel, or an echo of what is sent",
    "a remote whose firmware update was broken off",
)
_MODE = ("channel.mode asks for a software mode that this remote does not have: 0 always exists",)


@dataclass(frozen=True)
class Advice:
    """seen: what the channels say together. checks: what to look at, the likeliest first."""

    seen: tuple[str, ...] = ()
    checks: tuple[str, ...] = ()

    def lines(self, width: int = 110) -> list[str]:
        """As text below a table, wrapped to `width` columns."""
        heading = ["Check in this order:"] if self.checks else []
        checks = [f"  {line}" for line in wrapped(numbered(self.checks), width, 2)]
        return [*wrapped(self.seen, width, 0), *heading, *checks]


def advise(failed: Sequence[ChannelEvidence], everything: Sequence[ChannelEvidence]) -> Advice:
    """What to say about the channels in `failed`, seen with all rows of the port that are known."""
    seen: list[str] = []
    checks: list[tuple[str, tuple[str, ...]]] = []
    for row in failed:
        said, causes = _of_one(row, [other for other in everything if other.channel != row.channel])
        seen += [line for line in said if line not in seen]
        checks.append((f"channel {row.channel}: ", causes))
    return Advice(tuple(seen), _merged(checks))


def _merged(checks: Sequence[tuple[str, tuple[str, ...]]]) -> tuple[str, ...]:
    """Each check once; with its channel where channels differ."""
    lists = list(dict.fromkeys(causes for _, causes in checks))
    if len(lists) <= 1:
        return lists[0] if lists else ()
    return tuple(prefix + cause for prefix, causes in checks for cause in causes)


def _of_one(row: ChannelEvidence, others: list[ChannelEvidence]) -> tuple[list[str], tuple[str, ...]]:
    local, fault = row.status.local_fault, row.status.live_fault
    if not row.exists:
        return [], ("the bitfile: its firmware has no such channel (`hm2 pins`)",)
    if isinstance(row.problem, SetupJumper) and row.place.remote and row.place.remote.operate:
        return [], (f"the set-up jumper: {row.place.remote.operate} for operate mode, then cycle the power",)
    if row.problem is not None:
        return [], tuple(getattr(row.problem, "causes", ()))
    if row.found and fault & RemoteFault.ILLEGAL_MODE:
        return [], _MODE
    if row.found and (fault or local & LocalFault.REMOTE_FAULT):
        words = ", ".join(row.status.fault_names) or "its own fault display says which"
        return [], (f"the remote reports its own fault ({words}): remove its cause, then start again",)
    if row.found:
        return [], _BROKEN_OFF
    if local & LocalFault.INVALID_COOKIE:
        return [], _STRANGER
    if local & (LocalFault.CRC | LocalFault.SERIAL_BREAK):
        return [], _DAMAGED
    return _silent(row, others)


def _silent(row: ChannelEvidence, others: list[ChannelEvidence]) -> tuple[list[str], tuple[str, ...]]:
    card, remote = row.place.card, row.place.remote
    if card is None or remote is None:
        return _somewhere(row, others)
    beside = [other for other in others if _connector(other) == _connector(row)]
    answering = [other for other in beside if other.place.card is card and other.found and _needed(other)]
    name = card.name.upper()
    at = f" at {row.place.connector}" if row.place.connector else ""
    if answering:
        parts = " and ".join(f"{_what(other)} (channel {other.channel})" for other in answering)
        proved = max((_proves(other) for other in answering), key=len)
        return [
            f"Of the {name}{at}, {parts} did answer: {proved} are good. "
            f"The {remote.what} (channel {row.channel}) did not."
        ], remote.checks
    if not any(_needed(other) for other in beside):  # the others were never asked
        return [], (*remote.checks, *card.silent_checks)
    if not remote.needed:
        return [f"Nothing of the {name}{at} answers."], (*card.silent_checks, *remote.checks)
    return [f"Nothing of the {name} that the bitfile expects{at} answers."], card.silent_checks


def _connector(row: ChannelEvidence) -> str:
    return row.place.connector


def _needed(row: ChannelEvidence) -> bool:
    return row.place.remote is not None and row.place.remote.needed


def _what(row: ChannelEvidence) -> str:
    return row.place.remote.what if row.place.remote else "remote"


def _proves(row: ChannelEvidence) -> str:
    return row.place.remote.proves if row.place.remote else ""


def _somewhere(row: ChannelEvidence, others: list[ChannelEvidence]) -> tuple[list[str], tuple[str, ...]]:
    """A channel whose card is not known: the general list, without what others have shown to be good."""
    neighbours = [other for other in others if other.found and _connector(other) == _connector(row)]
    where = f" on {row.place.connector}" if row.place.connector else ""
    if not neighbours:
        return [], tuple(NoRemote.causes)
    seen = f"Channel {neighbours[0].channel}{where} answers, so the bitfile and that connector are good."
    return [seen], tuple(NoRemote.causes[:-1])


def checklist_of(card: str) -> dict[str, tuple[str, ...]]:
    """By situation, what to check for a card of hostmot2/wiring. KeyError for one that is not there."""
    facts = WIRING[card.lower()]
    if len(facts.remotes) == 1:
        return {"nothing answers": facts.silent_checks}
    found = {"nothing of the card answers": facts.silent_checks}
    return found | {f"only one is silent: {remote.what}": remote.checks for remote in facts.remotes}
