"""The command line of the benchmarks: `hm2 bench` and `python -m hostmot2.bench`."""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import click

from hostmot2.bench import host
from hostmot2.bench.progress import say
from hostmot2.bench.report import Report, compare, document

# name: module with `run(count: int | None) -> Report`, what it measures
BENCHMARKS = {
    "rtt": (
        "hostmot2.bench.rtt",
        "Ethernet: cycles beside bare exchanges, the emulated card beside a bare answerer",
    ),
    "pack": ("hostmot2.bench.pack", "process data: unpack, pack and bulk decode beside other packages"),
    "doit": ("hostmot2.bench.doit", "smart serial exchanges from Python on the emulated card"),
}

EXAMPLES = (
    "doit --count 1000",
    "doit pack -o today.json --plot today.png",
    "doit --compare today.json",
)


def run_benchmark(name: str, count: int | None = None) -> Report:
    """Run one benchmark. KeyError: no such. ImportError: what it needs is not installed."""
    run: Callable[[int | None], Report] = import_module(BENCHMARKS[name][0]).run
    return run(count)


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
@click.option("-o", "output", type=click.Path(dir_okay=False, path_type=Path), help="Write JSON here.")
@click.option("--plot", type=click.Path(dir_okay=False, path_type=Path), help="Draw the histograms here.")
@click.option(
    "--compare",
    "old",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Show figures relative to an earlier JSON.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of tables.")
@click.pass_context
def bench(
    context: click.Context,
    names: tuple[str, ...],
    count: int | None,
    output: Path | None,
    plot: Path | None,
    old: Path | None,
    as_json: bool,
) -> None:
    """Run the benchmarks named."""
    as_json = as_json or getattr(context.obj, "as_json", False)  # hm2 --json bench
    facts = host.facts()
    with host.quiet() as scheduling:
        reports = []
        for place, name in enumerate(names or BENCHMARKS, 1):
            # no moving bar: it would take the processor from what is measured
            say(f"measuring {name} ({place} of {len(names or BENCHMARKS)})")
            reports.append(run_benchmark(name, count))
    found = document(reports, facts, scheduling)
    if output:
        output.write_text(json.dumps(found, indent=1) + "\n")
    if plot:
        _draw(reports, plot)
    if as_json:
        click.echo(json.dumps(found, indent=1))
        return
    click.echo("  ".join(f"{key} {value}" for key, value in facts.items()))
    click.echo(scheduling)
    for report in reports:
        click.echo(f"\n{report}")
    if old:
        click.echo(f"\n{_compared(reports, old)}")


def _draw(reports: list[Report], plot: Path) -> None:
    from hostmot2.bench.picture import draw  # matplotlib is an extra

    try:
        draw(reports, plot)
    except ValueError as problem:
        raise click.ClickException(str(problem)) from problem


def _compared(reports: list[Report], old: Path) -> str:
    try:
        return compare(reports, old)
    except ValueError as problem:
        raise click.BadParameter(str(problem), param_hint="--compare") from problem
