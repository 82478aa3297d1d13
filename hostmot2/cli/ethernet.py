"""hm2 discover, ip, reload, flash: Ethernet cards beside their HostMot2 registers."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from urllib.parse import urlsplit

import click

from hostmot2.bitfile import Bitfile, read_bitfile
from hostmot2.cli.adapters import report_adapters
from hostmot2.cli.progress import stages
from hostmot2.cli.session import Session, reports, rows
from hostmot2.errors import BoardError
from hostmot2.ethernet import EthernetService, Flash, discover
from hostmot2.ethernet.discovery import DEFAULT_ADDRESSES
from hostmot2.ethernet.service import JUMPERS
from hostmot2.lbp16 import PORT
from hostmot2.modules.driven import raise_if_driven
from hostmot2.pci_cards import find_cards
from hostmot2.transports.udp import UdpLink
from hostmot2.whole_file import whole_file


@contextmanager
def _link(session: Session) -> Iterator[UdpLink]:
    url = urlsplit(session.board_url())
    if url.scheme != "udp" or not url.hostname:
        raise click.UsageError("this is for Ethernet cards: --board udp://HOST[:PORT]")
    link = UdpLink(url.hostname, url.port or PORT)
    try:
        yield link
    finally:
        link.close()


def _raise_if_driven(session: Session) -> None:
    """CardBusy if another program drives the card; firmware that cannot be opened is driven by nobody."""
    with suppress(BoardError), session.board(read_only=True) as board:
        raise_if_driven(board)


@click.command("discover")
@click.argument("addresses", nargs=-1)
@click.option("--subnet", "subnets", multiple=True, metavar="CIDR", help="Ask every host of this network.")
@click.option("--interface", "interfaces", multiple=True, metavar="NAME", help="And of this interface's.")
@click.option("--timeout", type=click.FloatRange(0.01, 60), default=0.3, show_default=True, metavar="S")
@click.option("--port", type=click.IntRange(1, 65535), default=PORT, show_default=True)
@click.option("--serial", is_flag=True, help="List serial and USB adapters instead.")
@reports
@click.pass_context
def discover_cards(
    context: click.Context,
    session: Session,
    addresses: tuple[str, ...],
    subnets: tuple[str, ...],
    interfaces: tuple[str, ...],
    timeout: float,
    port: int,
    serial: bool,
) -> None:
    """Find Ethernet and PCI cards; 3 when there are none.

    ADDRESSES in place of the two that cards are shipped with (192.168.1.121 and 10.10.10.10). The ARP table
    is looked through for cards, too. Nothing is written to any card.

    \b
    Examples:
      hm2 discover
      hm2 discover 10.10.10.10
      hm2 discover --subnet 192.168.1.0/24
      hm2 discover --serial
    """
    if serial:
        report_adapters(context, session)
        return
    with stages() as advance:
        found = discover(
            addresses or DEFAULT_ADDRESSES,
            subnets=subnets,
            interface_names=interfaces,
            timeout=timeout,
            port=port,
            progress=advance,
        )
    pci = find_cards()
    lines = [(card.url, card.name or "?", card.mac) for card in found.cards]
    lines += [(card.url, card.model, "") for card in pci]
    document = {
        "cards": [asdict(card) for card in found.cards]
        + [{"url": card.url, "name": card.model} for card in pci],
        "asked": found.asked,
        "hints": found.hints,
    }
    shown = [rows(("card", "name", "MAC"), lines)] if lines else [f"no card among {found.asked} addresses"]
    session.report(document, *shown, *found.hints)
    if not lines:
        context.exit(3)


@click.command("ip")
@click.argument("address", required=False)
@click.option("--yes", is_flag=True, help="Write ADDRESS.")
@reports
def ip(session: Session, address: str | None, yes: bool) -> None:
    """Who the card is and where; or store ADDRESS in it.

    ADDRESS goes into its EEPROM and holds from the next power-up or engine reset, with the jumpers on EEPROM.

    \b
    Examples:
      hm2 --board udp://192.168.1.121 ip
      hm2 --board udp://192.168.1.121 ip 10.10.10.10 --yes
    """
    with _link(session) as link:
        service = EthernetService(link)
        if address and not yes:
            raise click.UsageError(f"writing {address} to the card's EEPROM needs --yes")
        if address:
            service.set_ip(address)
        facts, counters, stamps = service.facts(), service.counters(), service.time_stamps()
        lines = [
            ("name", facts.name),
            ("MAC", facts.mac),
            ("EEPROM address", facts.eeprom_ip),
            ("IP jumpers at boot", JUMPERS[facts.jumpers & 3]),
            ("LBP16 version", facts.lbp_version),
            ("firmware version", facts.firmware_version),
            ("FPGA", facts.part),
            ("error flags", f"0x{counters.error_flags:02X}"),
            (
                "errors",
                f"parse {counters.parse_errors}, memory {counters.memory_errors}, "
                f"write {counters.write_errors}",
            ),
            ("received", f"{counters.received}, LBP {counters.received_lbp}, bad {counters.received_bad}"),
            ("sent", f"{counters.sent}, LBP {counters.sent_lbp}, bad {counters.sent_bad}"),
        ]
        document = {"card": asdict(facts), "counters": asdict(counters), "time_stamps": asdict(stamps)}
        session.report(document, rows((), lines))


@click.command("reload")
@click.option("--fallback", is_flag=True, help="The fallback image instead of the user's.")
@click.option("--engine", is_flag=True, help="Restart the Ethernet engine only; the FPGA goes on.")
@click.option("--yes", is_flag=True, help="Do it: a reload switches all outputs off.")
@reports
def reload(session: Session, fallback: bool, engine: bool, yes: bool) -> None:
    """Configure the FPGA anew from its flash; wait for the card. Not while another program drives it.

    \b
    Examples:
      hm2 --board udp://10.10.10.10 reload --yes
      hm2 --board udp://10.10.10.10 reload --fallback --yes
      hm2 --board udp://10.10.10.10 reload --engine --yes
    """
    if not yes:
        raise click.UsageError("a reload switches the card's outputs off: --yes")
    with _link(session) as link:
        _raise_if_driven(session)
        service = EthernetService(link)
        if engine:
            service.reset()
        else:
            service.reload(fallback=fallback)
        facts = service.facts()
    session.report({"reloaded": facts.name}, f"{facts.name} is back")


@click.group()
def flash() -> None:
    """The FPGA's configuration flash of an Ethernet card.

    Only the user area is ever written: boot block and fallback image stay.
    """


@flash.command()
@reports
def info(session: Session) -> None:
    """Size, user area and boot block.

    \b
    Examples:
      hm2 --board udp://10.10.10.10 flash info
    """
    with _link(session) as link:
        found = Flash(link).info()
    boot = {None: "none", True: "as shipped", False: "NOT as shipped"}[found.boot_block_ok]
    lines = [
        ("card", f"{found.card}, {found.part}"),
        ("flash", f"{found.size // 1024} KiB (id 0x{found.flash_id:02X})"),
        ("user area", f"0x{found.user_address:06X}, {found.user_size // 1024} KiB"),
        ("boot block", boot),
    ]
    session.report(asdict(found), rows((), lines))


@flash.command()
@click.option("-o", "output", type=click.Path(path_type=Path), required=True)
@reports
def backup(session: Session, output: Path) -> None:
    """Copy the whole flash to a file, with its SHA-256 beside it.

    \b
    Examples:
      hm2 --board udp://10.10.10.10 flash backup -o flash.bin
    """
    with _link(session) as link, stages() as advance:
        data = Flash(link).backup(advance)
    with whole_file(output) as place:
        place.write_bytes(data)
    digest = hashlib.sha256(data).hexdigest()
    output.with_name(output.name + ".sha256").write_text(f"{digest} *./{output.name}\n")
    session.report({"file": output, "bytes": len(data), "sha256": digest}, f"{len(data)} bytes to {output}")


def _image(path: Path) -> Bitfile:
    image = read_bitfile(path)
    for warning in image.warnings:
        click.echo(f"hm2: {path}: {warning}", err=True)
    return image


@flash.command()
@click.argument("file", type=click.Path(path_type=Path))
@reports
def verify(session: Session, file: Path) -> None:
    """Compare the user area with an image.

    \b
    Examples:
      hm2 --board udp://10.10.10.10 flash verify 7i92_7i77.bit
    """
    image = _image(file)
    with _link(session) as link, stages() as advance:
        Flash(link).verify(image, advance)
    session.report({"verified": len(image.data)}, f"{len(image.data)} bytes are as in {file}")


@flash.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--dry-run", is_flag=True, help="Make all checks, change nothing.")
@click.option("--yes", is_flag=True, help="Do it.")
@reports
def write(session: Session, file: Path, dry_run: bool, yes: bool) -> None:
    """Write an image to the user area and verify it.

    It runs from the next `hm2 reload` or power-up. Not while another program drives the card: erasing stops
    the card's answers for so long that its watchdog bites.

    \b
    Examples:
      hm2 --board udp://10.10.10.10 flash write 7i92_7i77.bit --dry-run
      hm2 --board udp://10.10.10.10 flash write 7i92_7i77.bit --yes
    """
    if not (dry_run or yes):
        raise click.UsageError("writing the flash needs --yes (or --dry-run)")
    image = _image(file)
    with _link(session) as link, stages() as advance:
        if not dry_run:
            _raise_if_driven(session)
        sectors = Flash(link).write(image, dry_run=dry_run, progress=advance)
    what = "would be written" if dry_run else "written and verified"
    document = {"sectors": sectors, "bytes": len(image.data), "dry_run": dry_run}
    session.report(document, f"{len(image.data)} bytes in {sectors} sectors {what}")
