"""Arming and setting outputs from a view."""

from __future__ import annotations

from hostmot2.engine import Engine
from hostmot2.errors import EngineError
from hostmot2.modules.watchdog import DEFAULT_TIMEOUT, Watchdog

IDLE_SECONDS = 1.0
"""The card's watchdog until outputs are armed: a busy computer is no reason then to cut remotes off."""


class Outputs:
    """Outputs of an engine that stay off until arm(), and go off when the view does not say it is alive.

    Raises EngineError where nothing may be written.
    """

    def __init__(self, engine: Engine, watchdog: Watchdog | None, *, allowed: bool) -> None:
        self._engine = engine
        self._watchdog = watchdog
        if watchdog is not None:
            watchdog.timeout = IDLE_SECONDS
        self.allowed = allowed
        """Whether there is anything to arm."""

    @property
    def armed(self) -> bool:
        """Whether outputs are on."""
        return self.allowed and self._engine.running and not self._engine.off

    def arm(self) -> None:
        """Turn outputs on, all of them at zero. What is still wrong turns them off again."""
        if not self.allowed:
            raise EngineError("outputs were not allowed to be written: start the monitor with --allow-write")
        if self._watchdog is not None:
            self._watchdog.timeout = DEFAULT_TIMEOUT
        self._engine.outputs.array[:] = 0.0
        self._engine.enable()

    def disarm(self) -> None:
        """Turn all outputs off and forget what they were set to."""
        if self.allowed and self._engine.running:
            self._engine.disable()
            self._engine.outputs.array[:] = 0.0

    def set(self, signal: str, value: float) -> None:
        """Set one output, by its name among the engine's; it goes out with the next cycle."""
        if not self.armed:
            raise EngineError("outputs are off: arm them first")
        self._engine.outputs[signal] = value
        self._engine.write()

    def commanded(self, signal: str) -> float:
        """What an output was set to last."""
        return float(self._engine.outputs[signal])

    def alive(self) -> None:
        """The view is there: armed outputs stay on for another while."""
        if self.armed:
            self._engine.write()
