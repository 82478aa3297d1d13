"""hm2 setup: the files a machine needs, printed with each line explained, or installed with --write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from hostmot2.cli.session import Session, reports
from hostmot2.setup import ForeignFile, MachineFile, install, net_files, realtime_files, udev_files
from hostmot2.setup.net import ADDRESS

Command = Callable[..., Any]


@click.group()
def setup() -> None:
    """Files this machine needs: printed, or installed.

    Each line is explained where it stands. --write installs (as root); files that somebody else wrote or
    edited are left alone unless --force is given, and then kept beside the new ones.
    """


def _writing(command: Command) -> Command:
    """--write, --force, --root."""
    root = click.option(
        "--root", type=click.Path(path_type=Path), default=Path("/"), help="Install below this directory."
    )
    force = click.option("--force", is_flag=True, help="Replace files of others, too; they are kept.")
    write = click.option("--write", is_flag=True, help="Install (needs root).")
    return write(force(root(command)))


_GROUP = click.option("--group", default="hostmot2", show_default=True, help="Who may use the cards.")


@setup.command()
@_GROUP
@_writing
@reports
def udev(session: Session, group: str, write: bool, force: bool, root: Path) -> None:
    """Let a group use PCI cards without being root.

    \b
    Examples:
      hm2 setup udev
      hm2 setup udev --group machinists --write
    """
    _finish(session, *udev_files(group), write=write, force=force, root=root)


@setup.command()
@_GROUP
@click.option("--cpu", default="", metavar="LIST", help="Processors for services, such as 3 or 2-3.")
@click.option("--user", default="hostmot2", show_default=True, help="Whom services run as.")
@click.option("--directory", default="/opt/hostmot2", show_default=True, help="Where services' programs are.")
@_writing
@reports
def rt(
    session: Session,
    group: str,
    cpu: str,
    user: str,
    directory: str,
    write: bool,
    force: bool,
    root: Path,
) -> None:
    """Real-time limits for a group, and a systemd unit.

    \b
    Examples:
      hm2 setup rt
      hm2 setup rt --cpu 3 --write
    """
    made = realtime_files(group, cpu=cpu, user=user, directory=directory)
    _finish(session, *made, write=write, force=force, root=root)


@setup.command()
@click.argument("interface")
@click.option("--address", default=ADDRESS, show_default=True, help="This host's, in the card's network.")
@click.option("--mac", help="The interface's, if it is not in this machine.")
@_writing
@reports
def net(
    session: Session, interface: str, address: str, mac: str | None, write: bool, force: bool, root: Path
) -> None:
    """An interface for an Ethernet card alone.

    \b
    Examples:
      hm2 setup net enp2s0 --mac 00:11:22:33:44:55
      hm2 setup net enp2s0 --address 192.168.1.1/24 --write
    """
    found = mac or _mac_of(interface)
    if found is None:
        raise click.UsageError(f"there is no interface {interface} here; --mac tells which one is meant")
    _finish(session, *net_files(interface, found, address), write=write, force=force, root=root)


def _mac_of(interface: str) -> str | None:
    try:
        return Path(f"/sys/class/net/{interface}/address").read_text().strip()
    except OSError:
        return None


def _finish(
    session: Session, files: list[MachineFile], then: list[str], *, write: bool, force: bool, root: Path
) -> None:
    try:
        places = install(files, root=root, force=force) if write else []
    except ForeignFile as theirs:
        raise click.UsageError(str(theirs.args[0])) from theirs
    document = {
        "files": [{"file": str(file.path), "content": file.content} for file in files],
        "written": [str(place) for place in places],
        "then": then,
    }
    if write:
        session.report(document, *(f"wrote {place}" for place in places))
    else:
        session.report(document, *(f"{_title(file)}\n{file.content.rstrip()}" for file in files))
        click.echo("hm2: nothing was written; --write installs these files", err=True)
    click.echo("Then, as root:", err=True)
    for line in then:
        click.echo(f"  {line}", err=True)


def _title(file: MachineFile) -> str:
    return f"### {file.path}"
