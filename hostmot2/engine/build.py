"""From what a program asked for to the engine in C."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.engine import signals as signal
from hostmot2.engine.axis import Axis
from hostmot2.engine.control import Controls
from hostmot2.engine.vectors import Vectors
from hostmot2.errors import EngineError, check, new_error
from hostmot2.handles import own
from hostmot2.record_ring import RecordRing


@dataclass(frozen=True)
class Wiring:
    """An axis and the names it works between. feedback_velocity None: from the difference of positions."""

    axis: Axis
    feedback: str
    output: str
    feedback_velocity: str | None


@dataclass
class Plan:
    """What an engine is made of."""

    config: Any
    ports: list[signal.PortData]
    vectors: Vectors
    controls: Controls = field(default_factory=Controls)
    axes: list[Wiring] = field(default_factory=list)
    ring: RecordRing | None = None

    def raise_if_full(self) -> None:
        """ValueError if there is no room for another axis."""
        if len(self.axes) == lib.HM2_ENGINE_AXES:
            raise ValueError(f"an engine runs {lib.HM2_ENGINE_AXES} axes at most")


def build(plan: Plan, board_handle: Any, cycle: Any) -> tuple[Any, object]:
    """The `struct hm2_engine *` and what to keep beside it.

    Raises ValueError for what it has no room for, EngineError for records without room for all signals.
    """
    handle, error = ffi.new("struct hm2_engine **"), new_error()
    inputs, outputs = plan.vectors.inputs, plan.vectors.outputs
    most = max(len(inputs), len(outputs))
    if most > lib.HM2_ENGINE_SIGNALS:
        raise ValueError(f"{most} inputs or outputs, an engine moves {lib.HM2_ENGINE_SIGNALS} of each")
    status = lib.hm2_engine_new(
        board_handle,
        cycle,
        plan.config,
        signal.c_signals(inputs),
        len(inputs),
        signal.c_signals(outputs),
        len(outputs),
        handle,
        error,
    )
    check(status, error)
    made, kept = own(handle[0], lib.hm2_engine_free)
    for port in plan.ports:
        check(lib.hm2_engine_add_port(made, port.port._core.handle, error), error)
    for control in plan.controls.pointers:
        check(lib.hm2_engine_add_control(made, *control, error), error)
    for wiring in plan.axes:
        _add_axis(made, plan.vectors, wiring, error)
    if plan.ring is not None:
        _set_ring(made, plan.ring)
    return made, (kept, plan, cycle)  # the engine works on all of it for as long as it lives


def _set_ring(made: Any, ring: RecordRing) -> None:
    """The engine writes whole records into the ring's slots, as long as its own signals make them."""
    words = ring.dtype.fields["words"][0].shape[0] if ring.dtype.fields else 0
    if lib.hm2_engine_record_size(made, words) != ring.dtype.itemsize:
        raise EngineError(
            "axes, commands or inputs were added after the engine's records were asked for, which have no "
            "room for them: add them first, then record()"
        )
    lib.hm2_engine_set_record_ring(made, ring.handle, words)


def _add_axis(made: Any, vectors: Vectors, wiring: Wiring, error: Any) -> None:
    axis, commands, readings = wiring.axis, vectors.commands, vectors.input_names
    velocity = wiring.feedback_velocity
    status = lib.hm2_engine_add_pid(
        made,
        axis.pid,
        commands.index(f"{axis.name}.position"),
        commands.index(f"{axis.name}.velocity") if axis.with_velocity else -1,
        readings[wiring.feedback],
        -1 if velocity is None else readings[velocity],
        commands.index(wiring.output),
        error,
    )
    check(status, error)
