"""A sysfs tree with PCI devices, made of plain files."""

from __future__ import annotations

import struct
from pathlib import Path

GOLDEN = Path(__file__).parent / "golden" / "card"


def image(board: str = "5I25") -> bytes:
    words = bytearray(0x10000)
    for line in (GOLDEN / "idrom_5i25_7i77x2.hex").read_text().splitlines():
        address, word = line.split()
        struct.pack_into("<I", words, int(address, 16), int(word, 16))
    words[0x410:0x414] = board.encode("ascii")
    return bytes(words)


def add_device(
    sysfs: Path,
    address: str,
    ids: tuple[int, int, int, int],
    *,
    bar: int = 0,
    size: int = 0x10000,
    command: int = 0,
    content: bytes | None = None,
) -> Path:
    """A PCI device as sysfs shows it, with one memory BAR."""
    directory = sysfs / "bus/pci/devices" / address
    directory.mkdir()
    for name, value in zip(("vendor", "device", "subsystem_vendor", "subsystem_device"), ids, strict=True):
        (directory / name).write_text(f"0x{value:04x}\n")
    lines = ["0x0000000000000000 0x0000000000000000 0x0000000000000000"] * 7
    if size:
        lines[bar] = f"0x{0xF7C00000:016x} 0x{0xF7C00000 + size - 1:016x} 0x0000000000040200"
    (directory / "resource").write_text("\n".join(lines) + "\n")
    config = bytearray(64)
    struct.pack_into("<HHH", config, 0, ids[0], ids[1], command)
    (directory / "config").write_bytes(config)
    (directory / "enable").write_text("0\n")
    if size:
        (directory / f"resource{bar}").write_bytes(image() if content is None else content)
    return directory


MESA_5I25 = (0x2718, 0x5125, 0x2718, 0x5125)
MESA_6I25 = (0x2718, 0x6125, 0x2718, 0x6125)
NETWORK_CARD = (0x10EC, 0x8168, 0x10EC, 0x0123)
SOMEBODYS_PLX = (0x10B5, 0x9054, 0x1234, 0x3315)
