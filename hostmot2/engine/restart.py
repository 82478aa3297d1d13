"""Starting a port anew that the engine has given up, from a thread of Python: it takes milliseconds."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from hostmot2._core import lib
from hostmot2.errors import HostMot2Error

if TYPE_CHECKING:
    from hostmot2.engine.engine import Engine

LOOK_SECONDS = 0.01


class Restarter:
    """Watches an engine's ports. A port that is back takes part in the cycle with its outputs off.

    Without a thread look() does the work: virtual time would pass for everybody while a thread waits.
    """

    def __init__(self, engine: Engine, tries: int, *, threaded: bool = True) -> None:
        self._engine = engine
        self.left = dict.fromkeys(range(len(engine._ports)), tries)
        """How often each port may still be started anew."""
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="hm2 port restart", daemon=True)
        if threaded:
            self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._end.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _run(self) -> None:
        while not self._end.wait(LOOK_SECONDS):
            self.look()

    def look(self) -> None:
        """Start what is to be started."""
        for number, left in self.left.items():
            if left <= 0 or not lib.hm2_engine_port_is_given_up(self._engine.handle, number):
                continue
            # whoever closes the board holds its lock and waits for this thread to end
            if self._engine.board.lock.acquire(timeout=LOOK_SECONDS):
                try:
                    if self._end.is_set() or not self._engine.running:
                        return
                    self.left[number] -= 1
                    self._restart(number)
                finally:
                    self._engine.board.lock.release()

    def _restart(self, number: int) -> None:
        data = self._engine._ports[number]
        port = data.port
        try:
            port.stop()
            started = port.start(data.mask)
            if started.failed:
                raise HostMot2Error(str(started))
            if port.process_data is not data.theirs:
                port.stop()
                raise HostMot2Error(f"{port.label}: other remotes than before")
            for channel in data.ours.layouts:
                data.ours.restart(channel)
            data.take()
            lib.hm2_engine_port_back(self._engine.handle, number)
        except HostMot2Error as problem:
            self._engine.restart_problems.append(str(problem))
