"""Files of the system's configuration: printed, told from other people's, installed whole or not at all."""

from __future__ import annotations

import hashlib
import os
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

_HEADER = "# Written by `hm2 setup {part}`; sha256 of what follows: {digest}. If you edit it, it stays yours."
_OURS = re.compile(r"# Written by `hm2 setup \w+`; sha256 of what follows: ([0-9a-f]{16})\.")
SAVED = ".before-hm2"


class ForeignFile(FileExistsError):
    """There is a file that `hm2 setup` has not written, or that was edited since."""


@dataclass(frozen=True)
class MachineFile:
    """One file. path: absolute. body: its text; every line that does something has a comment above it."""

    part: str
    path: Path
    body: str

    @property
    def content(self) -> str:
        """The whole text, by whose first line it is known again."""
        return _HEADER.format(part=self.part, digest=_digest(self.body)) + "\n" + self.body


def checked_name(text: str, what: str) -> str:
    """The name of a user or group, as it may stand in a file of the system. Raises ValueError."""
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_.-]{0,31}", text):
        raise ValueError(f"{text!r} is no {what}'s name")
    return text


def _digest(body: str) -> str:
    return hashlib.sha256(body.encode()).hexdigest()[:16]


def is_ours(text: str) -> bool:
    """Whether a file's text is as hm2 setup wrote it."""
    first, _, body = text.partition("\n")
    found = _OURS.match(first)
    return found is not None and found[1] == _digest(body)


def install(files: Sequence[MachineFile], *, root: Path = Path("/"), force: bool = False) -> list[Path]:
    """Write the files below `root`; returns where. All of them or, if one is somebody else's, none.

    force: replace those, too; what was there is kept beside them, its name ending in .before-hm2. Raises
    ForeignFile, OSError.
    """
    places = [root / str(file.path).lstrip("/") for file in files]
    foreign = [place for place in places if place.exists() and not is_ours(place.read_text(errors="replace"))]
    if foreign and not force:
        raise ForeignFile(
            f"{foreign[0]} is not as `hm2 setup` wrote it: left alone, nothing was written (--force)"
        )
    for place in foreign:
        os.replace(place, place.with_name(place.name + SAVED))
    for file, place in zip(files, places, strict=True):
        place.parent.mkdir(parents=True, exist_ok=True)
        beside = place.with_name(f".{place.name}.{secrets.token_hex(8)}.new")
        with beside.open("x") as stream:  # through no link
            stream.write(file.content)
        beside.chmod(0o644)
        os.replace(beside, place)
    return places
