"""hm2 doctor: measures, says what to change first, and tries a change."""

from __future__ import annotations

import os
from pathlib import Path

import click
from rich.table import Table
from rich.text import Text

from hostmot2.cli.progress import stages
from hostmot2.cli.session import Session, reports, rows, text_width
from hostmot2.default import BOARD_VARIABLE
from hostmot2.doctor import Examination, Finding, Outcome, Verdict, examine, try_change
from hostmot2.doctor.examination import Target, probe_of, target_of
from hostmot2.doctor.knobs import KEYS, knob
from hostmot2.doctor.links import NetlinkLinks
from hostmot2.doctor.machine import Machine
from hostmot2.doctor.measure import PRIORITY
from hostmot2.errors.base import numbered, wrapped

_COLOURS = {
    Verdict.BLOCKS: "bold red",
    Verdict.IMPROVE: "yellow",
    Verdict.GOOD: "green",
    Verdict.UNKNOWN: "dim",
}
_TIMES = ("min_ns", "p50_ns", "p99_ns", "p99.9_ns", "max_ns")


@click.command()
@click.argument("target", required=False, metavar="[INTERFACE|URL]")
@click.option("--ab", "change", metavar="KEY=VALUE", help=f"Try one change: {', '.join(KEYS)}.")
@click.option(
    "--count", type=click.IntRange(100, 1_000_000), default=3000, show_default=True, help="Measurements."
)
@click.option("--rounds", type=click.IntRange(6, 100), default=10, show_default=True, help="Of --ab.")
@click.option("--cpu", type=click.IntRange(0, 4095), help="Measure on this processor.")
@click.option("--root", type=click.Path(path_type=Path), default=Path("/"), hidden=True)
@reports
def doctor(
    session: Session,
    target: str | None,
    change: str | None,
    count: int,
    rounds: int,
    cpu: int | None,
    root: Path,
) -> None:
    """What this machine does to a cycle, and what to change.

    Measures first: how late threads wake, and with a card how long it takes to answer (nothing is written to
    it). Then looks at permissions, network card, kernel, processors and limits, and advises in the order in
    which changes help. Change one thing at a time: --ab KEY=VALUE measures without and with a change in turn,
    puts it back, whatever happens, and tells the difference with its confidence interval.

    \b
    Examples:
      hm2 doctor
      hm2 doctor udp://10.10.10.10
      hm2 doctor enp2s0 --ab rx-usecs=0
      hm2 doctor --ab cpu_dma_latency=0 --rounds 20
    """
    machine = Machine(root)
    asked = target or session.url or os.environ.get(BOARD_VARIABLE)
    meant = target_of(asked, NetlinkLinks)
    if cpu is not None and cpu not in os.sched_getaffinity(0):
        raise click.UsageError(f"processor {cpu} is not there for this process")
    if change is not None:
        _try(session, meant, machine, change, count, rounds, cpu)
        return
    with stages() as advance:
        found = examine(meant, machine, NetlinkLinks, count=count, cpu=cpu, progress=advance)
    session.report(found.as_json(), *_shown(found))


def _shown(found: Examination) -> list[Table | str]:
    cells = []
    for each in found.measured:
        summary = each.times.summary()
        times = (f"{summary[name] / 1000:.1f}" if name in summary else "-" for name in _TIMES)
        cells.append((each.what, *times, each.lost or "", each.how))
    measured = rows(("us", "min", "p50", "p99", "p99.9", "max", "lost", "how"), cells)
    seen = rows(
        ("verdict", "what", "found"), [(_coloured(f.verdict), f.name, f.seen) for f in found.findings]
    )
    lines: list[Table | str] = [measured, "", seen, ""]
    advice = numbered([_advice(finding, found.target) for finding in found.advice])
    lines.append("Change one thing at a time, in this order:" if advice else "Nothing to change was found.")
    return [*lines, *(f"  {line}" for line in wrapped(advice, text_width(), 2))]


def _coloured(verdict: Verdict) -> Text:
    return Text(verdict.value, style=_COLOURS[verdict])


def _advice(finding: Finding, target: Target) -> str:
    text = f"{finding.name}: {finding.advice}"
    if not finding.trial:
        return text
    where = target.interface or (finding.name.split()[0] if "=" in finding.trial else "")
    needs_interface = finding.trial.split("=")[0] in KEYS[:6]
    place = f"{where} " if needs_interface and where else ""
    return f"{text} Try it: hm2 doctor {place}--ab {finding.trial}"


def _try(
    session: Session, target: Target, machine: Machine, change: str, count: int, rounds: int, cpu: int | None
) -> None:
    key, equals, value = change.partition("=")
    if not equals or not value:
        raise click.BadParameter(f"{change!r} is not KEY=VALUE", param_hint="--ab")
    made = knob(key, machine, NetlinkLinks, target.interface)
    if key in KEYS[:6] and not (target.host or target.url):
        raise click.UsageError(f"{key} is judged by a card's answers: name the card, udp://HOST")
    priority = 0 if key == "timer-slack" else PRIORITY  # it holds for normal scheduling only
    probe, each = probe_of(target, cpu, priority=priority), max(100, count // rounds)
    with stages() as advance:
        outcome = try_change(
            made, value, lambda: probe(each), rounds=rounds, interface=target.interface, progress=advance
        )
    session.report(outcome.as_json(), *_compared(outcome))


def _compared(outcome: Outcome) -> list[Table | str]:
    cells = [
        (
            name,
            f"{d.before:.1f}",
            f"{d.after:.1f}",
            f"{d.low:+.1f} .. {d.high:+.1f}",
            f"{d.confidence:.1%}",
            d.verdict,
        )
        for name, d in outcome.differences.items()
    ]
    old = outcome.old or "not held"
    header = (
        f"{outcome.what}, us",
        f"{outcome.key} {old}",
        f"{outcome.key} {outcome.new}",
        "difference",
        "sure",
        "",
    )
    table = rows(header, cells)
    lines: list[Table | str] = [table, f"{outcome.rounds} rounds in turn; the setting is back at {old}"]
    if not outcome.restored:
        lines[-1] = (
            f"{outcome.rounds} rounds in turn; the setting could NOT be put back to {old}: do it by hand"
        )
    if any(outcome.lost):
        lines.append(f"answers lost: {outcome.lost[0]} without, {outcome.lost[1]} with the change")
    return lines
