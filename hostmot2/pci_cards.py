"""PCI cards with HostMot2: their ids, and finding them under sysfs.

Source: fact sheet boards 2 and 2.1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SYSFS = Path("/sys")
_MESA = 0x2718
_PLX = 0x10B5
_BAR_OF_BRIDGE = {(_PLX, 0x9030): 5, (_PLX, 0x9054): 3, (_PLX, 0x9056): 3}
MEMORY = 0x200
"""Flag of a memory BAR in sysfs's `resource`."""


@dataclass(frozen=True, slots=True)
class PciId:
    """What identifies a board. Subsystem ids of None match any."""

    model: str
    vendor: int
    device: int
    subsystem_vendor: int | None
    subsystem_device: int | None

    @property
    def bar(self) -> int:
        """The BAR that holds the 64 KiB register file: by bridge chip, 0 where the FPGA is the PCI device."""
        return _BAR_OF_BRIDGE.get((self.vendor, self.device), 0)


def _mesa(model: str, device: int, subsystem: bool = True) -> PciId:
    return PciId(model, _MESA, device, *((_MESA, device) if subsystem else (None, None)))


PCI_IDS: tuple[PciId, ...] = (
    PciId("5I20", _PLX, 0x9030, _PLX, 0x3131),
    PciId("4I65", _PLX, 0x9030, _PLX, 0x3132),
    PciId("4I68", _PLX, 0x9054, _PLX, 0x3311),
    PciId("4I68", _PLX, 0x9054, _PLX, 0x3133),  # the old id
    PciId("5I21", _PLX, 0x9054, _PLX, 0x3312),
    PciId("5I22-1.5M", _PLX, 0x9054, _PLX, 0x3313),
    PciId("5I22-1.0M", _PLX, 0x9054, _PLX, 0x3314),
    PciId("5I23", _PLX, 0x9054, _PLX, 0x3315),
    PciId("4I69-16", _PLX, 0x9054, _PLX, 0x3472),
    PciId("4I69-25", _PLX, 0x9054, _PLX, 0x3473),
    PciId("3X20-1.0M", _PLX, 0x9056, _PLX, 0x3427),
    PciId("3X20-1.5M", _PLX, 0x9056, _PLX, 0x3428),
    PciId("3X20-2.0M", _PLX, 0x9056, _PLX, 0x3429),
    _mesa("4I74", 0x4174),
    _mesa("5I24", 0x5124),
    _mesa("5I25", 0x5125),
    _mesa("5I25T", 0x5925),
    _mesa("6I24", 0x6124, subsystem=False),
    _mesa("6I25", 0x6125),
    _mesa("6I25T", 0x6925),
)
"""Every PCI board; 5I71 (10B5:8112) is only listed by the sources, without a BAR."""


@dataclass(frozen=True, slots=True)
class PciCard:
    """A card in this machine. address: domain:bus:device.function."""

    address: str
    id: PciId
    directory: Path

    @property
    def model(self) -> str:
        """The board's name, such as "5I25"."""
        return self.id.model

    @property
    def url(self) -> str:
        """What hostmot2.open takes."""
        return f"pci://{self.address}"

    @property
    def registers(self) -> Path:
        """The file to map: the BAR with the register file."""
        return self.directory / f"resource{self.id.bar}"

    def bar_size(self) -> int:
        """Bytes of the register BAR as the kernel sees it; 0 if it is not assigned or not memory."""
        line = (self.directory / "resource").read_text().splitlines()[self.id.bar]
        start, end, flags = (int(field, 16) for field in line.split())
        return end - start + 1 if end > start and flags & MEMORY else 0


def find_cards(sysfs: Path = SYSFS) -> list[PciCard]:
    """All PCI cards with HostMot2 in this machine, by address. Nothing is opened; any user may ask."""
    return sorted(_cards(sysfs / "bus" / "pci" / "devices"), key=lambda card: card.address)


def _cards(devices: Path) -> Iterator[PciCard]:
    if not devices.is_dir():
        return
    for directory in devices.iterdir():
        for row in PCI_IDS:
            if _matches(directory, row):
                yield PciCard(directory.name, row, directory)


def _matches(directory: Path, row: PciId) -> bool:
    wanted = {
        "vendor": row.vendor,
        "device": row.device,
        "subsystem_vendor": row.subsystem_vendor,
        "subsystem_device": row.subsystem_device,
    }
    return all(value is None or _hex_file(directory / name) == value for name, value in wanted.items())


def _hex_file(path: Path) -> int | None:
    try:
        return int(path.read_text(), 16)
    except (OSError, ValueError):
        return None  # gone since the directory was listed, or not a PCI device


def udev_rules(group: str = "hostmot2") -> str:
    """Rules that let `group` use the cards: memory decoding on, register BAR readable and writable.

    Only root may switch memory decoding on, so the rule does it when the card appears.
    """
    lines = ["# PCI cards with HostMot2 firmware, for /etc/udev/rules.d/; then: udevadm trigger --action=add"]
    for row in PCI_IDS:
        match = f'ATTR{{vendor}}=="0x{row.vendor:04x}", ATTR{{device}}=="0x{row.device:04x}"'
        if row.vendor != _MESA:  # the bridge chip is on many cards that are not ours
            match += f', ATTR{{subsystem_device}}=="0x{row.subsystem_device:04x}"'
        file = f"/sys%p/resource{row.bar}"
        run = f"/bin/sh -c 'echo 1 > /sys%p/enable; chgrp {group} {file}; chmod g+rw {file}'"
        lines += [f"# {row.model}", f'ACTION=="add", SUBSYSTEM=="pci", {match}, RUN+="{run}"']
    return "\n".join(lines) + "\n"
