"""The configuration flash of an Ethernet card: read, verify, back up, write the user image.

Nothing here touches the boot block, the fallback image, or anything else below the user area: a card whose
user image is bad still boots its fallback. Fact sheet lbp16.md 5, 6.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from hostmot2 import flash_layout, lbp16
from hostmot2.bitfile import Bitfile, check_part
from hostmot2.errors import BitfileError, FlashError, TransportTimeout
from hostmot2.ethernet.service import EthernetService, is_efinix
from hostmot2.flash_layout import PAGE_SIZE, SECTOR_SIZE
from hostmot2.registers import Lbp16Control, Lbp16Flash, Lbp16Key, Lbp16Space
from hostmot2.transports.udp import UdpLink

_ADDRESS, _DATA = Lbp16Flash.address.number, Lbp16Flash.data.number
_ID, _ERASE = Lbp16Flash.id.number, Lbp16Flash.erase.number
_KEY: Final = Lbp16Key.FLASH
_READ_BYTES: Final = 1024
_ERASE_TIMEOUT: Final = 5.0
_ATTEMPTS: Final = 4
_CUT_SHORT: Final = (
    "the user area may not be whole: write again before a reload or power-down, else the fallback boots"
)

Progress = Callable[[str, int, int], None]
"""Called with what is done (`erase`, `write`, `verify`, `read`), bytes done, bytes in all."""


def _silent(_what: str, _done: int, _total: int) -> None:
    """No progress report."""


@dataclass(frozen=True)
class FlashInfo:
    """What the flash is and whether its boot block is as shipped."""

    card: str
    part: str
    flash_id: int
    size: int
    user_address: int
    user_size: int
    boot_block_ok: bool | None
    """None for Efinix cards, which have none."""


class Flash:
    """The flash behind a link. One thread at a time."""

    def __init__(self, link: UdpLink) -> None:
        self.link = link
        self._info: FlashInfo | None = None

    def info(self) -> FlashInfo:
        """Card, part, size, boot block. Raises FlashError for a board or flash this driver does not know."""
        if self._info is None:
            facts = EthernetService(self.link).facts()
            if facts.part is None:
                raise FlashError(f"{facts.name} is not known: what its flash must hold is not either")
            (flash_id,) = struct.unpack("<I", self._repeat(lbp16.read(Lbp16Space.FLASH, _ID)))
            try:
                size, user = flash_layout.flash_size(flash_id), flash_layout.user_address(flash_id)
            except ValueError as error:
                raise FlashError(f"{facts.name}: {error}") from None
            boot = None
            if not is_efinix(facts.part):
                boot = self.read(0, flash_layout.BOOT_BLOCK_SIZE) == flash_layout.boot_block(user)
            self._info = FlashInfo(facts.name, facts.part, flash_id, size, user, size - user, boot)
        return self._info

    def read(self, address: int, count: int, progress: Progress = _silent) -> bytes:
        """`count` bytes from a flash address on. Raises TransportTimeout."""
        data = bytearray()
        while len(data) < count:
            size = min(_READ_BYTES, -(-(count - len(data)) // 4) * 4)
            data += self._read_block(address + len(data), size)
            progress("read", min(len(data), count), count)
        return bytes(data[:count])

    def backup(self, progress: Progress = _silent) -> bytes:
        """The whole device."""
        return self.read(0, self.info().size, progress)

    def verify(self, image: Bitfile, progress: Progress = _silent) -> None:
        """The user area must hold the image. Raises FlashError with the first difference."""
        self.check(image)
        start = self.info().user_address
        for offset in range(0, len(image.data), _READ_BYTES):
            wanted = image.data[offset : offset + _READ_BYTES]
            got = self.read(start + offset, len(wanted))
            if got != wanted:
                at = next(i for i, (a, b) in enumerate(zip(got, wanted, strict=True)) if a != b)
                raise FlashError(
                    f"flash 0x{start + offset + at:06X} is 0x{got[at]:02X}, the image has 0x{wanted[at]:02X}",
                    address=start + offset + at,
                    expected=wanted[at],
                    received=got[at],
                )
            progress("verify", offset + len(wanted), len(image.data))

    def check(self, image: Bitfile) -> FlashInfo:
        """Whether the image belongs on this card and fits. Raises BitfileError, FlashError."""
        info = self.info()
        check_part(image, info.part)
        if info.boot_block_ok is False:
            raise FlashError(f"{info.card}: the boot block is not as shipped; its fallback might not boot")
        if len(image.data) > info.user_size:
            raise BitfileError(f"the image has {len(image.data)} bytes, the user area {info.user_size}")
        return info

    def write(self, image: Bitfile, *, dry_run: bool = False, progress: Progress = _silent) -> int:
        """Erase the user area as far as needed, write the image, verify. Returns the number of sectors.

        dry_run makes all checks and changes nothing. The FPGA goes on with its old image until a reload.
        Cut short, also by Ctrl-C, it leaves an image that does not boot; a note on the exception says so.
        Raises BitfileError (not for this card), FlashError (boot block, or the verify failed),
        TransportTimeout.
        """
        info = self.check(image)
        sectors = list(range(0, len(image.data), SECTOR_SIZE))
        if dry_run:
            return len(sectors)
        try:
            for offset in sectors:
                self._erase(info.user_address + offset)
                progress("erase", min(offset + SECTOR_SIZE, len(image.data)), len(image.data))
            for offset, page in _pages(image.data):
                if page.strip(b"\xff"):
                    self._write_page(info.user_address + offset, page)
                progress("write", min(offset + PAGE_SIZE, len(image.data)), len(image.data))
            self.verify(image, progress)
        except BaseException as failure:  # Ctrl-C, too
            failure.add_note(_CUT_SHORT)
            raise
        return len(sectors)

    def _guard(self, address: int) -> None:
        info = self.info()
        if not info.user_address <= address < info.size:
            raise FlashError(f"0x{address:06X} is outside the user area", address=address)

    def _erase(self, address: int) -> None:
        """Sector erase; safe to repeat, nothing has been written into it yet."""
        self._guard(address)
        erase = lbp16.write(Lbp16Space.CONTROL, Lbp16Control.write_key.number, [_KEY]) + lbp16.write(
            Lbp16Space.FLASH, _ERASE, [0]
        )
        self._steps(address, erase, address)

    def _write_page(self, address: int, page: bytes) -> None:
        """Program a page; safe to repeat, the same bits are cleared again."""
        self._guard(address)
        words = list(struct.unpack("<64I", page))
        data = lbp16.write(Lbp16Space.CONTROL, Lbp16Control.write_key.number, [_KEY]) + lbp16.write(
            Lbp16Space.FLASH, _DATA, words, increment=False
        )
        self._steps(address, data, address + PAGE_SIZE)

    def _steps(self, address: int, action: bytes, address_after: int) -> None:
        """Address, action, and a read of the address, which waits until the flash is done."""
        for attempt in range(_ATTEMPTS):
            try:
                self.link.exchange(lbp16.write(Lbp16Space.FLASH, _ADDRESS, [address]))
                self.link.exchange(action, timeout=_ERASE_TIMEOUT)
                (stands,) = struct.unpack(
                    "<I", self.link.exchange(lbp16.read(Lbp16Space.FLASH, _ADDRESS), timeout=_ERASE_TIMEOUT)
                )
            except TransportTimeout:
                if attempt == _ATTEMPTS - 1:
                    raise
            else:
                if stands == address_after:
                    return
        raise FlashError(
            f"flash address is 0x{stands:06X} after an access at 0x{address:06X}",
            address=address,
            expected=address_after,
            received=stands,
        )

    def _read_block(self, address: int, size: int) -> bytes:
        """In one datagram that sets the address itself, so that it can be repeated."""
        commands = lbp16.write(Lbp16Space.FLASH, _ADDRESS, [address])
        for count in _split(size // 4):
            commands += lbp16.read(Lbp16Space.FLASH, _DATA, count, increment=False)
        return self._repeat(commands)

    def _repeat(self, commands: bytes) -> bytes:
        for _ in range(_ATTEMPTS - 1):
            try:
                return self.link.exchange(commands)
            except TransportTimeout:
                continue
        return self.link.exchange(commands)


def _split(words: int) -> Iterator[int]:
    while words:
        count = min(words, lbp16.MAX_COUNT)
        yield count
        words -= count


def _pages(data: bytes) -> Iterator[tuple[int, bytes]]:
    for offset in range(0, len(data), PAGE_SIZE):
        yield offset, data[offset : offset + PAGE_SIZE].ljust(PAGE_SIZE, b"\xff")
