"""hm2 emulate-remote: an emulated remote on a pseudo terminal."""

from __future__ import annotations

from pathlib import Path

import click

from hostmot2.emulator.catalog import CATALOG, remote
from hostmot2.emulator.remote_pty import serve
from hostmot2.emulator.remote_state import RemoteState


@click.command("emulate-remote")
@click.argument("name", type=click.Choice(sorted(CATALOG), case_sensitive=False), metavar="NAME")
@click.option("--pty", is_flag=True, help="On a pseudo terminal (there is no other place yet).")
@click.option("--state", type=click.Path(dir_okay=False, path_type=Path), help="Keeps EEPROM and flash.")
@click.option("--operate", is_flag=True, help="Without the set-up jumper: the EEPROM's baud rate.")
@click.option("--crc-off", is_flag=True, help="Old firmware whose CRC is switched off.")
@click.option("--unit", type=int, help="Unit number.")
def emulate_remote(
    name: str, pty: bool, state: Path | None, operate: bool, crc_off: bool, unit: int | None
) -> None:
    """Serve an emulated remote on a pseudo terminal.

    NAME is 8i20, 7i77-io, 7i77-analog, 7i64 or another of the catalogue. Prints `ready PATH` when PATH can be
    opened as a serial port. Commands on standard input, one a line: power-cycle, setup, operate (jumper,
    power cycle), crc on, crc off, set NAME VALUE, get NAME, quit. SIGUSR1 cycles the power; SIGINT and
    SIGTERM end it with status 0.

    \b
    Examples:
      hm2 emulate-remote 8i20 --pty
      hm2 emulate-remote 7i77-io --pty --state 7i77.json
    """
    if not pty:
        raise click.UsageError("where? --pty puts it on a pseudo terminal")
    emulated = remote(name, unit_number=unit, setup_jumper=not operate)
    if crc_off and "NVCRCENABLE" in emulated.parameters:
        emulated.set_raw("NVCRCENABLE", 0)
        emulated.power_cycle()
    elif crc_off:
        emulated.crc = False
    kept = RemoteState(emulated, state, name.lower()) if state else None
    serve(emulated, kept, ready=lambda path: click.echo(f"ready {path}"))
