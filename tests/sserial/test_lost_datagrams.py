"""Smart serial over a network that loses, delays or doubles a datagram, in virtual time.

A DOIT must never be written over one at work as far as the driver can know, no old inputs may be taken for
new ones, and nothing that passes by itself may stop the port.
"""

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest
from faults.world import FIELD, World

from hostmot2._core import ffi, lib
from hostmot2.errors import TransportTimeout, check

CHANNELS = 0b11
PERIOD_NS = 1_000_000
ROUND_TRIP_NS = 80_000
UNIT_NUMBER = 0x12000001
US = 1000
SOON_AGAIN = 4
"""Cycles until there are results again."""


@pytest.fixture
def world() -> Iterator[World]:
    world = World("datagrams")
    board = world.open()
    board.cycle.automatic_watchdog = False
    yield world
    world.faults.plan([])
    world.drop()


class Cycles:
    """The board's cycle at 1 kHz, as an engine runs it, with deadlines. Inputs are numbered by cycle."""

    def __init__(self, world: World) -> None:
        self.world, self.port = world, world.port
        self.port.scan()
        self.number = 0
        self.taken = -1
        self._error = ffi.new("hm2_error *")

    def start(self) -> None:
        """Start both channels and lend them to the cycle."""
        assert self.port.start(CHANNELS).failed == 0
        self.port.cyclic = CHANNELS

    def run(self) -> int:
        """One cycle; the channels of the result it brought. Raises TransportTimeout, CommandHung."""
        board = self.world.board
        assert board is not None
        self.number += 1
        self.world.remotes[FIELD].inputs = self.number.to_bytes(4, "little")
        due = board.now_ns() + PERIOD_NS
        try:
            check(lib.hm2_cycle_begin(board.cycle.handle, self._error), self._error)
            deadline = due - 200 * US
            check(lib.hm2_cycle_finish(board.cycle.handle, deadline, self._error), self._error)
            self.port._after_cycle()
        finally:
            board.pause((due - board.now_ns()) / 1e9)
        self._judge()
        return int(self.port.last_cycle.requested)

    def _judge(self) -> None:
        if not self.port.last_cycle.requested:
            return
        got = self.port.channels[FIELD].inputs["input"]
        assert int(got) > self.taken, "inputs that were taken before"
        assert self.port.last_cycle.failed == 0
        self.taken = int(got)

    def recover(self, late_cycles: int = 0) -> None:
        """Results must come again soon, one each cycle, from channels that were never stopped."""
        for _ in range(late_cycles + SOON_AGAIN):
            self.run()
        assert [self.run() for _ in range(5)] == [CHANNELS] * 5
        assert self.port.started == CHANNELS
        assert self.port.transfers["hung"] == 0

    def fault(self, kind: int, value_ns: int = 0, step: int = 1) -> None:
        """What becomes of the next datagram to the card (step 2: of its answer)."""
        self.world.faults.plan([{"step": step, "kind": kind, "value": value_ns}])


@pytest.fixture
def cycles(world: World) -> Cycles:
    cycles = Cycles(world)
    cycles.start()
    for _ in range(3):
        cycles.run()
    return cycles


def until_the_next_cycle(before_us: int) -> int:
    """The delay with which a copy gets to the card so long before the next cycle's datagram."""
    return PERIOD_NS - before_us * US


@pytest.mark.parametrize("before_us", [*range(-60, 200, 10), 300, 500, 990])
def test_a_doit_that_arrives_twice_stops_nothing(cycles: Cycles, before_us: int):
    """The copy starts a DOIT that nobody expects, and the next one is written over it."""
    cycles.fault(lib.HM2_FAULT_TWICE, until_the_next_cycle(before_us))
    cycles.recover()


def test_the_doit_before_the_next_cycle_is_one_that_was_overwritten(cycles: Cycles):
    """What the test above is about does occur, and is told: no result, then one that is not taken."""
    cycles.fault(lib.HM2_FAULT_TWICE, until_the_next_cycle(before_us=20))
    results = [cycles.run() for _ in range(5)]
    assert results == [CHANNELS, 0, 0, 0, CHANNELS]
    transfers = cycles.port.transfers
    assert (transfers["overwritten"], transfers["hidden"]) == (1, 1)


@pytest.mark.parametrize("late_us", [*range(740, 1400, 20), 2000, 5000])
def test_a_doit_that_arrives_late_is_never_written_over(cycles: Cycles, late_us: int):
    """Its cycle has failed: the next one looks, and writes nothing, until COMMAND has been seen clear."""
    cycles.fault(lib.HM2_FAULT_LATE, late_us * US)
    with pytest.raises(TransportTimeout):
        cycles.run()
    cycles.recover(late_us * US // PERIOD_NS)
    in_order = late_us * US < PERIOD_NS
    assert not in_order or cycles.port.transfers["overwritten"] == 0


@pytest.mark.parametrize("stall_us", range(800, 4700, 50))
def test_a_network_that_stands_still_for_a_while_hangs_no_doit(cycles: Cycles, stall_us: int):
    """All that was sent meanwhile arrives at its end, in order: the DOIT begins long after it was written."""
    board: Any = cycles.world.board
    end, sent = board.now_ns() + stall_us * US, 0
    while board.now_ns() < end - 300 * US:
        cycles.fault(lib.HM2_FAULT_LATE, end + sent * 10 * US - board.now_ns())
        sent += 1
        with suppress(TransportTimeout):
            cycles.run()
    cycles.recover(SOON_AGAIN)


@pytest.mark.parametrize("step", [1, 2])
@pytest.mark.parametrize("lost", [1, 2, 3])
def test_lost_cycles_bring_no_old_inputs(cycles: Cycles, step: int, lost: int):
    for _ in range(lost):
        cycles.fault(lib.HM2_FAULT_LOST, step=step)
        with pytest.raises(TransportTimeout):
            cycles.run()
    cycles.recover()
    assert cycles.port.transfers["overwritten"] == 0


def test_a_first_doit_that_is_lost_does_not_bring_the_unit_number_as_inputs(world: World):
    """Behind START the registers hold who the remote is, COMMAND and DATA look as behind a good DOIT."""
    cycles = Cycles(world)
    cycles.start()
    cycles.fault(lib.HM2_FAULT_LOST)
    with pytest.raises(TransportTimeout):
        cycles.run()
    assert cycles.run() == 0
    assert cycles.port.transfers["hidden"] == 1
    cycles.recover()
    assert cycles.taken != UNIT_NUMBER


@pytest.mark.parametrize("number", range(1, 10))
def test_a_lost_datagram_of_a_doit_does_not_stop_the_port(world: World, number: int):
    card = world.seven
    card.start()
    for _ in range(3):
        card.exchange()
    world.remotes[FIELD].turnaround_us = 30.0  # the first look at a DOIT comes too early
    world.faults.plan([{"step": number, "kind": lib.HM2_FAULT_LOST}])
    assert [card.exchange().failed for _ in range(4)] == [0] * 4
    assert world.faults.fired == 1


@pytest.mark.parametrize("turnaround_us", range(20, 260, 20))
def test_the_cycle_after_a_repeated_doit_does_not_write_over_it(world: World, turnaround_us: float):
    """COMMAND written while a DOIT is at work hides its result: DATA reads 0xFF then, all channels failed."""
    board: Any = world.board
    world.remotes[
        FIELD
    ].turnaround_us = turnaround_us  # a repeat's DOIT may still be at work at the next cycle
    port = world.port
    port.start(CHANNELS)
    port.doit(CHANNELS)
    port.cyclic = CHANNELS
    for _ in range(10):
        world.faults.plan([{"step": 1, "kind": lib.HM2_FAULT_LOST}])
        for _ in range(8):
            board.cycle.run()
            assert port.last_cycle.failed == 0
    assert (port.transfers["overwritten"], port.transfers["hidden"], port.transfers["hung"]) == (0, 0, 0)


@pytest.mark.parametrize(("step", "hidden"), [(1, 0), (2, 0), (3, 1), (4, 1)])
def test_a_lost_write_of_a_read_modify_write_cycle_brings_no_old_inputs(world: World, step: int, hidden: int):
    """Two exchanges a cycle. Steps: the read and its answer, the write and its answer.

    Whether the write or its answer was lost the registers do not tell: the next result does not count.
    """
    board: Any = world.board
    board.cycle.automatic_watchdog = True
    world.seven.start()
    with board.engine(1000.0, style="read-modify-write") as engine:
        for _ in range(3):
            engine.step()
        before = world.port.transfers["doits"]
        world.faults.plan([{"step": step, "kind": lib.HM2_FAULT_LOST}])
        for _ in range(6):
            engine.step()
        transfers = world.port.transfers
        assert (transfers["overwritten"], transfers["hung"], transfers["hidden"]) == (0, 0, hidden)
        assert transfers["doits"] - before == 5
