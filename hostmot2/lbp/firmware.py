"""A remote's firmware update, block by block. Source: lbp_serial.md 7, 7.2.

Block 0 holds the boot loader: it keeps LBP alive whatever happens to the others, and is never touched.
Nothing is changed before everything has been checked; a block that fails is done again, from its erasure.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hostmot2.lbp.client import LbpRemote
from hostmot2.lbp.errors import (
    FirmwareRefused,
    LbpError,
    RemoteRefused,
    UpdateFailed,
    WrongAnswer,
    status_names,
)
from hostmot2.registers import LbpCapability, LbpLocal, LbpSpace, LbpStatus

WINDOW_OFFSET, WINDOW_ERASE, WINDOW_WRITE, WINDOW_COMMIT = 0x8000, 0x8004, 0x8005, 0x8007
COMMIT_WRITE, COMMIT_ERASE = 0xFD, 0xFE

LARGEST_FILE = 1 << 20
ERASE_LOG2 = range(8, 17)
WRITE_LOG2 = range(3, 13)
BLOCK_TRIES = 3
FILL_TRIES = 8

Progress = Callable[[int, int], None]
"""Blocks done and blocks in all, called after each."""


@dataclass(frozen=True)
class Firmware:
    """A flat image: file offset is flash offset."""

    path: Path
    data: bytes

    @property
    def digest(self) -> str:
        """SHA-256, by which a resumed update knows its file."""
        return hashlib.sha256(self.data).hexdigest()

    def block(self, index: int, size: int) -> bytes:
        """One erase block; behind the end of the file are zeros."""
        return self.data[index * size : (index + 1) * size].ljust(size, b"\0")


@dataclass(frozen=True, slots=True)
class Plan:
    """What an update would do. blocks: indices of the erase blocks that hold something, block 0 never."""

    name: str
    unit_number: int
    erase_size: int
    write_size: int
    blocks: tuple[int, ...]
    skipped: int

    @property
    def size(self) -> int:
        """Bytes that are erased and written."""
        return len(self.blocks) * self.erase_size


def read_firmware(path: Path) -> Firmware:
    """The file. Raises FirmwareRefused for one that is no firmware by its name or size, OSError."""
    if path.suffix.upper() != ".BIN":
        raise FirmwareRefused(f"{path.name}: firmware files are called .BIN")
    with path.open("rb") as file:
        data = file.read(LARGEST_FILE + 1)
    if len(data) > LARGEST_FILE:
        raise FirmwareRefused(f"{path.name}: firmware has at most {LARGEST_FILE} bytes")
    if not any(data):
        raise FirmwareRefused(f"{path.name}: nothing but zeros")
    return Firmware(path, data)


def plan(remote: LbpRemote, firmware: Firmware) -> Plan:
    """Check remote and file against each other; changes nothing. Raises FirmwareRefused, LbpError."""
    for _ in range(2):
        remote.sync()
    status = remote.status & ~LbpStatus.WATCHDOG
    if status:
        raise FirmwareRefused(f"{remote}: LBP status not clean: {status_names(status)}", received=status)
    name = remote.name
    if not name or name.upper() not in firmware.path.stem.upper():
        raise FirmwareRefused(f"{firmware.path.name} is not for a {name or 'remote without a name'}")
    _check_capability(remote)
    erase_size, write_size = _sizes(remote)
    if len(firmware.data) <= erase_size:
        raise FirmwareRefused(
            f"{firmware.path.name}: {len(firmware.data)} bytes are no more than the boot block"
        )
    count = -(-len(firmware.data) // erase_size)
    blocks = tuple(b for b in range(1, count) if any(firmware.block(b, erase_size)))
    if not blocks:
        raise FirmwareRefused(f"{firmware.path.name}: nothing behind the boot block")
    return Plan(name, remote.unit_number, erase_size, write_size, blocks, count - 1 - len(blocks))


def _check_capability(remote: LbpRemote) -> None:
    try:
        capability = remote.read_local(LbpLocal.capability)
    except RemoteRefused:
        return  # older remotes do not tell
    if capability and not capability & LbpCapability.FLASH:
        raise FirmwareRefused(f"{remote}: has no flash to write (capability 0x{capability:02X})")


def _sizes(remote: LbpRemote) -> tuple[int, int]:
    try:
        with remote.memory_space(LbpSpace.FLASH):
            write = remote.read_remote(WINDOW_WRITE, space=LbpSpace.FLASH)
            erase = remote.read_remote(WINDOW_ERASE, space=LbpSpace.FLASH)
    except RemoteRefused as refusal:
        raise FirmwareRefused(f"{remote}: does not open its flash") from refusal
    if erase not in ERASE_LOG2 or write not in WRITE_LOG2 or write > erase:
        raise FirmwareRefused(f"{remote}: blocks of 2^{erase} (erase) and 2^{write} (write) bytes cannot be")
    return 1 << erase, 1 << write


def update(
    remote: LbpRemote, firmware: Firmware, todo: Plan, *, done: int = 0, progress: Progress | None = None
) -> None:
    """Write the planned blocks. done: so many of them were written by an update before.

    A block is tried three times. Raises UpdateFailed (its `block` is the first that was not written); the
    remote then needs the update again, its boot loader is as it was.
    """
    for position, block in enumerate(todo.blocks[done:], done):
        data = firmware.block(block, todo.erase_size)
        last: LbpError | None = None
        for _ in range(BLOCK_TRIES):
            try:
                _write_block(remote, block * todo.erase_size, data, todo.write_size)
                break
            except LbpError as failure:
                last = failure
        else:
            failed = UpdateFailed(f"{remote}: block {block} was not written: {last}", index=block)
            failed.block = block
            raise failed from last
        if progress is not None:
            progress(position + 1, len(todo.blocks))


def _write_block(remote: LbpRemote, offset: int, data: bytes, write_size: int) -> None:
    """Erase one block and write it chunk by chunk; the remote's cookie tells when each is done."""
    if offset < len(data):
        raise ValueError("block 0 holds the boot loader")
    with remote.memory_space(LbpSpace.FLASH):
        remote.write_remote(WINDOW_OFFSET, offset, 4, space=LbpSpace.FLASH)
        remote.commit(WINDOW_COMMIT, COMMIT_ERASE, space=LbpSpace.FLASH)
    with remote.memory_space(LbpSpace.FLASH):
        for at in range(0, len(data), write_size):
            _fill(remote, offset + at, data[at : at + write_size])
            remote.commit(WINDOW_COMMIT, COMMIT_WRITE, space=LbpSpace.FLASH)


def _fill(remote: LbpRemote, offset: int, chunk: bytes) -> None:
    """Write buffer and offset with nothing in between that might have cost the buffer."""
    for _ in range(FILL_TRIES):
        remote.write_block(0, chunk, space=LbpSpace.FLASH)
        before = remote.link.counters.resyncs
        remote.write_remote(WINDOW_OFFSET, offset, 4, space=LbpSpace.FLASH)
        if remote.link.counters.resyncs == before:
            return
    raise WrongAnswer(f"{remote}: too much noise to write flash")
