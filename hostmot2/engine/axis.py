"""A position controller inside the engine."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from hostmot2._core import ffi, lib
from hostmot2.errors import EngineError, check, new_error

if TYPE_CHECKING:
    from hostmot2.engine.engine import Engine

SETTINGS = (
    "p",
    "i",
    "d",
    "ff0",
    "ff1",
    "ff2",
    "bias",
    "deadband",
    "max_output",
    "max_integral",
    "max_error",
)
"""Output per unit of error, per unit s, per unit/s; output per unit of command, of its velocity, of its
acceleration; output; units; limits of output, integral part and following error (0: none; max_integral: as
max_output)."""

NOT_NEGATIVE = ("deadband", "max_output", "max_integral", "max_error")

MAILBOX_SECONDS = 1.0


def pid_of(settings: dict[str, float]) -> Any:
    """A `hm2_pid *` with these settings. Raises TypeError for an unknown one, ValueError for no number."""
    pid: Any = ffi.new("hm2_pid *")
    for name, value in settings.items():
        if name not in SETTINGS:
            raise TypeError(f"PID has no {name!r}; there are {', '.join(SETTINGS)}")
        if not float("-inf") < value < float("inf"):
            raise ValueError(f"PID {name}: {value}")
        if value < 0 and name in NOT_NEGATIVE:
            raise ValueError(f"PID {name}: {value} is no limit; 0 or more")
        setattr(pid, name, value)
    return pid


class Axis:
    """One axis: a PID with feed-forward that the engine runs each cycle.

    Set `position` (and `velocity`, unless the controller shall take it from the difference), then
    Engine.write(), which raises ValueError as long as no position was set since the engine was made or last
    stopped. Exceeding max_error turns all outputs off.

    What makes the encoder count anew (`zero()`, an index latched with zero=True) moves the feedback in one
    step and the command not with it: disable first, or latch without zero and work with the difference.
    """

    def __init__(self, engine: Engine, number: int, name: str, with_velocity: bool, pid: Any) -> None:
        self._engine = engine
        self.number = number
        self.name = name
        self.with_velocity = with_velocity
        """Whether the command comes with its velocity."""
        self.pid = pid

    @property
    def position(self) -> float:
        """Where to be, in units of the feedback. Not a number until it is set."""
        return self._engine.outputs[f"{self.name}.position"]

    @position.setter
    def position(self, units: float) -> None:
        self._engine.outputs[f"{self.name}.position"] = units

    @property
    def velocity(self) -> float:
        """Units per second at which `position` moves. Only for an axis made with velocity_command=True."""
        return self._engine.outputs[f"{self.name}.velocity"]

    @velocity.setter
    def velocity(self, units_per_second: float) -> None:
        self._engine.outputs[f"{self.name}.velocity"] = units_per_second

    @property
    def settings(self) -> dict[str, float]:
        """The settings last given."""
        return {name: getattr(self.pid, name) for name in SETTINGS}

    def tune(self, **settings: float) -> None:
        """Change some settings, from the next cycle on; see SETTINGS. Makes no jump in the output.

        Raises EngineError if the engine does not take them within a second.
        """
        changed = pid_of({**self.settings, **settings})
        if self._engine.handle:
            self._send(changed)
        for name in settings:
            setattr(self.pid, name, getattr(changed, name))

    def _send(self, pid: Any) -> None:
        error = new_error()
        end = time.monotonic() + MAILBOX_SECONDS
        while True:
            with self._engine._lock:  # it neither starts nor stops meanwhile
                status = lib.hm2_engine_set_pid(self._engine.handle, self.number, pid, error)
            if status != lib.HM2_ERR_BUSY:
                check(status, error)
                return
            if time.monotonic() > end:
                raise EngineError(f"axis {self.name}: the engine takes no settings")
            time.sleep(0.001)

    def _state(self, name: str) -> float:
        if not self._engine.handle:
            return 0.0
        return float(getattr(lib.hm2_engine_pid(self._engine.handle, self.number), name))

    @property
    def error(self) -> float:
        """Command less feedback in the last cycle, units."""
        return self._state("error")

    @property
    def output(self) -> float:
        """What the controller last put out."""
        return self._state("output")

    def __repr__(self) -> str:
        return f"<Axis {self.name} at {self.position:g}, error {self.error:.3g}, output {self.output:.3g}>"
