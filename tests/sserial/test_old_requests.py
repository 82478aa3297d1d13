"""A network delivers an old request once more, and the card carries it out among the exchanges of an access.

What the driver reads is then the answer to another question. The numbers in the card's scratch words tell
that it happened (lbp16.md 2); here the bus counts.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from faults.world import World

from hostmot2 import Board
from hostmot2._core import ffi, lib
from hostmot2.emulator import EmulatedBoard
from hostmot2.errors import StaleRequest
from hostmot2.lbp.card import open_channel
from hostmot2.recording.bus import BusAround, places
from hostmot2.registers import Gtag, LbpSpace, Sserial, SslbpCommand
from hostmot2.transports.emulated import transport_of

from .remotes import field_io

READ_BYTE = 0x44
GAIN, OTHER = 0x320, 0x310


class Network(BusAround):
    """Behind the `at`-th commands of a kind from now on, the words of `old` reach the card once more.

    only_before: not before this register is accessed.
    """

    def __init__(self, card: EmulatedBoard) -> None:
        super().__init__(transport_of(card))
        self.old: list[tuple[int, int]] = []
        self.kind = 0
        self.at: set[int] = set()
        self.seen = self.delivered = 0
        self.command = 0
        self._due = False
        self.only_before = 0

    def begin(self, transfers, count, error):
        if self._due and (
            not self.only_before or any(p[0] == self.only_before for p in places(transfers, count))
        ):
            self._due = False
            self._deliver()
        for address, write, words, index in places(transfers, count):
            if address == self.command and write and words[index] & ~0xFF == self.kind and self.at:
                self.seen += 1
                self._due = self.seen in self.at
        return super().begin(transfers, count, error)

    def disturbances(self):
        return self.delivered

    def deliver(self, kind: int, at: set[int], old: list[tuple[int, int]]) -> None:
        self.kind, self.at, self.old, self.seen = kind, at, old, 0

    def _deliver(self) -> None:
        """When the card has done what it was asked, and nobody has looked yet."""
        self.delivered += 1
        error = ffi.new("hm2_error *")
        self.pause_ns(1_000_000)
        for address, value in self.old:
            words = ffi.new("uint32_t[]", [value])
            transfer = ffi.new("hm2_transfer *", (address, 1, lib.HM2_TRANSFER_WRITE, words))
            assert super().begin(transfer, 1, error) == lib.HM2_OK
            assert super().finish(self.now_ns() + 1_000_000, error) == lib.HM2_OK
            self.pause_ns(25_000 if address == self.command else 0)
        self.pause_ns(1_000_000)


DOIT = SslbpCommand.DOIT
READ_LOCAL = SslbpCommand.READ_LOCAL
WRITE_LOCAL = SslbpCommand.WRITE_LOCAL
START = SslbpCommand.START_NORMAL
EVERY = set(range(1, 100))


@pytest.fixture
def network() -> Iterator[Network]:
    with EmulatedBoard("5i25+7i77", clock="virtual") as card:
        for channel in range(card.sserial[0].channels):
            card.sserial[0].detach(channel)
        field = field_io()
        field.poke(GAIN, b"\x47")
        field.poke(OTHER, b"\x11")
        card.sserial[0].attach(0, field, through_pins=True)
        network = Network(card)
        network.field = field
        yield network


@pytest.fixture
def hm2(network) -> Iterator[Board]:
    with Board(network.transport) as board:
        module = next(module for module in board.modules if module.gtag == Gtag.SSERIAL)
        network.command = module.register_address(Sserial.command.number)
        network.cs = module.register_address(Sserial.cs.number)
        network.user0 = module.register_address(Sserial.user0.number)
        network.data = module.register_address(Sserial.data.number)
        yield board


def old_access(network, address: int) -> list[tuple[int, int]]:
    """The words of an access of before: read a byte of the remote."""
    return [(network.cs, READ_BYTE << 24 | address), (network.command, DOIT | 1)]


def test_a_value_is_read_again_when_an_old_request_came_between(network, hm2):
    port = hm2.sserial[0]
    assert port.read_remote(0, OTHER, 1) == 0x11
    network.deliver(DOIT, {1}, old_access(network, OTHER))
    assert port.read_remote(0, GAIN, 1) == 0x47
    assert network.delivered == 1


@pytest.mark.parametrize("command", [SslbpCommand.STOP, SslbpCommand.STOP | 1, SslbpCommand.START_NORMAL | 1])
def test_a_channel_that_an_old_command_stopped_is_started_again_before_it_is_believed(network, hm2, command):
    """A stopped channel answers every address with 0, and nothing says so."""
    port = hm2.sserial[0]
    assert port.read_remote(0, GAIN, 1) == 0x47
    network.deliver(DOIT, {1}, [(network.command, command)])
    assert [port.read_remote(0, GAIN, 1), port.read_remote(0, OTHER, 1)] == [0x47, 0x11]
    network.deliver(READ_LOCAL, {1}, [(network.command, command)])
    port.read_local(0)
    assert port.read_remote(0, GAIN, 1) == 0x47
    network.deliver(READ_LOCAL, {1}, [(network.command, command)])
    port.read_local(0)
    port.write_remote(0, GAIN, 7, 1)
    assert port.read_remote(0, GAIN, 1) == 7
    assert network.delivered == 3


def test_a_value_that_is_disturbed_each_time_is_not_given(network, hm2):
    port = hm2.sserial[0]
    port.read_remote(0, GAIN, 1)
    network.deliver(DOIT, EVERY, old_access(network, OTHER))
    with pytest.raises(StaleRequest, match=r"address 0x0320 of channel 0 was read"):
        port.read_remote(0, GAIN, 1)


def test_a_write_that_was_disturbed_is_told_and_not_done_twice(network, hm2):
    port = hm2.sserial[0]
    port.read_remote(0, GAIN, 1)
    network.deliver(DOIT, {1}, old_access(network, OTHER))
    with pytest.raises(StaleRequest, match=r"address 0x0320 of channel 0 was written"):
        port.write_remote(0, GAIN, 7, 1)
    assert network.seen == 1
    network.deliver(0, set(), [])
    port.write_remote(0, GAIN, 9, 1)
    assert port.read_remote(0, GAIN, 1) == 9


def test_a_local_variable_is_read_again(network, hm2):
    port = hm2.sserial[0]
    truth = port.read_local(0, 1)
    assert truth != port.read_local(1, 1)
    network.deliver(READ_LOCAL, {1}, [(network.command, READ_LOCAL | 1)])
    assert port.read_local(0, 1) == truth
    assert network.delivered == 1


@pytest.mark.parametrize("step", range(1, 93, 4))
def test_tables_are_those_of_the_remote_whenever_an_old_request_comes(network, hm2, step):
    port = hm2.sserial[0]
    truth = port.scan()[0].description
    port.reset()
    network.deliver(DOIT, {step}, old_access(network, OTHER))
    assert port.scan()[0].description == truth
    assert network.delivered == 1


@pytest.mark.parametrize("step", [1, 2])
def test_a_start_among_whose_exchanges_an_old_request_came_is_done_again(network, hm2, step):
    port = hm2.sserial[0]
    port.scan()
    network.deliver(SslbpCommand.START_NORMAL, {step}, [(network.cs, 1 << 24)])
    result = port.start(0x01)
    assert (result.started, result.failed) == (0x01, 0)
    assert network.delivered == (step == 1)
    assert result.repeated == (step == 1)


def test_a_start_that_is_disturbed_each_time_leaves_nothing_started(network, hm2):
    port = hm2.sserial[0]
    port.scan()
    network.deliver(SslbpCommand.START_NORMAL, EVERY, [(network.cs, 1 << 24)])
    with pytest.raises(StaleRequest, match="channels 0x01 were started"):
        port.start(0x01)
    assert port.started == 0
    network.deliver(0, set(), [])
    assert port.start(0x01).started == 0x01


def test_a_remote_is_not_silent_because_an_old_request_stopped_it(network, hm2):
    """Behind a start of none a stopped channel shows its DATA bit, as one that does not answer."""
    port = hm2.sserial[0]
    truth = port.scan()[0].description
    network.deliver(DOIT, {8}, [(network.command, SslbpCommand.STOP | 1), (network.command, START | 2)])
    row = port.scan()[0]
    assert (row.reason, row.description) == ("ok", truth)
    assert network.delivered == 1


def test_a_scan_that_was_disturbed_each_time_is_done_again_when_its_remotes_are_asked_for(network, hm2):
    port = hm2.sserial[0]
    truth = port.scan()[0].description
    network.deliver(SslbpCommand.START_SETUP, EVERY, [(network.cs, 1 << 24)])
    with pytest.raises(StaleRequest):
        port.scan()
    network.deliver(0, set(), [])
    assert port.channels[0].parameters
    assert port.channels[0].description == truth


def test_nobody_has_a_setup_jumper_because_an_old_request_came(network, hm2):
    port = hm2.sserial[0]
    truth = [row.reason for row in port.scan(setup_rate=True)]
    network.only_before = network.data
    network.deliver(SslbpCommand.START_SETUP, {2}, [(network.command, DOIT)])
    assert [row.reason for row in port.scan(setup_rate=True)] == truth
    assert network.delivered == 1


def test_a_local_variable_is_written_again(network, hm2):
    port = hm2.sserial[0]
    port.write_local(0x10, 0x12)
    network.deliver(WRITE_LOCAL, {1}, [(network.data, 0x34), (network.command, WRITE_LOCAL | 0x10)])
    port.write_local(0x10, 0x56)
    assert port.read_local(0x10) == 0x56
    assert network.delivered == 1


@pytest.mark.parametrize("kind", [DOIT, READ_LOCAL])
def test_an_lbp_client_does_not_read_the_memory_space_that_an_old_request_selected(network, hm2, kind):
    """Nor if it came between two of its commands, and was noticed by something else."""
    network.field.poke(GAIN, b"\x99", space=LbpSpace.EEPROM)
    port = hm2.sserial[0]
    with open_channel(port, 0) as remote:
        assert remote.read_remote(GAIN) == 0x47
        select = [(network.user0, LbpSpace.EEPROM), (network.cs, 0xEC << 24), (network.command, DOIT | 1)]
        network.deliver(kind, {1}, select)
        if kind == READ_LOCAL:
            port.read_local(0)
        with pytest.raises(StaleRequest):
            remote.read_remote(GAIN)
        assert network.delivered == 1
        assert remote.read_remote(GAIN) == 0x47


@pytest.mark.parametrize("command", [SslbpCommand.STOP, SslbpCommand.STOP | 1])
def test_a_running_channel_that_an_old_request_stopped_has_failed_and_keeps_its_inputs(network, hm2, command):
    """Its bit in DATA is clear and its registers read 0 (sslbp_observed.md)."""
    port = hm2.sserial[0]
    port.start(0x01)
    network.field.inputs = b"\x55\xaa\x55\xaa"
    assert port.doit().failed == 0
    before = str(port.channels[0].inputs)
    hm2.write(network.command, command)
    port.pause(0.001)
    for _ in range(3):
        assert port.doit().failed == 0x01
        assert str(port.channels[0].inputs) == before
    assert port.start(0x01).started == 0x01
    assert port.doit().failed == 0


@pytest.fixture
def world() -> Iterator[World]:
    world = World("datagrams")
    world.open()
    yield world
    world.drop()


def deliver_again(world: World, step: int, delay_ns: int) -> None:
    world.faults.plan([{"step": step, "kind": lib.HM2_FAULT_TWICE, "value": delay_ns}])


@pytest.mark.parametrize("delay_ns", [500, 1000, 2000, 4000, 100_000])
def test_a_command_that_comes_twice_at_once_spoils_no_value(world, delay_ns):
    """The second is lost, and DATA shows 0xFF a moment later (sslbp_observed.md)."""
    port = world.port
    truth = port.read_local(0x230, 4)
    for step in range(1, 50):
        deliver_again(world, step, delay_ns)
        assert port.read_local(0x230, 4) == truth


def test_a_channel_is_stopped_although_an_old_request_was_at_work(world):
    """A stop over a DOIT stops nobody, and says nothing (sslbp_observed.md)."""
    port = world.port
    for delay_us in range(600, 1000, 10):
        port.start(1, "setup")
        port.read_remote(0, 0x310, 2)
        deliver_again(world, 3, delay_us * 1000)
        port.read_remote(0, 0x310, 2)
        port.stop(1)
        assert str(port.read_status(0)).startswith("stopped")
        port.pause(0.001)
