"""hm2 param: parameters of remotes by name, through the card or through an adapter."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click

from hostmot2.cli.parameter_text import document, in_unit, shown, warn_if_read_only
from hostmot2.cli.progress import stages
from hostmot2.cli.remote_place import Place, parameters_in_place, parse_place, place_options
from hostmot2.cli.serial_remote import HEX, port_options
from hostmot2.cli.session import Session, reports, rows
from hostmot2.fields import ParameterField
from hostmot2.remotes import backup as backups
from hostmot2.remotes.parameters import Number, Parameter, Parameters

HEADER = ("name", "type", "value", "means", "stored", "range", "default", "address")

Command = Callable[..., Any]


@click.group()
def param() -> None:
    """Parameters of a remote, by name.

    Where the remote is: --channel 0.1 or a first argument 0.1 for port 0, channel 1 of the card (0.0 without
    either), --port for a serial adapter. Refused while the port moves process data. Stored parameters (NV...)
    take effect after a power cycle.
    """


def _where(
    arguments: tuple[str, ...], channel: Place | None, port: str | None
) -> tuple[Place | None, list[str]]:
    """The place, which may stand before the other arguments."""
    rest = list(arguments)
    if rest and "." in rest[0] and port is None:
        try:
            return parse_place(rest[0]), rest[1:]
        except ValueError:
            pass
    return channel, rest


def _options(command: Command) -> Command:
    return place_options(port_options(reports(command)))


def _row(parameter: Parameter, value: Number) -> tuple[object, ...]:
    low, high = parameter.limits
    field = parameter.field
    known = isinstance(field, ParameterField)
    return (
        parameter.name,
        parameter.type_name,
        parameter.format(value),
        in_unit(parameter, value).strip(" ()"),
        "EEPROM" if parameter.nonvolatile else "",
        f"{low:.10g}..{high:.10g}",
        field.default if known and isinstance(field, ParameterField) else None,
        f"0x{field.address:04X}" + ("?" if isinstance(field, ParameterField) and field.derived else ""),
    )


@param.command("list")
@click.argument("arguments", nargs=-1, metavar="[PORT.CHANNEL]")
@_options
def list_all(
    session: Session, arguments: tuple[str, ...], channel: Place | None, port: str | None, baud: int | None
) -> None:
    """All parameters and their values.

    An address with ? is derived, not confirmed.

    \b
    Examples:
      hm2 param list
      hm2 param list 0.1
      hm2 param list -p emu:8i20
    """
    channel, rest = _where(arguments, channel, port)
    if rest:
        raise click.UsageError(f"{' '.join(rest)}: hm2 param get reads single ones")
    with parameters_in_place(session, channel, port, baud) as (found, parameters), stages() as advance:
        read = []
        for done, name in enumerate(parameters, 1):
            parameter = parameters.parameter(name)
            read.append((parameter, parameter.read()))
            advance("parameters", done, len(parameters))
    facts = {
        "remote": found.name,
        "unit_number": found.unit_number,
        "parameters": [document(parameter, value) for parameter, value in read],
    }
    title = f"{found.name} unit 0x{found.unit_number:08X}"
    session.report(facts, rows(HEADER, [_row(*pair) for pair in read], title))


@param.command()
@click.argument("arguments", nargs=-1, required=True, metavar="[PORT.CHANNEL] NAME... [H]")
@_options
def get(
    session: Session, arguments: tuple[str, ...], channel: Place | None, port: str | None, baud: int | None
) -> None:
    """Read parameters; H: hexadecimal.

    \b
    Examples:
      hm2 param get 0.0 NVWATCHDOGTIMEOUT
      hm2 param get SWREVISION UNITNUMBER H -p emu:8i20
    """
    channel, names = _where(arguments, channel, port)
    hexadecimal = len(names) > 1 and names[-1].upper() == "H"
    names = names[:-1] if hexadecimal else names
    if not names:
        raise click.UsageError("which parameter?")
    with parameters_in_place(session, channel, port, baud) as (_, parameters):
        wanted = [parameters.parameter(name) for name in names]
        read = [(parameter, parameter.read()) for parameter in wanted]
    facts = [document(parameter, value) for parameter, value in read]
    lines = [f"{p.name} = {shown(p, value, hexadecimal=hexadecimal)}" for p, value in read]
    session.report(facts[0] if len(facts) == 1 else facts, *lines)


@param.command("set", context_settings={"ignore_unknown_options": True})
@click.argument("arguments", nargs=-1, required=True, metavar="[PORT.CHANNEL] NAME VALUE [H]")
@click.option("--save", "also_save", is_flag=True, help="Store it in EEPROM, too.")
@click.option("--dry-run", is_flag=True, help="Check everything, write nothing.")
@_options
def set_one(
    session: Session,
    arguments: tuple[str, ...],
    also_save: bool,
    dry_run: bool,
    channel: Place | None,
    port: str | None,
    baud: int | None,
) -> None:
    """Write a parameter and read it back; H: hexadecimal.

    \b
    Examples:
      hm2 param set 0.0 NVWATCHDOGTIMEOUT 60 --dry-run
      hm2 param set KQP 2000 --save -p emu:8i20
    """
    channel, rest = _where(arguments, channel, port)
    if len(rest) not in (2, 3) or (len(rest) == 3 and rest[2].upper() != HEX.choices[0].upper()):
        raise click.UsageError("NAME VALUE [H]")
    with parameters_in_place(session, channel, port, baud) as (_, parameters):
        targets = [parameters.parameter(rest[0])]
        if also_save:
            targets.append(_stored(parameters, targets[0]))
        value = targets[0].parse(rest[1], hexadecimal=len(rest) == 3)
        for target in targets:
            target.encode(value)
        changes = _changes([(target, value) for target in targets], dry_run)
    session.report(changes[0] if len(changes) == 1 else changes, *[change["said"] for change in changes])


def _stored(parameters: Parameters, parameter: Parameter) -> Parameter:
    """The parameter in EEPROM that this one takes over at power-up. UsageError if there is none."""
    if parameter.nonvolatile:
        return parameter
    for name in parameters:
        found = parameters.parameter(name)
        taken = found.field.working if isinstance(found.field, ParameterField) else ""
        if found.nonvolatile and parameter.name.casefold() in (taken.casefold(), name[2:].casefold()):
            return found
    alias = f"NV{parameter.name}"
    if alias in parameters:
        return parameters.parameter(alias)
    raise click.UsageError(f"{parameter.name} is not kept in EEPROM")


def _changes(wanted: Iterable[tuple[Parameter, Number]], dry_run: bool) -> list[dict[str, Any]]:
    """One after the other. An error, or Ctrl-C, in the middle says what was written before."""
    changes: list[dict[str, Any]] = []
    try:
        for parameter, value in wanted:
            warn_if_read_only(parameter)
            changes.append(_change(parameter, value, dry_run))
    except BaseException as failure:
        if written := [change["said"] for change in changes if change["written"]]:
            failure.add_note(f"written before this: {'; '.join(written)}")
        raise
    return changes


def _change(parameter: Parameter, value: Number, dry_run: bool) -> dict[str, Any]:
    before = parameter.read()
    written = not dry_run and parameter.write(value)
    now = f"{parameter.name} = {shown(parameter, value)}"
    was = f"{parameter.format(before)}{in_unit(parameter, before)}"
    if dry_run:
        said = f"{now} already" if before == value else f"would write {now}, is {was}"
    elif not written:
        said = f"{now} already; EEPROM not rewritten"
    else:
        said = f"{now}, was {was}" + ("; takes effect after a power cycle" if parameter.nonvolatile else "")
    return document(parameter, value) | {"before": before, "written": written, "said": said}


@param.command()
@click.argument("arguments", nargs=-1, metavar="[PORT.CHANNEL] [NAME...]")
@click.option("--dry-run", is_flag=True, help="Say what would be stored.")
@_options
def save(
    session: Session,
    arguments: tuple[str, ...],
    dry_run: bool,
    channel: Place | None,
    port: str | None,
    baud: int | None,
) -> None:
    """Store working values in EEPROM: the named ones, or all.

    \b
    Examples:
      hm2 param save KQP -p emu:8i20
      hm2 param save --dry-run -p emu:8i20
    """
    channel, names = _where(arguments, channel, port)
    with parameters_in_place(session, channel, port, baud) as (_, parameters):
        pairs = []
        for name in names or parameters:
            working = parameters.parameter(name)
            if working.nonvolatile and not names:
                continue
            try:
                pairs.append((working, _stored(parameters, working)))
            except click.UsageError:
                if names:
                    raise
        changes = _changes(((stored, working.read()) for working, stored in pairs), dry_run)
    said = [change["said"] for change in changes if names or "already" not in change["said"]]
    session.report(changes, *(said or ["everything is stored already"]))


@param.command()
@click.argument("arguments", nargs=-1, required=True, metavar="[PORT.CHANNEL] FILE.toml")
@click.option("--all", "everything", is_flag=True, help="Working parameters, too.")
@_options
def backup(
    session: Session,
    arguments: tuple[str, ...],
    everything: bool,
    channel: Place | None,
    port: str | None,
    baud: int | None,
) -> None:
    """Write the stored parameters into a file.

    \b
    Examples:
      hm2 param backup 0.0 7i77.toml
      hm2 param backup --all 8i20.toml -p emu:8i20
    """
    channel, (file,) = _files(arguments, channel, port, 1)
    with parameters_in_place(session, channel, port, baud) as (found, parameters), stages() as advance:
        taken = backups.take(found, parameters, everything=everything, progress=advance)
        backups.write(taken, file, parameters)
    facts = {"file": str(file), "remote": found.name, "unit_number": found.unit_number}
    session.report(
        facts | {"values": taken.values}, f"{len(taken.values)} parameters of {found.name} in {file}"
    )


def _files(
    arguments: tuple[str, ...], channel: Place | None, port: str | None, count: int
) -> tuple[Place | None, list[Path]]:
    place, rest = _where(arguments, channel, port)
    if not 1 <= len(rest) <= count:
        raise click.UsageError("which file?")
    return place, [Path(name) for name in rest]


@param.command()
@click.argument("arguments", nargs=-1, required=True, metavar="[PORT.CHANNEL] FILE.toml")
@click.option("--dry-run", is_flag=True, help="Say what would be written.")
@click.option("--other-unit", is_flag=True, help="The file may be of another unit; unit numbers stay.")
@_options
def restore(
    session: Session,
    arguments: tuple[str, ...],
    dry_run: bool,
    other_unit: bool,
    channel: Place | None,
    port: str | None,
    baud: int | None,
) -> None:
    """Put a file's values back; only what differs is written.

    \b
    Examples:
      hm2 param restore 0.0 7i77.toml --dry-run
      hm2 param restore 0.0 7i77.toml
    """
    channel, (file,) = _files(arguments, channel, port, 1)
    wanted = backups.read(file)
    with parameters_in_place(session, channel, port, baud) as (found, parameters):
        backups.check(wanted, found, parameters, other_unit=other_unit)
        planned = backups.planned(wanted, found, parameters)
        wanted_values = (
            (parameters.parameter(difference.name), difference.after)
            for difference in planned
            if difference.after is not None
        )
        changes = _changes(wanted_values, dry_run)
    session.report(changes, *([change["said"] for change in changes] or ["nothing differs"]))


@param.command()
@click.argument("arguments", nargs=-1, required=True, metavar="[PORT.CHANNEL] FILE.toml [FILE.toml]")
@_options
@click.pass_context
def diff(
    context: click.Context,
    session: Session,
    arguments: tuple[str, ...],
    channel: Place | None,
    port: str | None,
    baud: int | None,
) -> None:
    """What differs between a file and a remote, or two files; 1 if any.

    \b
    Examples:
      hm2 param diff 0.0 7i77.toml
      hm2 param diff 7i77.toml 7i77.toml
    """
    channel, files = _files(arguments, channel, port, 2)
    first = backups.read(files[0])
    if len(files) == 2:
        found = backups.differences(first.values, backups.read(files[1]).values)
    else:
        with parameters_in_place(session, channel, port, baud) as (description, parameters):
            backups.check(first, description, parameters, other_unit=True)
            found = backups.differences(first.values, {name: parameters[name] for name in first.values})
    facts = [{"name": d.name, "before": d.before, "after": d.after} for d in found]
    lines = [(d.name, d.before, d.after) for d in found]
    there = "second file" if len(files) == 2 else "remote"
    session.report(facts, rows(("name", "file", there), lines) if lines else "no difference")
    if found:
        context.exit(1)
