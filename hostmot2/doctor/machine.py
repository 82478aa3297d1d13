"""The files a machine describes itself with: /proc, /sys, /dev, /etc, below a root that tests can choose."""

from __future__ import annotations

import grp
import os
import pwd
import resource
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Machine:
    """What is read of a machine. A file that is not there, or not for this user, is None.

    root: "/" or a tree made for a test. user, groups: who asks; limits: of this process by name, soft, None
    for no limit.
    """

    root: Path = Path("/")
    user: str = field(default_factory=lambda: _user())
    uid: int = field(default_factory=os.geteuid)
    groups: frozenset[str] = field(default_factory=lambda: _groups())
    limits: dict[str, int | None] = field(default_factory=lambda: _limits())

    def path(self, name: str) -> Path:
        """A file by its absolute name."""
        return self.root / name.lstrip("/")

    def text(self, name: str) -> str | None:
        """What stands in a file, without the white space around it."""
        try:
            return self.path(name).read_text(errors="replace").strip()
        except OSError:
            return None

    def number(self, name: str) -> int | None:
        """A file that holds a number."""
        text = self.text(name)
        return int(text) if text is not None and text.lstrip("-").isdigit() else None

    def find(self, pattern: str) -> list[Path]:
        """Files by a pattern such as /sys/class/net/*, in order."""
        return sorted(self.root.glob(pattern.lstrip("/")))

    def target(self, name: str) -> str | None:
        """The last part of what a link points to, such as the driver of a device."""
        try:
            return os.readlink(self.path(name)).rstrip("/").rpartition("/")[2]
        except OSError:
            return None

    def may_write(self, path: Path) -> bool:
        """Whether this user may read and write a file, by its mode and owner."""
        try:
            facts = path.stat()
        except OSError:
            return False
        if self.uid == 0:
            return True
        if facts.st_uid == self.uid:
            return facts.st_mode & 0o600 == 0o600
        if group_name(facts.st_gid) in self.groups:
            return facts.st_mode & 0o060 == 0o060
        return facts.st_mode & 0o006 == 0o006

    def members(self, group: str) -> frozenset[str] | None:
        """Who is in a group by /etc/group; None if there is no such group."""
        for line in (self.text("/etc/group") or "").splitlines():
            name, _, rest = line.partition(":")
            if name == group:
                return frozenset(rest.rpartition(":")[2].split(",")) - {""}
        return None

    def processes(self) -> Iterator[str]:
        """The names of all processes."""
        for path in self.find("/proc/[0-9]*/comm"):
            try:
                yield path.read_text().strip()
            except OSError:
                continue

    def processors(self, name: str) -> frozenset[int]:
        """A file that holds a list of processors such as 0,2-3."""
        return cpu_list(self.text(name) or "")


def cpu_list(text: str) -> frozenset[int]:
    """Processors of a list such as "0,2-3"."""
    found: set[int] = set()
    for part in text.replace("\n", ",").split(","):
        first, _, last = part.strip().partition("-")
        if first.isdigit() and (not last or last.isdigit()):
            found |= set(range(int(first), int(last or first) + 1))
    return frozenset(found)


def group_name(gid: int) -> str:
    """A group's name, its number if it has none."""
    try:
        return grp.getgrgid(gid).gr_name
    except KeyError:
        return str(gid)


def _user() -> str:
    try:
        return pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return str(os.geteuid())


def _groups() -> frozenset[str]:
    return frozenset(group_name(gid) for gid in {*os.getgroups(), os.getegid()})


def _limits() -> dict[str, int | None]:
    known = {"rtprio": resource.RLIMIT_RTPRIO, "memlock": resource.RLIMIT_MEMLOCK}
    soft = {name: resource.getrlimit(number)[0] for name, number in known.items()}
    return {name: None if value == resource.RLIM_INFINITY else value for name, value in soft.items()}
