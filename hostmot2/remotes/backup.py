"""A remote's stored parameters in a TOML file: written, compared, put back."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import tomlkit

from hostmot2.remotes.discovery import RemoteDescription
from hostmot2.remotes.errors import WrongBackup
from hostmot2.remotes.parameters import Number, Parameter, Parameters
from hostmot2.whole_file import whole_file

UNIT_NUMBERS = ("nvunitnumber", "unitnumber")
"""Parameters by which a remote is known; never put into another one."""


@dataclass(frozen=True)
class Backup:
    """What a file says. nonvolatile, working: values by name."""

    name: str
    unit_number: int
    nonvolatile: Mapping[str, Number] = field(default_factory=dict)
    working: Mapping[str, Number] = field(default_factory=dict)

    @property
    def values(self) -> dict[str, Number]:
        """All of them."""
        return {**self.nonvolatile, **self.working}


@dataclass(frozen=True, slots=True)
class Difference:
    """A parameter that is not the same here and there; None: not there at all."""

    name: str
    before: Number | None
    after: Number | None


def take(
    description: RemoteDescription,
    parameters: Parameters,
    *,
    everything: bool = False,
    progress: Callable[[str, int, int], object] = lambda *_: None,
) -> Backup:
    """Read the stored parameters, and with `everything` the working ones that can be set.

    progress: called with "parameters", how many are read, of how many.
    """
    found = [parameters.parameter(name) for name in parameters]
    wanted = [p for p in found if p.nonvolatile or (everything and not p.read_only)]
    values: dict[bool, dict[str, Number]] = {True: {}, False: {}}
    for done, parameter in enumerate(wanted, 1):
        values[parameter.nonvolatile][parameter.name] = parameter.read()
        progress("parameters", done, len(wanted))
    return Backup(description.name, description.unit_number, values[True], values[False])


def write(backup: Backup, path: Path, parameters: Parameters) -> None:
    """The file, with units as comments; whole or not at all."""
    document = tomlkit.document()
    document.add(tomlkit.comment("Parameters of a remote; hm2 param restore puts them back."))
    remote = tomlkit.table()
    remote["name"], remote["unit_number"] = backup.name, backup.unit_number
    document["remote"] = remote
    for section, values in (("nonvolatile", backup.nonvolatile), ("working", backup.working)):
        if not values:
            continue
        table = tomlkit.table()
        for name, value in values.items():
            table[name] = value
            if meaning := _meaning(parameters.parameter(name), value):
                table[name].comment(meaning)
        document[section] = table
    with whole_file(path) as place:
        place.write_text(tomlkit.dumps(document))


def _meaning(parameter: Parameter, value: Number) -> str:
    if parameter.unit in ("", "none"):
        return ""
    return f"{parameter.to_unit(value):.6g} {parameter.unit}"


MOST_BYTES = 1 << 20
"""Of a backup; the parameters of a remote take a few kilobytes."""


def read(path: Path) -> Backup:
    """What a file says. Raises WrongBackup, OSError."""
    try:
        with path.open("rb") as file:
            text = file.read(MOST_BYTES + 1)
        if len(text) > MOST_BYTES:
            raise ValueError(f"longer than {MOST_BYTES} bytes")
        document = tomllib.loads(text.decode())
        remote = document["remote"]
        backup = Backup(
            str(remote["name"]),
            int(remote["unit_number"]),
            dict(document.get("nonvolatile", {})),
            dict(document.get("working", {})),
        )
    except (
        KeyError,
        TypeError,
        ValueError,
        OverflowError,
        RecursionError,
    ) as broken:  # TOML and Unicode, too
        raise WrongBackup(f"{path}: no backup of a remote: {broken}") from broken
    for name, value in backup.values.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise WrongBackup(f"{path}: {name} = {value!r} is no number")
    return backup


def differences(before: Mapping[str, Number], after: Mapping[str, Number]) -> list[Difference]:
    """What is not the same, by names in any capitals."""
    there = {name.casefold(): value for name, value in after.items()}
    here = {name.casefold() for name in before}
    found = [
        Difference(name, value, there.get(name.casefold()))
        for name, value in before.items()
        if not _same(there.get(name.casefold()), value)
    ]
    added = [Difference(name, None, value) for name, value in after.items() if name.casefold() not in here]
    return found + added


def _same(one: Number | None, other: Number) -> bool:
    """Equal, or both no number: so an erased cell reads that holds a FLOAT."""
    return one == other or (one is not None and one != one and other != other)


def check(
    backup: Backup, description: RemoteDescription, parameters: Parameters, *, other_unit: bool
) -> None:
    """Whether a backup may go into this remote. Raises WrongBackup before anything is written."""
    if backup.name.upper() != description.name.upper():
        raise WrongBackup(f"the backup is of a {backup.name}, this is a {description.name}")
    if backup.unit_number != description.unit_number and not other_unit:
        raise WrongBackup(
            f"the backup is of unit 0x{backup.unit_number:08X}, this is 0x{description.unit_number:08X}"
        )
    for name, value in backup.values.items():
        if name not in parameters:
            raise WrongBackup(f"this {description.name} has no {name}")
        try:
            parameters.parameter(name).encode(value)
        except (ValueError, TypeError) as mistake:
            if not _same(parameters[name], value):  # what is there already need not be written
                raise WrongBackup(str(mistake)) from mistake


def planned(backup: Backup, description: RemoteDescription, parameters: Parameters) -> list[Difference]:
    """What a restore would write. A unit number goes into its own unit only."""
    values = {
        name: value
        for name, value in backup.values.items()
        if backup.unit_number == description.unit_number or name.casefold() not in UNIT_NUMBERS
    }
    current = {name: parameters[name] for name in values}
    return [change for change in differences(current, values) if change.after is not None]
