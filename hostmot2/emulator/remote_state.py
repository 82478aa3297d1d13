"""EEPROM and flash of an emulated remote in a file, so that they outlive the program."""

from __future__ import annotations

import base64
import json
import os
import zlib
from pathlib import Path
from tempfile import NamedTemporaryFile

from hostmot2.emulator.described import DescribedRemote

MOST_BYTES = 1 << 22
"""More than any memory of a remote: what unpacks to more is no state."""


def _unpacked(text: str) -> bytes:
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(base64.b64decode(text), MOST_BYTES)
    if not unpacker.eof:
        raise ValueError(f"a memory is cut short, or longer than {MOST_BYTES} bytes")
    return data


class RemoteState:
    """Keeps a remote's non-volatile memory in a file, replaced whole at every change.

    Raises ValueError for a file that is not this remote's.
    """

    def __init__(self, remote: DescribedRemote, path: Path, kind: str) -> None:
        self._remote = remote
        self._path = path
        self._kind = kind
        self._writes = -1
        self._saved: dict[str, bytes] = {}
        if path.exists():
            self._restore()

    def _restore(self) -> None:
        try:
            document = json.loads(self._path.read_text())
            memories = {name: _unpacked(text) for name, text in document.items() if name != "remote"}
            kind = document["remote"]
        except (ValueError, AttributeError, KeyError, TypeError, RecursionError, zlib.error) as broken:
            raise ValueError(f"{self._path} is no state of a remote: {broken}") from broken
        if kind != self._kind:
            raise ValueError(f"{self._path} is the state of a {kind}, not of a {self._kind}")
        self._remote.nonvolatile = memories
        self._remote.power_cycle()

    def save(self) -> None:
        """Write the file if anything has changed since the last time."""
        writes = self._remote.write_count
        if writes == self._writes:
            return
        self._writes = writes
        memories = self._remote.nonvolatile
        if memories == self._saved and self._path.exists():
            return
        document = {"remote": self._kind} | {
            name: base64.b64encode(zlib.compress(data, 1)).decode() for name, data in memories.items()
        }
        text = json.dumps(document, indent=1) + "\n"
        # a new file of its own: nothing that lies in a fixed place, a link perhaps, is written to
        with NamedTemporaryFile("w", dir=self._path.parent, delete=False) as beside:
            beside.write(text)
        os.replace(beside.name, self._path)
        self._saved = memories
