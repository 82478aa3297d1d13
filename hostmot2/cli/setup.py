"""hm2 setup: the files a machine needs, printed, or installed with --write."""

from __future__ import annotations

from pathlib import Path

import click

from hostmot2.cli.session import Session, reports
from hostmot2.pci_cards import udev_rules

UDEV_RULES = Path("/etc/udev/rules.d/70-hostmot2.rules")


@click.group()
def setup() -> None:
    """Files this machine needs: printed, or installed."""


@setup.command()
@click.option("--group", default="hostmot2", show_default=True, help="Who may use the cards.")
@click.option("--write", is_flag=True, help=f"Install as {UDEV_RULES} (needs root).")
@reports
def udev(session: Session, group: str, write: bool) -> None:
    """Let a group use PCI cards without being root.

    \b
    Examples:
      hm2 setup udev
      hm2 setup udev --group machinists --write
    """
    rules = udev_rules(group)
    if write:
        UDEV_RULES.write_text(rules)
    then = [
        f"groupadd -f {group}",
        f"usermod -a -G {group} YOUR_NAME   # then log in anew",
        "udevadm control --reload && udevadm trigger --action=add --subsystem-match=pci",
    ]
    document = {"file": str(UDEV_RULES), "written": write, "content": rules, "then": then}
    if write:
        session.report(document, f"wrote {UDEV_RULES}; now, as root:", *(f"  {line}" for line in then))
        return
    session.report(document, rules.rstrip())
    click.echo(f"hm2: for {UDEV_RULES}; --write installs it. Then, as root:", err=True)
    for line in then:
        click.echo(f"  {line}", err=True)
