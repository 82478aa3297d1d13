"""Cards and power saving for a group, without root: a udev rule."""

from __future__ import annotations

from pathlib import Path

from hostmot2.pci_cards import udev_rules
from hostmot2.setup.files import MachineFile, checked_name

RULES = Path("/etc/udev/rules.d/70-hostmot2.rules")


def udev_files(group: str) -> tuple[list[MachineFile], list[str]]:
    """The rule, and what to do as root once it is installed. Raises ValueError for a name that cannot be."""
    checked_name(group, "group")
    body = (
        udev_rules(group)
        + "# power saving: a program that holds this file open with 0 keeps processors from deep sleep\n"
        f'KERNEL=="cpu_dma_latency", SUBSYSTEM=="misc", GROUP="{group}", MODE="0660"\n'
    )
    then = [
        f"groupadd -f {group}",
        f"usermod -a -G {group} YOUR_NAME   # then log in anew",
        "udevadm control --reload",
        "udevadm trigger --action=add --subsystem-match=pci --subsystem-match=misc",
    ]
    return [MachineFile("udev", RULES, body)], then
