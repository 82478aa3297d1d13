"""Which cases there are, carrying them out on all processors, and what came of them."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from multiprocessing import get_context

from faults import checks
from faults.adapter import ADAPTER_OPERATIONS
from faults.layers import ANSWERS, LAYERS, STATEMENTS, Variant
from faults.operations import CARD_OPERATIONS, Operation, Wrong
from faults.runs import Case, Outcome, Place, count_steps, run

OPERATIONS = (*CARD_OPERATIONS, *ADAPTER_OPERATIONS)

LEAK_RUNS = 10
"""So many runs of one kind show what each of them leaves behind."""


@dataclass(frozen=True)
class Group:
    """All cases of one operation with one way of failing at one place. Numbers, so that it can be sent."""

    operation: int
    layer: int
    remote: int
    variant: int
    total: int
    """Steps of the operation without faults, as counted."""
    steps: tuple[int, ...]
    """Where the fault happens, from 1."""

    @property
    def place(self) -> Place:
        """Where steps are counted."""
        return Place(LAYERS[self.layer], self.remote)

    @property
    def the_operation(self) -> Operation:
        """What is done."""
        return OPERATIONS[self.operation]

    @property
    def the_variant(self) -> Variant:
        """What goes wrong."""
        return LAYERS[self.layer].variants[self.variant]

    def cases(self) -> Iterator[Case]:
        """Its runs."""
        for step in self.steps:
            yield Case(self.the_operation, self.place, ((self.the_variant, step),))

    def pieces(self, size: int) -> Iterator[Group]:
        """The same in pieces of so many runs."""
        for first in range(0, len(self.steps), size):
            steps = self.steps[first : first + size]
            yield Group(self.operation, self.layer, self.remote, self.variant, self.total, steps)


PAIRED = ("start", "cycle")
"""Operations that meet two faults at once, too."""


@dataclass(frozen=True)
class Pairs:
    """So many runs of one operation at one place, each with two faults drawn at random."""

    operation: int
    layer: int
    remote: int
    total: int
    count: int
    seed: int

    @property
    def place(self) -> Place:
        """Where steps are counted."""
        return Place(LAYERS[self.layer], self.remote)

    def cases(self) -> Iterator[Case]:
        """Its runs."""
        draw = random.Random(self.seed)
        variants = LAYERS[self.layer].variants
        for _ in range(self.count):
            both = draw.choices(variants, k=2)
            steps = sorted(draw.randint(1, self.total) for _ in both)
            yield Case(OPERATIONS[self.operation], self.place, tuple(zip(both, steps, strict=True)))


@dataclass
class Tally:
    """What came of runs."""

    runs: int = 0
    reached: int = 0
    recovered: int = 0
    errors: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def add(self, outcome: Outcome) -> None:
        """One run."""
        self.runs += 1
        self.reached += outcome.fired > 0
        if outcome.wrong:
            self.wrong.append(f"{outcome.case}: {outcome.wrong}")
        elif outcome.error:
            self.errors[outcome.error] += 1
        else:
            self.recovered += 1

    def __iadd__(self, other: Tally) -> Tally:
        self.runs += other.runs
        self.reached += other.reached
        self.recovered += other.recovered
        self.errors += other.errors
        self.wrong += other.wrong
        return self


def places(operation: Operation) -> Iterator[tuple[int, int]]:
    """Layers (their numbers) and remotes that the operation has steps at, as far as it is asked."""
    for number, layer in enumerate(LAYERS):
        if layer.asked in operation.layers:
            yield from ((number, remote) for remote in ((0, 1) if layer is ANSWERS else (0,)))


def groups(most: int | None = None, seed: int = 1) -> Iterator[Group]:
    """Every step of everything, or at most so many steps of each group, evenly spread from a random first."""
    draw = random.Random(seed)
    for number, operation in enumerate(OPERATIONS):
        for layer, remote in places(operation):
            total = count_steps(operation, Place(LAYERS[layer], remote))
            for variant in range(len(LAYERS[layer].variants)):
                yield Group(number, layer, remote, variant, total, _sample(total, most, draw))


def _sample(total: int, most: int | None, draw: random.Random) -> tuple[int, ...]:
    if most is None or total <= most:
        return tuple(range(1, total + 1))
    stride = total / most
    first = draw.random() * stride
    return tuple(sorted({min(total, int(first + i * stride) + 1) for i in range(most)}))


def carry_out(cases: Iterable[Case], totals: Iterable[int]) -> Tally:
    """Runs one after the other, and whether they left something behind."""
    tally = Tally()
    before = None
    for number, (case, total) in enumerate(zip(cases, totals, strict=False)):
        tally.add(run(case, total))
        if number == 2:
            before = checks.Resources()  # what is made once has been made
    if before is not None and tally.runs > LEAK_RUNS and not tally.wrong:
        try:
            before.compare(tally.runs - 3)
        except Wrong as wrong:
            tally.wrong.append(f"{case}, and {tally.runs} like it: {wrong}")
    return tally


def pairs(count: int, seed: int = 1, piece: int = 250) -> Iterator[Pairs]:
    """About so many runs in all, the same number for each operation and place."""
    kinds = [(n, *where) for n, o in enumerate(OPERATIONS) if o.name in PAIRED for where in places(o)]
    kinds = [kind for kind in kinds if LAYERS[kind[1]] is not STATEMENTS]  # the first one ends it
    for operation, layer, remote in kinds:
        total = count_steps(OPERATIONS[operation], Place(LAYERS[layer], remote))
        left = -(-count // len(kinds))
        while left > 0:
            seed += 1
            yield Pairs(operation, layer, remote, total, min(piece, left), seed)
            left -= piece


def _carry_out_pairs(group: Pairs) -> tuple[Pairs, Tally]:
    return group, carry_out(group.cases(), [group.total] * group.count)


def run_pairs(found: Iterable[Pairs], workers: int = 2) -> Iterator[tuple[Pairs, Tally]]:
    """All of them, as they are done. workers 0: in this process."""
    if not workers:
        yield from map(_carry_out_pairs, found)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(_carry_out_pairs, group) for group in found]):
            yield done.result()


def _carry_out_group(group: Group) -> tuple[Group, Tally]:
    return group, carry_out(group.cases(), [group.total] * len(group.steps))


def run_all(found: Iterable[Group], workers: int = 2, piece: int = 200) -> Iterator[tuple[Group, Tally]]:
    """All groups, in pieces, as they are done. workers 0: in this process."""
    if not workers:
        yield from map(_carry_out_group, found)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        waiting = [pool.submit(_carry_out_group, part) for group in found for part in group.pieces(piece)]
        for done in as_completed(waiting):
            yield done.result()


Table = dict[tuple[str, str, str], Tally]
"""By operation, layer and fault."""


def tabulate(results: Iterable[tuple[Group, Tally]]) -> Table:
    """What came of all of them."""
    table: Table = {}
    for group, tally in results:
        key = (group.the_operation.name, group.place.layer.name, group.the_variant.fault)
        table.setdefault(key, Tally())
        table[key] += tally
    return table
