"""Files that are there whole or not at all: one that was cut short may look like one that is not."""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Where to write what becomes `path` at the end, unless writing it failed: then all is as before.

    A device or pipe is written to directly, and so is a file in a directory that takes no new one.
    """
    place = Path(os.path.realpath(path))
    beside = place.with_name(f".{place.name}.{secrets.token_hex(8)}.part")
    if not _create(beside, place):
        yield Path(path)
        return
    try:
        yield beside
        os.replace(beside, place)
    except BaseException:
        with suppress(OSError):
            beside.unlink()
        raise


def _create(beside: Path, place: Path) -> bool:
    """An empty file with the mode of the one it is to replace; False where that cannot be."""
    try:
        before = place.stat().st_mode if place.exists() else None
        if before is not None and not (stat.S_ISREG(before) and os.access(place, os.W_OK)):
            return False
        descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666)
    except OSError:
        return False  # opening the file itself will tell why
    try:
        if before is not None:
            os.fchmod(descriptor, stat.S_IMODE(before))
    finally:
        os.close(descriptor)
    return True
