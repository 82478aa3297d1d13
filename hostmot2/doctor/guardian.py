"""Puts a setting back if the program that changed it is killed: a process of its own, waiting at a pipe.

python -m hostmot2.doctor.guardian KEY VALUE [INTERFACE]

VALUE is written when the pipe closes without a word.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from types import TracebackType
from typing import Self

from hostmot2.doctor.knobs import knob
from hostmot2.doctor.links import NetlinkLinks
from hostmot2.doctor.machine import Machine

RESTORED = b"restored\n"


class Guardian:
    """Beside a change: does nothing if all is restored when it ends, else restores.

    restored: set by who has put the setting back.
    """

    def __init__(self, key: str, value: str, interface: str | None) -> None:
        self.restored = False
        command = [
            sys.executable,
            "-m",
            "hostmot2.doctor.guardian",
            key,
            value,
            *([interface] if interface else []),
        ]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        )
        assert self._process.stdout is not None
        self._process.stdout.readline()  # it is awake

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.communicate(RESTORED if self.restored else b"")


def main(arguments: list[str]) -> int:
    """Waits; restores if it must."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    key, value, *interface = arguments
    made = knob(key, Machine(), NetlinkLinks, interface[0] if interface else None)
    print("ready", flush=True)
    if sys.stdin.buffer.read() != RESTORED:
        made.write(value)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
