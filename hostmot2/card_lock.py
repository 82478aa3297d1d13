"""One driver per card: an advisory lock on the card's own file, and who holds it."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from hostmot2.errors import CardBusy

LOCKS = Path("/proc/locks")


def lock_file(path: str, name: str) -> int:
    """Lock `path` for this process and return the descriptor that holds the lock until it is closed.

    The lock is the kernel's (flock), so it ends with the process, however that ends. name: of the card, for
    the message. Raises CardBusy with the holder's pid, and OSError if the file cannot be opened.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        pid = holder(descriptor)
        os.close(descriptor)
        if not isinstance(error, BlockingIOError):
            raise
        who = f"pid {pid} ({command(pid)})" if pid else "another process"
        raise CardBusy(
            f"{name} is driven by {who}; only one process may drive a card", received=pid
        ) from None
    return descriptor


def holder(descriptor: int) -> int | None:
    """The pid that holds a flock on the file, None if the kernel does not tell (another pid namespace)."""
    facts = os.fstat(descriptor)
    file = f"{os.major(facts.st_dev):02x}:{os.minor(facts.st_dev):02x}:{facts.st_ino}"
    try:
        locks = LOCKS.read_text()
    except OSError:  # a container that hides it
        return None
    for line in locks.splitlines():
        fields = line.split()
        if fields[1:2] == ["FLOCK"] and fields[5:6] == [file] and int(fields[4]) > 0:
            return int(fields[4])
    return None


def command(pid: int) -> str:
    """The name of a process, "?" if it is gone."""
    try:
        return Path(f"/proc/{pid}/comm").read_text().strip()
    except OSError:
        return "?"
