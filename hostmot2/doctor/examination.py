"""Everything at once: measure, then look at what makes the figures as they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from hostmot2 import host_facts, lbp16
from hostmot2.doctor import access, network, scheduling
from hostmot2.doctor.finding import Finding, Verdict
from hostmot2.doctor.links import Links
from hostmot2.doctor.machine import Machine
from hostmot2.doctor.measure import PRIORITY, Measurement, lateness, register_reads, round_trips
from hostmot2.ethernet.discovery import DEFAULT_ADDRESSES, answers


@dataclass(frozen=True)
class Target:
    """What was asked about. interface: named or to the card; host, port: an Ethernet card; url: any other."""

    interface: str | None = None
    host: str | None = None
    port: int = lbp16.PORT
    url: str | None = None


@dataclass(frozen=True)
class Examination:
    """What was measured, and what was found, in the order in which changes help."""

    target: Target
    host: dict[str, str]
    measured: tuple[Measurement, ...]
    findings: tuple[Finding, ...]

    @property
    def advice(self) -> tuple[Finding, ...]:
        """What should be changed: what blocks first, then in the order in which it helps."""
        wanted = (Verdict.BLOCKS, Verdict.IMPROVE)
        return tuple(f for verdict in wanted for f in self.findings if f.verdict is verdict)

    def as_json(self) -> dict[str, Any]:
        """As JSON takes it."""
        return {
            "target": self.target.__dict__,
            "host": self.host,
            "measured": [each.as_json() for each in self.measured],
            "findings": [each.as_json() for each in self.findings],
            "advice": [each.as_json() for each in self.advice],
        }


def target_of(text: str | None, links: Callable[[], Links]) -> Target:
    """What a URL or an interface's name stands for; a card behind an interface is looked for."""
    if not text:
        return Target()
    parts = urlsplit(text)
    if parts.scheme == "udp" and parts.hostname:
        try:
            interface = links().towards(parts.hostname)[0] or None
        except ImportError:
            interface = None
        return Target(interface, parts.hostname, parts.port or lbp16.PORT)
    if parts.scheme:
        return Target(url=text)
    return Target(text, _card_behind(text, links))


def _card_behind(interface: str, links: Callable[[], Links]) -> str | None:
    try:
        network_of = links()
        near = [address for address in DEFAULT_ADDRESSES if network_of.towards(address) == (interface, True)]
    except (ImportError, OSError):
        return None
    return next(iter(answers(near, 0.2)), None) if near else None


def probe_of(target: Target, cpu: int | None, *, priority: int = PRIORITY) -> Callable[[int], Measurement]:
    """What a change is judged by: the way to the card if there is one, else wake-ups."""
    host, url = target.host, target.url
    if host:
        return lambda count: round_trips(host, target.port, count, cpu=cpu, priority=priority)
    if url:
        return lambda count: register_reads(url, count, cpu=cpu, priority=priority)
    return lambda count: lateness(count, cpu=cpu, priority=priority)


def examine(
    target: Target,
    machine: Machine,
    links: Callable[[], Links],
    *,
    count: int = 3000,
    cpu: int | None = None,
    progress: Callable[[str, int, int], object] = lambda *_: None,
) -> Examination:
    """Measure `count` times each, then look. Errors of measuring a card are raised, others are findings."""
    measured = [lateness(count, cpu=cpu)]
    progress("measured", 1, 2)
    if target.host or target.url:
        measured.append(probe_of(target, cpu)(count))
    progress("measured", 2, 2)
    return Examination(target, host_facts.facts(), tuple(measured), tuple(look(target, machine, links)))


def look(target: Target, machine: Machine, links: Callable[[], Links]) -> Iterator[Finding]:
    """Findings in the order in which changes help: access, network, kernel, processors, power, limits."""
    yield from access.access(machine)
    yield from _network(target, machine, links)
    yield from scheduling.kernel(machine)
    yield from scheduling.power(machine)
    yield from scheduling.limits(machine)
    yield from scheduling.clock(machine)


def _network(target: Target, machine: Machine, links: Callable[[], Links]) -> Iterator[Finding]:
    try:
        network_of = links()
    except ImportError as missing:
        yield Finding("network", Verdict.UNKNOWN, str(missing))
        return
    if target.host:
        yield from network.address(network_of, target.host)
    names = [target.interface] if target.interface else _wired(machine, network_of)
    for name in names:
        yield from network.interface(machine, network_of, name)


def _wired(machine: Machine, links: Links) -> list[str]:
    """Interfaces with hardware behind them that are in use."""
    used = (link for link in links.all() if link.up and link.carrier)
    return [link.name for link in used if machine.path(f"/sys/class/net/{link.name}/device").exists()]
