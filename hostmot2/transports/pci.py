"""pci://: a PCI card, or a plain file or shared memory mapped the same way."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from urllib.parse import parse_qs, unquote, urlsplit

from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.card_lock import lock_file
from hostmot2.pci_cards import SYSFS, PciCard, find_cards
from hostmot2.transports.base import Transport

Lock = Callable[[str, str], int]
"""Locks a file for a card of that name; gives the descriptor to close in the end."""
_COMMAND = 4  # offset of the command register in configuration space
_COMMAND_MEMORY = 0x2


def open_transport(url: str) -> Transport:
    """Open `pci://` (the first card), `pci://0000:03:00.0` (that card) or `pci:///path` (a file).

    `?sysfs=DIR` looks for cards below DIR instead of /sys. The card is locked against other processes.

    Raises CardNotFound, CardBusy, PermissionDenied, KernelLockdown or MappingTooSmall, each naming the file.
    """
    return _open(url, _lock)


def open_unlocked(url: str) -> Transport:
    """The same without the lock, beside a process that drives the card: only to read. Errors as above."""
    return _open(url, _leave_unlocked)


def _open(url: str, lock: Lock) -> Transport:
    parts = urlsplit(url)
    if parts.path and parts.path != "/":
        return _open_file(unquote(parts.path), url, lock)
    sysfs = parse_qs(parts.query, strict_parsing=bool(parts.query)).get("sysfs", [str(SYSFS)])[0]
    return _open_card(_choose(parts.netloc, Path(sysfs)), url, lock)


def _choose(address: str, sysfs: Path) -> PciCard:
    cards = find_cards(sysfs)
    for card in cards:
        if address in ("", card.address, card.address.removeprefix("0000:")):
            return card
    seen = ", ".join(f"{card.address} ({card.model})" for card in cards) or "none at all"
    raise errors.CardNotFound(
        f"no HostMot2 card {f'at {address}' if address else 'on the PCI bus'}; found: {seen}"
    )


def _open_file(path: str, url: str, lock: Lock) -> Transport:
    descriptor = lock(path, path)
    try:
        bus = map_file(path)
    except BaseException:
        os.close(descriptor)
        raise
    return Transport(bus=bus, url=url, on_close=[lambda: os.close(descriptor)])


def _open_card(card: PciCard, url: str, lock: Lock) -> Transport:
    undo: list[Callable[[], None]] = []
    path = str(card.registers)
    try:
        descriptor = lock(path, f"{card.model} at {card.address}")
        undo.append(lambda: os.close(descriptor))
        undo.insert(0, _enable(card))
        size = card.bar_size()
        if size < lib.HM2_ADDRESS_SPACE:
            raise errors.MappingTooSmall(
                f"{card.directory}/resource: BAR {card.id.bar} has {size} bytes of memory, "
                f"{lib.HM2_ADDRESS_SPACE} needed. The card may have lost its BARs: reload or power-cycle it.",
                expected=lib.HM2_ADDRESS_SPACE,
                received=size,
            )
        bus = map_file(path)
    except BaseException:
        for action in undo:
            action()
        raise
    return Transport(bus=bus, url=url, model=card.model, on_close=undo)


def _lock(path: str, name: str) -> int:
    try:
        return lock_file(path, name)
    except OSError:
        map_file(path)  # says why the file cannot be used
        raise


def _leave_unlocked(path: str, _name: str) -> int:
    return os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)


def _enable(card: PciCard) -> Callable[[], None]:
    """Switch memory decoding on; returns what undoes it. Without it every read gives all ones.

    The kernel counts who enabled a card, so a second user does not lose it when the first leaves.
    """
    enable = card.directory / "enable"
    try:
        enable.write_text("1")
    except PermissionError as error:
        if _decodes_memory(card):
            return lambda: None  # somebody with more rights, such as our udev rule, has done it
        raise errors.PermissionDenied(
            f"{enable}: memory decoding of {card.model} is off and this user may not switch it on"
        ) from error
    except OSError as error:
        raise errors.TransportError(f"{enable}: {error.strerror}", os_errno=error.errno) from error
    if not _decodes_memory(card):
        _set_command_memory(card)
    owner = os.getpid()
    return lambda: _disable(enable, owner)


def _disable(enable: Path, owner: int) -> None:
    if os.getpid() != owner:  # a forked child: the card is its parent's
        return
    with contextlib.suppress(OSError):  # a card pulled from its slot has nothing left to switch off
        enable.write_text("0")


def _decodes_memory(card: PciCard) -> bool:
    with (card.directory / "config").open("rb", buffering=0) as config:
        config.seek(_COMMAND)
        return bool(int.from_bytes(config.read(2), "little") & _COMMAND_MEMORY)


def _set_command_memory(card: PciCard) -> None:
    """A card that was reloaded has forgotten its command register, which the kernel's count does not show."""
    path = card.directory / "config"
    try:
        with path.open("r+b", buffering=0) as config:
            config.seek(_COMMAND)
            command = int.from_bytes(config.read(2), "little")
            config.seek(_COMMAND)
            config.write((command | _COMMAND_MEMORY).to_bytes(2, "little"))
    except PermissionError as error:
        raise errors.PermissionDenied(
            f"{path}: memory decoding is off and this user may not switch it on"
        ) from error


_REFUSALS: dict[int, tuple[type[errors.TransportError], str]] = {
    lib.HM2_MEMORY_MAP_NOT_FOUND: (errors.CardNotFound, "there is no such file"),
    lib.HM2_MEMORY_MAP_PERMISSION: (errors.PermissionDenied, "this user may not read and write it"),
    lib.HM2_MEMORY_MAP_LOCKDOWN: (errors.KernelLockdown, "the kernel forbids mapping it"),
    lib.HM2_MEMORY_MAP_TOO_SMALL: (errors.MappingTooSmall, "{received} bytes, at least {expected} needed"),
    lib.HM2_MEMORY_MAP_OTHER: (errors.TransportError, "{reason}"),
}


def map_file(path: str) -> object:
    """A `hm2_bus *` over the first 64 KiB of `path`; errors as open_transport()."""
    bus = ffi.new("hm2_bus *")
    error = errors.new_error()
    status = lib.hm2_memory_map_bus(os.fsencode(path), bus, error)
    if status == lib.HM2_ERR_IO:
        kind, text = _REFUSALS[error.detail]
        facts = errors.evidence(error)
        message = text.format(reason=os.strerror(error.os_errno), **facts)
        raise kind(f"{path}: {message}", **facts)
    errors.check(status, error)
    return bus
