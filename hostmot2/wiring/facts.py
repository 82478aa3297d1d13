"""How the facts about a daughter card are written down."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Terminal:
    """One pin or screw. direction, seen from the card: "in", "out", "both", "power", "" (not connected)."""

    pin: int
    signal: str
    direction: str
    note: str = ""


@dataclass(frozen=True, slots=True)
class Connector:
    """One connector or terminal block, pins in order."""

    name: str
    purpose: str
    kind: str
    terminals: tuple[Terminal, ...]

    def terminal(self, signal: str) -> Terminal:
        """The terminal that carries `signal`. Raises KeyError."""
        for terminal in self.terminals:
            if terminal.signal == signal:
                return terminal
        raise KeyError(f"{self.name} has no {signal!r}")


@dataclass(frozen=True, slots=True)
class Jumper:
    """Jumpers that are set alike: what each position means. default is "" where the manual names none."""

    names: tuple[str, ...]
    purpose: str
    positions: tuple[tuple[str, str], ...]
    default: str = ""


@dataclass(frozen=True, slots=True)
class Led:
    """One LED: what it shows, and how it must look when all is well."""

    name: str
    colour: str
    place: str
    shows: str
    normal: str


@dataclass(frozen=True, slots=True)
class Limit:
    """One limit of operation; None where the manual gives none."""

    what: str
    minimum: float | None
    maximum: float | None
    unit: str


@dataclass(frozen=True, slots=True)
class RemoteFacts:
    """One smart-serial remote of a card, or its place for another one.

    code: the top byte of its unit number, None where that tells nothing. host_channel: its channel among
    those of the card's own host connector. checks: what to look at when it alone is silent, the likeliest
    first. proves: what is good if it answers. operate: its jumper's setting for process data. needed: False
    for a place that may stay empty.
    """

    what: str
    code: int | None
    host_channel: int
    checks: tuple[str, ...]
    proves: str = ""
    operate: str = ""
    needed: bool = True


@dataclass(frozen=True, slots=True)
class CardFacts:
    """Everything a person at the screwdriver needs.

    power_checklist: what to look at before power-up, in this order. remotes: its smart-serial remotes.
    silent_checks: what to look at when none of them answers, the likeliest first.
    """

    name: str
    title: str
    manual: str
    connectors: tuple[Connector, ...]
    jumpers: tuple[Jumper, ...]
    leds: tuple[Led, ...]
    limits: tuple[Limit, ...]
    power_checklist: tuple[str, ...]
    remotes: tuple[RemoteFacts, ...]
    silent_checks: tuple[str, ...]

    def connector(self, name: str) -> Connector:
        """A connector by name. Raises KeyError."""
        for connector in self.connectors:
            if connector.name == name:
                return connector
        raise KeyError(f"{self.name} has no connector {name!r}")
