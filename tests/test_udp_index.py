"""Latching at the index while any datagram of the search is lost, in virtual time."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from faults.world import World

from hostmot2._core import ffi, lib
from hostmot2.errors import HostMot2Error, TransportTimeout, check

PERIOD_NS = 1_000_000
ANSWER_NS = 800_000
TURN, WIDTH = 400, 4
"""Counts from index to index, and of an index."""
RATE = 23_000
"""Counts per second: a turn takes 17 cycles."""
SEARCH_STEPS = 30
"""Datagrams, to and from the card: fewer than any search takes."""


@pytest.fixture
def world() -> Iterator[World]:
    world = World("datagrams")
    board = world.open()
    board.cycle.automatic_watchdog = False
    world.encoder.set(0, 0, 0)
    world.encoder.index_every(counts=TURN, width=WIDTH)
    board.encoders[0].index_active_high = True
    yield world
    world.drop()


class Search:
    """Cycles at 1 kHz with deadlines, in which what is lost is not repeated."""

    def __init__(self, world: World) -> None:
        assert world.board is not None
        self.world, self.board, self.encoder = world, world.board, world.board.encoders[0]
        self.error = ffi.new("hm2_error *")
        self.missed = 0

    def cycle(self) -> None:
        """One; a failed one is counted."""
        due = self.board.now_ns() + PERIOD_NS
        try:
            check(lib.hm2_cycle_begin(self.board.cycle.handle, self.error), self.error)
            deadline = due - PERIOD_NS + ANSWER_NS
            check(lib.hm2_cycle_finish(self.board.cycle.handle, deadline, self.error), self.error)
        except TransportTimeout:
            self.missed += 1
        self.board.pause(max(0, due - self.board.now_ns()) / 1e9)

    def run(self, rate: float) -> None:
        """From the order to the event, which must be at the index."""
        events = self.encoder.events
        self.world.encoder.set_rate(rate)
        self.encoder.latch_index()
        for _ in range(100):
            self.cycle()
            if not self.encoder.latching:
                break
        assert self.encoder.events == events + 1
        self.world.encoder.set_rate(0)
        for _ in range(3):
            self.cycle()
        offset = (self.world.encoder.position - self.encoder.count) % TURN
        assert min(offset, TURN - offset) <= WIDTH, (self.world.encoder.position, self.encoder.count)


@pytest.mark.parametrize("rate", [RATE, -RATE])
@pytest.mark.parametrize("lost", [1, 2, 4])
def test_any_lost_datagrams_of_a_search_leave_the_latch_at_the_index(world: World, lost: int, rate: int):
    """`lost` datagrams in a row, from each step of the search on in turn."""
    search = Search(world)
    for _ in range(3):
        search.cycle()
    for step in range(1, SEARCH_STEPS):
        world.faults.plan([{"step": step, "kind": lib.HM2_FAULT_LOST, "repeat": lost - 1}])
        assert world.link is not None
        world.link.clear()
        try:
            search.run(rate)
        except HostMot2Error as error:
            raise AssertionError(f"lost from datagram {step} on: {error}") from error
        assert world.faults.fired == lost
        world.faults.plan([])
    assert search.missed >= SEARCH_STEPS - 1
