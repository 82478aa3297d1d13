"""May this user reach the cards: PCI register files, serial adapters, and does the kernel let anybody."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hostmot2.doctor.finding import Finding, Verdict
from hostmot2.doctor.machine import Machine, group_name
from hostmot2.pci_cards import PciCard, find_cards

_SECURE_BOOT = "/sys/firmware/efi/efivars/SecureBoot-8be4df61-93ca-11d2-aa0d-00e098032b8c"
_SERIAL = ("/dev/ttyUSB*", "/dev/ttyACM*")


def access(machine: Machine) -> Iterator[Finding]:
    """All of it; nothing for kinds of cards that are not here."""
    cards = find_cards(machine.path("/sys"))
    yield from lockdown(machine, bool(cards))
    for card in cards:
        yield pci_card(machine, card)
    for pattern in _SERIAL:
        for path in machine.find(pattern):
            yield serial_port(machine, path)


def lockdown(machine: Machine, pci: bool) -> Iterator[Finding]:
    """Kernel lockdown keeps everybody from a PCI card's memory; Secure Boot usually brings it."""
    text = machine.text("/sys/kernel/security/lockdown")
    mode = text[text.index("[") + 1 : text.index("]")] if text and "[" in text else "none"
    boot = "Secure Boot on" if _secure_boot(machine) else "Secure Boot off or not there"
    if mode == "none":
        yield Finding("kernel lockdown", Verdict.GOOD, f"none, {boot}")
    elif pci:
        yield Finding(
            "kernel lockdown",
            Verdict.BLOCKS,
            f"{mode}, {boot}: nobody may map the memory of PCI cards",
            "Turn Secure Boot off in the firmware setup, or boot without lockdown= (hm2 explain E018).",
        )
    else:
        yield Finding("kernel lockdown", Verdict.GOOD, f"{mode}, {boot}: matters to PCI cards only")


def _secure_boot(machine: Machine) -> bool:
    try:
        return machine.path(_SECURE_BOOT).read_bytes()[-1:] == b"\1"  # four bytes of attributes before it
    except OSError:
        return False


def pci_card(machine: Machine, card: PciCard) -> Finding:
    """The card's register file, and whether the card decodes its addresses at all."""
    name = f"{card.model} at {card.address}"
    if not machine.may_write(card.registers):
        return Finding(
            name,
            Verdict.BLOCKS,
            f"{machine.user} may not read and write {card.registers.name} ({_owner(card.registers)})",
            _join(machine, card.registers, "hm2 setup udev --write gives the cards to a group"),
        )
    if not card.bar_size():
        return Finding(
            name,
            Verdict.BLOCKS,
            "its register BAR is not assigned",
            "Power-cycle the machine (hm2 explain E019).",
        )
    return Finding(name, Verdict.GOOD, f"{card.registers.name} may be read and written")


def serial_port(machine: Machine, path: Path) -> Finding:
    """A serial adapter's device file."""
    if machine.may_write(path):
        return Finding(f"/dev/{path.name}", Verdict.GOOD, "may be read and written")
    advice = _join(machine, path, f"Join the group: usermod -a -G {_group(path)} {machine.user}")
    return Finding(
        f"/dev/{path.name}", Verdict.BLOCKS, f"{machine.user} may not use it ({_owner(path)})", advice
    )


def _join(machine: Machine, path: Path, otherwise: str) -> str:
    """The user may be in the group already, but not in this session."""
    group = _group(path)
    members = machine.members(group)
    if members and machine.user in members and group not in machine.groups:
        return f"{machine.user} is in {group} since the last login: log in anew."
    return f"{otherwise}, then log in anew."


def _group(path: Path) -> str:
    try:
        return group_name(path.stat().st_gid)
    except OSError:
        return "?"


def _owner(path: Path) -> str:
    try:
        return f"group {_group(path)}, mode {path.stat().st_mode & 0o777:03o}"
    except OSError as reason:
        return str(reason.strerror)
