"""hm2 rpd, wpd: parameters of a remote behind a serial adapter, as Mesa's utilities of these names."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import click

from hostmot2.cli.parameter_text import document, in_unit, shown, warn_if_read_only
from hostmot2.cli.session import Session, reports
from hostmot2.lbp import ExchangeStream, LbpRemote, WireLink, parameters
from hostmot2.lbp.opening import SETUP_BAUD, open_remote

PORT_VARIABLE = "COMPORT"
RATES = (300, 12_000_000)
HEX = click.Choice(["h"], case_sensitive=False)

Command = Callable[..., Any]


def port_options(command: Command) -> Command:
    """--port and --baud, each with its environment variable."""
    port = click.option(
        "-p",
        "--port",
        metavar="PORT",
        help="/dev/ttyUSB0, ftdi:///1, emu:8i20. Else $COMPORT.",
    )
    baud = click.option(
        "--baud",
        type=click.IntRange(*RATES),
        help=f"Bits per second; else $BAUDRATE x $BAUDRATEMUL, else {SETUP_BAUD} (set-up jumper in place).",
    )
    return port(baud(command))


def port_name(port: str | None) -> str:
    """--port, else $COMPORT. Raises UsageError naming the adapters that are there."""
    name = port or os.environ.get(PORT_VARIABLE, "").strip()
    if name:
        return name
    from hostmot2.lbp.adapters import adapters

    here = ", ".join(adapter.port for adapter in adapters()) or "none found"
    raise click.UsageError(f"which adapter? --port or ${PORT_VARIABLE}; adapters here: {here}")


def line_rate(baud: int | None) -> int:
    """--baud, else the environment. UsageError for a PROTOCOL or INTERFACE that is not there."""
    if os.environ.get("PROTOCOL", "LBP").strip().upper() != "LBP":
        raise click.UsageError(f"$PROTOCOL is {os.environ['PROTOCOL']}; remotes speak LBP")
    if os.environ.get("INTERFACE", "OSDEVICE").strip().upper() != "OSDEVICE":
        raise click.UsageError(f"$INTERFACE is {os.environ['INTERFACE']}; ports are used as OSDEVICE only")
    if baud:
        return baud
    rate = _variable("BAUDRATE", SETUP_BAUD) * _variable("BAUDRATEMUL", 1)
    if not RATES[0] <= rate <= RATES[1]:
        raise click.UsageError(f"$BAUDRATE x $BAUDRATEMUL is {rate}, no rate from {RATES[0]} to {RATES[1]}")
    return rate


def _variable(name: str, default: int) -> int:
    text = os.environ.get(name, "").strip()
    if not text:
        return default
    if not text.isdigit() or not int(text):
        raise click.UsageError(f"${name} is {text!r}, not a number")
    return int(text)


@contextmanager
def remote_at(port: str | None, baud: int | None) -> Iterator[LbpRemote]:
    """The remote at the end of the line the user means; closed at the end."""
    name = port_name(port)
    rate = line_rate(baud)
    with _emulated(name[4:].lstrip("/")) if name.startswith("emu:") else open_remote(name, rate) as remote:
        yield remote


def _emulated(kind: str) -> LbpRemote:
    from hostmot2.emulator import catalog

    emulated = catalog.remote(kind, setup_jumper=True)
    return LbpRemote(WireLink(ExchangeStream(emulated.exchange, f"emu:{kind}")))


@click.command()
@click.argument("name")
@click.argument("hexadecimal", type=HEX, metavar="[H]", required=False)
@port_options
@reports
def rpd(session: Session, name: str, hexadecimal: str | None, port: str | None, baud: int | None) -> None:
    """Read parameter NAME of a remote; H: hexadecimal.

    Names in any capitals. The remote must be in set-up mode, or run at the rate given. Environment: COMPORT,
    BAUDRATE, BAUDRATEMUL, PROTOCOL=LBP, INTERFACE=OSDEVICE.

    \b
    Examples:
      hm2 rpd BUSV -p /dev/ttyUSB0
      hm2 rpd FAULT H -p emu:8i20
    """
    with remote_at(port, baud) as remote:
        parameter = parameters(remote).parameter(name)
        value = parameter.read()
        session.report(
            document(parameter, value) | {"remote": remote.name},
            f"{parameter.name} = {shown(parameter, value, hexadecimal=bool(hexadecimal))}",
        )


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("name")
@click.argument("value")
@click.argument("hexadecimal", type=HEX, metavar="[H]", required=False)
@click.option("--dry-run", is_flag=True, help="Check everything, write nothing.")
@port_options
@reports
def wpd(
    session: Session,
    name: str,
    value: str,
    hexadecimal: str | None,
    dry_run: bool,
    port: str | None,
    baud: int | None,
) -> None:
    """Write VALUE to parameter NAME of a remote; H: hexadecimal.

    The value is checked against type and range and read back. Parameters whose names start with NV are kept
    in EEPROM and take effect after a power cycle; one that holds the value already is not written.
    Environment as for rpd.

    \b
    Examples:
      hm2 wpd NVMAXCURRENT 2500 -p /dev/ttyUSB0
      hm2 wpd NVBRAKEONV 32000 --dry-run -p emu:8i20
    """
    with remote_at(port, baud) as remote:
        parameter = parameters(remote).parameter(name)
        warn_if_read_only(parameter)
        wanted = parameter.parse(value, hexadecimal=bool(hexadecimal))
        before = parameter.read()
        written = not dry_run and parameter.write(wanted)
        now = f"{parameter.name} = {shown(parameter, wanted, hexadecimal=bool(hexadecimal))}"
        was = parameter.format(before, hexadecimal=bool(hexadecimal))
        if dry_run and not (parameter.nonvolatile and before == wanted):
            said = f"would write {now}, is {was}{in_unit(parameter, before)}"
        elif not written:
            said = f"{now} already; EEPROM not rewritten"
        elif parameter.nonvolatile:
            said = f"{now}, was {was}; takes effect after a power cycle"
        else:
            said = f"{now}, was {was}"
        facts = document(parameter, wanted) | {"remote": remote.name, "before": before, "written": written}
        session.report(facts, said)
