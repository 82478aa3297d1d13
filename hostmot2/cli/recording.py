"""hm2 record, play, plot, export: recordings."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import click

from hostmot2.cli.progress import stages
from hostmot2.cli.run import start_remotes, until, watch
from hostmot2.cli.session import Session, reports, rows
from hostmot2.dump import printable
from hostmot2.emulator.control import ask

FILE = click.Path(dir_okay=False, path_type=Path)
COLUMNS = click.option("--column", "-c", "columns", multiple=True, metavar="NAME", help="Only these columns.")


def _recording() -> ModuleType:
    """The package, which needs an extra."""
    try:
        from hostmot2 import recording
    except ModuleNotFoundError as problem:
        raise ImportError(f"recordings need {problem.name}: pip install 'hostmot2[record]'") from problem
    return recording


@click.command()
@click.option("-o", "output", type=FILE, required=True, help="The MCAP file to write; replaced if it exists.")
@click.option("--rate", type=click.FloatRange(0.1, 20000), default=1000.0, show_default=True, metavar="HZ")
@click.option("--seconds", type=click.FloatRange(min=0), help="How long; until SIGINT or SIGTERM otherwise.")
@click.option("--json-rate", type=click.FloatRange(min=0), default=100.0, show_default=True, metavar="HZ")
@click.option("--real-time", is_flag=True, help="SCHED_FIFO and memory locked, where permitted.")
@reports
def record(
    session: Session, output: Path, rate: float, seconds: float | None, json_rate: float, real_time: bool
) -> None:
    """Record every cycle: inputs and raw registers.

    Remotes that answer are started with their outputs at zero; nothing is switched on. Every cycle is in the
    file for `hm2 play`, `plot` and `export`; viewers such as Foxglove get JSON at --json-rate. A card that
    another program drives is left alone (exit status 7): record in that program.

    \b
    Examples:
      hm2 record -o run.mcap --seconds 2
      hm2 --board udp://10.10.10.10 record -o run.mcap --rate 2000 --real-time
    """
    recording = _recording()
    with session.board() as board:
        start_remotes(board)
        engine = board.engine(rate, real_time=real_time)
        recorder = recording.record(engine, output, json_rate=json_rate)
        began = board.now_ns()
        with recorder, engine, until(board, seconds) as over, stages() as advance:

            def passed() -> None:
                if seconds:
                    done = min(round((board.now_ns() - began) / 1e9), round(seconds))
                    advance("seconds", done, round(seconds))

            watch(board, engine, recorder, over, passed)
        counters = recorder.counters
    document = {"file": str(output), "cycles": counters.records, "dropped": counters.dropped, "rate": rate}
    dropped = f", {counters.dropped} dropped" if counters.dropped else ""
    session.report(document, f"{output}: {counters.records} cycles{dropped}")


@click.command()
@click.argument("file", type=FILE)
@COLUMNS
@click.option("--every", type=click.IntRange(min=1), default=1, help="Only every so many cycles.")
@click.option("--control", type=FILE, help="Play into a running `hm2 emulate --control PATH` instead.")
@click.option("--speed", type=click.FloatRange(min=0), default=1.0, show_default=True, help="0: at once.")
@click.option("--map", "mapped", multiple=True, metavar="KEY=COLUMN", help="With --control: what goes where.")
@reports
def play(
    session: Session,
    file: Path,
    columns: tuple[str, ...],
    every: int,
    control: Path | None,
    speed: float,
    mapped: tuple[str, ...],
) -> None:
    """Show a recording as text, or play it to an emulator.

    Without --map the emulator gets the process data that remotes sent and the encoders' positions.

    \b
    Examples:
      hm2 play run.mcap --every 100
      hm2 play run.mcap -c total_us --json
      hm2 play run.mcap --control /tmp/card
    """
    run = _recording().read(file)
    if control is not None:
        _play_into(session, run, control, speed, mapped)
        return
    signals = [each.name for each in run.inputs] + [n for n in run if n in run.elements]
    names = [run.spelled(name) for name in columns] or list(dict.fromkeys(signals)) or list(run)
    at = slice(None, None, every)
    chosen = {name: run[name][at] for name in names}
    document = {
        "file": str(file),
        "cycles": len(run.records),
        "dropped": run.dropped,
        "gaps": [{"first": gap.first, "count": gap.count} for gap in run.gaps],
        "missing": list(run.missing),
        "log": [{"time_ns": e.time_ns, "name": e.name, "message": e.message} for e in run.log],
        "time_ns": run.time_ns[at].tolist(),
        "columns": {name: values.tolist() for name, values in chosen.items()} if session.as_json else {},
    }
    if session.as_json:
        session.report(document)
        return
    click.echo(repr(run))
    for line in _lines(run, chosen, every):
        click.echo(line)


def _lines(run: Any, chosen: dict[str, Any], every: int) -> Iterator[str]:
    units = run.units
    heads = [f"{name} [{units[name]}]" if name in units else name for name in chosen]
    yield "\t".join(["seconds", "cycle", *map(printable, heads)])
    log = [(entry.time_ns, printable(f"# {entry.name}: {entry.message}")) for entry in run.log]
    for index in range(0, len(run.records), every):
        while log and log[0][0] <= run.time_ns[index]:
            yield log.pop(0)[1]
        cells = (_cell(values[index // every].item()) for values in chosen.values())
        yield "\t".join([f"{run.seconds[index]:.6f}", str(run.cycle[index]), *cells])
    yield from (text for _, text in log)


def _cell(value: float) -> str:
    """Whole numbers are whole: a word of bits is read bit by bit, counts are compared."""
    if isinstance(value, float) and not (value.is_integer() and abs(value) < 1 << 53):
        return f"{value:.9g}"
    return str(int(value))


def _play_into(session: Session, run: Any, control: Path, speed: float, mapped: tuple[str, ...]) -> None:
    from hostmot2.recording.play import emulator_keys
    from hostmot2.recording.play import play as play_into

    keys = dict(_pair(each) for each in mapped) if mapped else emulator_keys(run)
    if not keys:
        raise click.UsageError("the recording has no columns an emulator takes; say which with --map")

    def set_value(key: str, value: float) -> None:
        ask(control, "set", key, f"{value:.17g}")

    refused = play_into(run, keys, set_value, speed=speed)
    for key, why in refused.items():
        click.echo(f"hm2: {key} was left out: {why}", err=True)
    played = {key: name for key, name in keys.items() if key not in refused}
    lines = [(key, name) for key, name in played.items()]
    session.report({"played": played, "refused": refused}, rows(("key", "column"), lines))


def _pair(text: str) -> tuple[str, str]:
    key, equals, name = text.partition("=")
    if not equals:
        raise click.BadParameter(f"{text!r} is not KEY=COLUMN", param_hint="--map")
    return key, name


@click.command()
@click.argument("file", type=FILE)
@click.option("-o", "output", type=FILE, required=True, help="The picture: .png, .svg or .pdf.")
@COLUMNS
@reports
def plot(session: Session, file: Path, output: Path, columns: tuple[str, ...]) -> None:
    """Draw a recording, an axes per unit, and cycle times.

    \b
    Examples:
      hm2 plot run.mcap -o run.png
      hm2 plot run.mcap -o run.svg -c total_us
    """
    recording = _recording()
    recording.plot(recording.read(file), output, columns)
    session.report({"file": str(output)}, str(output))


@click.command()
@click.argument("file", type=FILE)
@click.option("-o", "output", type=FILE, required=True, help="FILE.csv or FILE.parquet.")
@COLUMNS
@reports
def export(session: Session, file: Path, output: Path, columns: tuple[str, ...]) -> None:
    """Write a recording as CSV or Parquet, a row per cycle.

    \b
    Examples:
      hm2 export run.mcap -o run.csv
      hm2 export run.mcap -o run.csv -c total_us
    """
    recording = _recording()
    writers = {".csv": recording.to_csv, ".parquet": recording.to_parquet}
    if output.suffix not in writers:
        raise click.BadParameter(f"{output}: the name must end in .csv or .parquet", param_hint="-o")
    run = recording.read(file)
    writers[output.suffix](run, output, columns)
    session.report({"file": str(output), "rows": len(run.records)}, f"{output}: {len(run.records)} rows")
