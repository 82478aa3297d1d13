"""Where things lie in a card's configuration flash. Declarations only: driver and emulator share them.

Sources: fact sheets lbp16.md 6 and bitfile.md.
"""

from __future__ import annotations

import struct
from typing import Final

PAGE_SIZE: Final = 256
SECTOR_SIZE: Final = 0x10000
FALLBACK_ADDRESS: Final = 0x10000  # Xilinx; Efinix cards keep their fallback image at 0
BOOT_BLOCK_SIZE: Final = 64

SYNC_WORD: Final = b"\xaa\x99\x55\x66"
"""Starts every Xilinx configuration stream, within its first 64 bytes."""

_SIZES: Final = {0x10: 1, 0x11: 2, 0x12: 4, 0x13: 8, 0x14: 16, 0x15: 32}


def flash_size(flash_id: int) -> int:
    """Bytes of the part with this electronic signature; ValueError for one the sheets do not know."""
    if flash_id not in _SIZES:
        raise ValueError(f"flash id 0x{flash_id:02X} is not known (0x10 to 0x15 are)")
    return _SIZES[flash_id] << 17


def user_address(flash_id: int) -> int:
    """First byte of the user image: the second half of the part."""
    return flash_size(flash_id) // 2


def boot_block(user: int, fallback: int = FALLBACK_ADDRESS) -> bytes:
    """The 64 bytes at address 0 of a Xilinx card: try the user image, then the fallback image."""
    words = [0xFFFF] * 5 + [0xAA99, 0x5566]
    words += [0x31E1, 0xFFFF, 0x3261, user & 0xFFFF, 0x3281, 0x0B00 | user >> 16]
    words += [0x32A1, fallback & 0xFFFF, 0x32C1, 0x0B00 | fallback >> 16]
    words += [0x30A1, 0x0000, 0x3301, 0x2100, 0x3201, 0x001F, 0x30A1, 0x000E]
    words += [0x2000] * 7
    return struct.pack(">32H", *words)


def xilinx_reload_words(address: int) -> list[int]:
    """What the configuration port is fed to boot from a flash address (0: as at power-up)."""
    return [
        0xFFFF, 0xFFFF, 0xAA99, 0x5566, 0x3261, address & 0xFFFF, 0x3281, 0x0B00 | address >> 16,
        0x30A1, 0x000E, 0x2000, 0x2000, 0x2000, 0x2000,
    ]  # fmt: skip


def efinix_reload_words(fallback: bool) -> list[int]:
    """The same for T cards: select an image, start it."""
    return [0x0004, 0x000C] if fallback else [0x0005, 0x000D]
