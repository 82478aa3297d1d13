"""One run: prepare, plan the faults, do it, judge it, recover, do it again, close, judge that."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from faults import checks
from faults.adapter import AdapterWorld
from faults.layers import ANSWERS, STATEMENTS, USER_SIGNAL, Layer, Variant
from faults.operations import Operation, Wrong
from faults.world import UserError, World
from hostmot2 import HostMot2Error

STEP_FACTOR, STEP_MARGIN = 30, 1_000_000
"""Beyond so many times the steps of a run without faults the operation is taken for endless."""


@dataclass(frozen=True)
class Place:
    """Where steps are counted: a layer, and of LBP answers which remote's."""

    layer: Layer
    remote: int = 0

    def source(self, world: Any) -> Any:
        """The counter of this place in a world."""
        return world.answers[self.remote] if self.layer is ANSWERS else self.layer.source(world)

    def world(self) -> Any:
        """A new world for it."""
        return AdapterWorld() if self.layer.world == "adapter" else World(self.layer.world)

    def __str__(self) -> str:
        return f"{self.layer.name} of remote {self.remote}" if self.layer is ANSWERS else self.layer.name


@dataclass(frozen=True)
class Case:
    """One run: an operation, and one fault or more at steps of a place."""

    operation: Operation
    place: Place
    faults: tuple[tuple[Variant, int], ...]

    def __str__(self) -> str:
        faults = " and ".join(f"{variant} at step {step}" for variant, step in self.faults)
        return f"{self.operation.name}, {self.place}: {faults}"


@dataclass
class Outcome:
    """How a run ended. error: "" for success, else the class that came out. wrong: what must not be."""

    case: Case
    error: str = ""
    wrong: str = ""
    fired: int = 0
    elapsed_us: float = 0.0


def _raise_user_error(_number: int, _frame: object) -> None:
    raise UserError("the user's code failed")


@contextmanager
def user_code() -> Iterator[None]:
    """The signal that stands for an exception of the user's at any moment."""
    before = signal.signal(USER_SIGNAL, _raise_user_error)
    try:
        yield
    finally:
        signal.signal(USER_SIGNAL, before)


def count_steps(operation: Operation, place: Place) -> int:
    """How many steps the operation takes when nothing goes wrong."""
    world = place.world()
    operation.prepare(world)
    source = place.source(world)
    source.plan([])
    values = operation.run(world)
    steps = source.steps
    operation.judge(world, values)
    operation.after(world, True)
    world.drop()
    return steps


def run(case: Case, usual_steps: int) -> Outcome:
    """Carry out a case."""
    outcome = Outcome(case)
    world = case.place.world()
    try:
        case.operation.prepare(world)
        _fail_then_recover(case, world, outcome, usual_steps)
    except Wrong as wrong:
        outcome.wrong = str(wrong)
    except BaseException as error:
        outcome.wrong = f"while {_doing(world)}: {type(error).__name__}: {error}"
    finally:
        world.settle()
        try:
            world.drop()
        except BaseException as error:
            outcome.wrong = outcome.wrong or f"closing: {type(error).__name__}: {error}"
    return outcome


def _doing(world: Any) -> str:
    return getattr(world, "doing", "preparing")


def _fail_then_recover(case: Case, world: Any, outcome: Outcome, usual_steps: int) -> None:
    operation = case.operation
    values, error = _attempt(case, world, outcome, usual_steps)
    if error is not None:
        faults = {variant.fault for variant, _ in case.faults}
        outcome.error = _type_of(error, faults)
        error = None  # and with it all that its traceback holds
    checks.in_time(outcome.elapsed_us)
    checks.nothing_unasked(world)
    if not any(variant.unseen for variant, _ in case.faults):
        operation.judge(world, values)
    operation.after(world, not outcome.error)
    if outcome.error and case.place.layer is STATEMENTS:
        operation.left(world)
    if not outcome.error and not any(variant.lasting for variant, _ in case.faults):
        operation.at_once(world)
    world.settle()
    checks.off_after_silence(world)
    if world.board is None:
        checks.off_when_closed(world)
    world.doing = "recovering"
    world.recover()
    world.doing = "doing it again"
    operation.prepare(world)
    operation.judge(world, operation.run(world))
    operation.after(world, True)
    world.doing = "closing"
    world.close()
    checks.off_when_closed(world)


def _type_of(error: BaseException, faults: set[str]) -> str:
    if "user exception" in faults and not isinstance(error, HostMot2Error):
        return checks.typed(error, "user exception")
    return checks.typed(error, "" if len(faults) > 1 or "user exception" not in faults else "user exception")


def _attempt(case: Case, world: Any, outcome: Outcome, usual_steps: int) -> tuple[Any, BaseException | None]:
    source = case.place.source(world)
    limit = usual_steps * STEP_FACTOR + STEP_MARGIN
    source.plan([variant.at(step, world) for variant, step in case.faults], limit)
    start_us = world.now_us
    failure: BaseException | None = None
    values: Any = []
    with user_code():
        try:
            values = case.operation.run(world)
        except BaseException as error:
            failure = error
    outcome.fired = source.fired
    outcome.elapsed_us = world.now_us - start_us
    if source.steps > limit:
        raise Wrong(f"no end after {source.steps} steps")
    return values, failure
