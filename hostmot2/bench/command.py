"""The command line of the benchmarks: `hm2 bench` and `python -m hostmot2.bench`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from hostmot2.bench import BENCHMARKS, host, run
from hostmot2.bench.page import page as write_page
from hostmot2.bench.progress import say
from hostmot2.bench.report import Report, compare, document, earlier, goals_table

FILE = click.Path(dir_okay=False, path_type=Path)
EXAMPLES = (
    "doit --count 1000",
    "doit pack -o today.json --plot today.png",
    "doit --compare today.json",
)


def _help() -> str:
    told = "\n".join(f"  {name:<6} {text}" for name, (_, text) in BENCHMARKS.items())
    examples = "\n".join(f"  hm2 bench {line}" for line in EXAMPLES)
    return (
        f"Measure this package on this machine, all without a NAME.\n\n\b\n{told}\n\n"
        f"Nothing else should run meanwhile; SCHED_FIFO is used where permitted.\n\n\b\nExamples:\n{examples}"
    )


@click.command(help=_help())
@click.argument("names", nargs=-1, type=click.Choice(list(BENCHMARKS)), metavar="[NAME]...")
@click.option("--count", type=click.IntRange(min=1), help="Rounds or cycles; each benchmark has its default.")
@click.option("-o", "output", type=FILE, help="Write JSON here.")
@click.option("--plot", type=FILE, help="Draw distributions and tails here.")
@click.option("--page", type=FILE, help="Write a page of Markdown here.")
@click.option(
    "--compare",
    "old",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Show figures relative to an earlier JSON, and draw its lines, too.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of tables.")
@click.pass_context
def bench(
    context: click.Context,
    names: tuple[str, ...],
    count: int | None,
    output: Path | None,
    plot: Path | None,
    page: Path | None,
    old: Path | None,
    as_json: bool,
) -> None:
    """Run the benchmarks named."""
    as_json = as_json or getattr(context.obj, "as_json", False)  # hm2 --json bench
    before = None if old is None else _earlier(old)
    facts = host.facts()
    url = getattr(context.obj, "url", None)  # hm2 --board URL bench
    with host.quiet() as scheduling:
        reports = []
        for place, name in enumerate(names or BENCHMARKS, 1):
            # no moving bar: it would take the processor from what is measured
            say(f"measuring {name} ({place} of {len(names or BENCHMARKS)})")
            reports.append(run(name, count, url))
    found = document(reports, facts, scheduling)
    if output:
        output.write_text(json.dumps(found, indent=1) + "\n")
    if page:
        page.write_text(write_page(reports, facts, scheduling))
    if plot:
        _draw(reports, plot, {**facts, "scheduling": scheduling}, before)
    if as_json:
        click.echo(json.dumps(found, indent=1))
        return
    _print(reports, facts, scheduling, before)


def _print(
    reports: Sequence[Report], facts: Mapping[str, str], scheduling: str, before: Mapping[str, Any] | None
) -> None:
    for report in reports:
        click.echo(f"{report}\n")
    if before is not None:
        click.echo(f"{compare(reports, before)}\n")
    click.echo("  ".join(f"{key} {value}" for key, value in facts.items()))
    click.echo(f"{scheduling}\n\n{goals_table(reports)}")


def _earlier(old: Path) -> dict[str, Any]:
    try:
        return earlier(old)
    except ValueError as problem:
        raise click.BadParameter(str(problem), param_hint="--compare") from problem


def _draw(
    reports: Sequence[Report], plot: Path, facts: Mapping[str, str], before: Mapping[str, Any] | None
) -> None:
    from hostmot2.bench.picture import draw  # matplotlib is an extra

    try:
        draw(reports, plot, facts, before)
    except ValueError as problem:
        raise click.ClickException(str(problem)) from problem
