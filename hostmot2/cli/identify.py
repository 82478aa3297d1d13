"""hm2 info, modules, pins: the IDROM in words."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from hostmot2.board import Board
from hostmot2.cli import daughter
from hostmot2.cli.session import Session, reports, rows
from hostmot2.idrom import ModuleDescriptor, PinDescriptor
from hostmot2.wiring import WIRING


@click.command()
@reports
def info(session: Session) -> None:
    """What the card is: names, clocks, ports.

    \b
    Examples:
      hm2 info
      hm2 --board pci:// info
      hm2 --board udp://10.10.10.10 --json info
    """
    with session.board() as board:
        idrom = board.idrom
        lines = [
            ("board", f"{board.name} ({idrom.board_name})"),
            ("at", board.url),
            ("firmware", f"{idrom.config_name}, IDROM type {idrom.type} at 0x{idrom.address:04X}"),
            ("FPGA", f"{idrom.fpga_size} kgates, {idrom.fpga_pins} pins"),
            ("I/O", f"{idrom.io_width} pins: {idrom.io_ports} ports of {idrom.port_width}"),
            ("clocks", f"ClockLow {idrom.clock_low / 1e6:g} MHz, ClockHigh {idrom.clock_high / 1e6:g} MHz"),
            ("modules", ", ".join(f"{_count(module)}{module.name}" for module in board.modules)),
        ]
        session.report(_info(board), rows((), lines))


def _count(module: ModuleDescriptor) -> str:
    return f"{module.instances} " if module.instances > 1 else ""


def _info(board: Board) -> dict[str, Any]:
    return {
        "url": board.url,
        "name": board.name,
        "idrom": asdict(board.idrom),
        "modules": {module.name: module.instances for module in board.modules},
        "pins": len(board.pins),
    }


@click.command()
@reports
def modules(session: Session) -> None:
    """Modules, instances and versions of the loaded firmware.

    \b
    Examples:
      hm2 modules
      hm2 --board emu://7i76e modules
    """
    header = ("module", "gtag", "version", "instances", "base", "registers", "clock")
    with session.board() as board:
        lines = [
            (
                module.name,
                f"0x{module.gtag:02X}",
                module.version if module.version < 10 else f"0x{module.version:02X}",
                module.instances,
                f"0x{module.base:04X}",
                module.num_registers,
                f"{module.clock / 1e6:g} MHz",
            )
            for module in board.modules
        ]
        document = [{"name": module.name} | asdict(module) for module in board.modules]
        session.report(document, rows(header, lines))


@click.command()
@click.argument("card", required=False, type=click.Choice(sorted(WIRING), case_sensitive=False))
@click.option("--connector", help="With CARD: this connector only, such as TB5.")
@click.option(
    "--svg", type=click.Path(dir_okay=False, path_type=Path), help="With CARD: draw it to this file."
)
@reports
def pins(session: Session, card: str | None, connector: str | None, svg: Path | None) -> None:
    """Where every I/O pin is, and which module can have it.

    With CARD: the terminals, jumpers, LEDs and limits of that daughter card, and what to check before
    power-up; no board is opened.

    \b
    Examples:
      hm2 pins
      hm2 pins 7i77 --connector TB5
      hm2 pins 8i20 --svg 8i20.svg
    """
    if card is not None:
        daughter.show(session, card, connector, svg)
        return
    if connector is not None or svg is not None:
        raise click.UsageError("--connector and --svg need a daughter card")
    with session.board() as board:
        lines = [(pin.index, _connector(pin), *_function(pin)) for pin in board.pins]
        document = [
            asdict(pin)
            | {
                "module": pin.module,
                "function": pin.function,
                "is_output": pin.is_output,
                "shared": pin.shared,
            }
            for pin in board.pins
        ]
        session.report(
            document, rows(("I/O", "connector", "module", "instance", "function", "direction"), lines)
        )


def _connector(pin: PinDescriptor) -> str:
    if not pin.connector:
        return ""
    return pin.connector if pin.connector_pin is None else f"{pin.connector}-{pin.connector_pin}"


def _function(pin: PinDescriptor) -> tuple[object, ...]:
    if not pin.secondary_gtag:
        return "gpio", None, None, None
    instance = "all" if pin.shared else pin.secondary_unit
    return pin.module, instance, pin.function, "out" if pin.is_output else "in"
