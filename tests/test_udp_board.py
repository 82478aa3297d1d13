"""A whole board over a bad network: what moves, what latches and what is commanded stays right."""

from __future__ import annotations

import contextlib

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.board import UNDRIVEN
from hostmot2.emulator.ethernet import EthernetServer
from hostmot2.registers import Encoder, Gtag, Ioport

# Requests are lost, not doubled: a card carries out what comes twice, and no driver can keep it from that.
NETWORKS = [
    "loss=5%,seed=1",
    "loss=8%,seed=2,direction=requests",
    "loss=4%,dup=4%,reorder=3%,seed=3,direction=replies",
]


@pytest.fixture(params=NETWORKS)
def served(request):
    """A driver's board, the emulated one, its server; faults act from now on."""
    with (
        EmulatedBoard("7i92+7i77", clock="real") as card,
        EthernetServer(card) as server,
        hostmot2.open(f"{server.url}?retry_ms=3&error_limit=0") as board,
    ):
        board.cycle.automatic_watchdog = False  # repeats take longer than any watchdog should wait
        server.set_fault(request.param)
        yield board, card, server
        assert server.counters.lost
        server.set_fault("")


def test_index_latches_at_the_index_and_nowhere_else(served):
    board, card, server = served
    encoder = board.encoders[0]
    encoder.index_active_high = True
    with server.card.hold():
        wheel = card.encoder_input(0)
        wheel.set(0, 0, 0)
        wheel.index_every(counts=400, width=4)
    for turn in range(6):
        with server.card.hold():
            wheel.set_rate(20_000 if turn % 2 else -20_000)
        encoder.latch_index()
        for _ in range(1000):
            board.cycle.run()
            if not encoder.latching:
                break
        assert encoder.events == turn + 1
        with server.card.hold():
            wheel.set_rate(0)
            position = wheel.position
        for _ in range(3):
            board.cycle.run()
        offset = (position - encoder.count) % 400
        assert min(offset, 400 - offset) <= 4, (turn, position, encoder.count)


def test_commands_are_carried_out_once_and_outputs_arrive(served):
    board, card, server = served
    port = board.sserial[0]
    port.scan()
    assert port.start(0x03).failed == 0
    outputs = port.channels[0].outputs
    with server.card.hold():
        remote = card.sserial[0].remote(0)
    for word in (0x0001, 0x8000, 0x5AA5):
        outputs["output"] = word
        assert port.doit(0x03).failed == 0
        with server.card.hold():
            assert remote.get("output") == word
    port.stop()


def test_counts_are_never_lost(served):
    board, card, server = served
    encoder = board.encoders[2]
    with server.card.hold():
        wheel = card.encoder_input(2)
        wheel.set(0, 0, 0)
    board.cycle.run()
    start = encoder.count
    with server.card.hold():
        before = wheel.position
        wheel.set_rate(100_000)
    for _ in range(300):
        board.cycle.run()
    with server.card.hold():
        wheel.set_rate(0)
        moved = wheel.position - before
    for _ in range(3):
        board.cycle.run()
    assert moved > 0
    assert encoder.count - start == moved


def test_a_board_tells_what_its_network_did():
    with EmulatedBoard("7i92+7i77", clock="real") as card, EthernetServer(card) as server:
        board = hostmot2.open(f"{server.url}?retry_ms=3&error_limit=0")
        before = board.link_counters
        assert (before.missed, before.retries, before.discarded) == (0, 0, 0)
        server.set_fault("loss=100%,direction=requests")
        with pytest.raises(errors.TransportTimeout):
            board.read(0x100)
        server.set_fault("")
        board.read(0x100)
        after = board.link_counters
        assert after.missed == before.missed + 1
        assert after.retries > 1
        assert after.requests > after.replies > before.replies
        assert not after.failed
        board.close()
        with pytest.raises(errors.TransportClosed):
            _ = board.link_counters
    with hostmot2.open("emu://5i25+7i77") as board:
        assert board.link_counters is None


def test_losses_are_survived_within_the_deadlines_that_a_link_has_by_itself():
    """Nothing about time is given: a lost exchange is repeated inside the time-out of a cycle."""
    with (
        EmulatedBoard("7i92+7i77", clock="real") as card,
        EthernetServer(card) as server,
        hostmot2.open(server.url) as board,
    ):
        board.cycle.automatic_watchdog = False  # a repeat comes behind its time-out
        encoder = board.encoders[0]
        board.cycle.run()
        start = encoder.count
        with server.card.hold():
            wheel = card.encoder_input(0)
            before = wheel.position
            wheel.set_rate(20_000)
        server.set_fault("loss=10%,seed=4")
        for _ in range(100):
            board.cycle.run()
        lost = server.counters.lost
        server.set_fault("")
        with server.card.hold():
            wheel.set_rate(0)
            moved = wheel.position - before
        board.cycle.run()
        assert lost, "nothing had to be repeated"
        assert encoder.count - start == moved > 0


def configuration(board, card, server):
    """Registers that are written once: an encoder filter, a divider, directions of pins."""
    encoders = board.module(Gtag.MUXED_ENCODER)
    ioport = board.module(Gtag.IOPORT)
    addresses = [
        encoders.register_address(Encoder.filter_rate.number),
        encoders.register_address(Encoder.timestamp_divider.number),
        ioport.register_address(Ioport.ddr.number, 0),
        ioport.register_address(Ioport.alt_source.number, 0),
    ]
    with server.card.hold():
        words = {address: card.read(address) for address in addresses}
    return {address: word for address, word in words.items() if word != UNDRIVEN}  # what can be read


def forget(card, server, addresses):
    """What a card does whose power went: its configuration is not what it was."""
    with server.card.hold():
        for address in addresses:
            card.write(address, 0)


def exchange_until_given_up(driver):
    for _ in range(20):
        with contextlib.suppress(errors.TransportTimeout):
            driver.exchange()


def lose_the_link(server, driver):
    server.set_fault("loss=100%")
    with pytest.raises(errors.LinkFailed):
        exchange_until_given_up(driver)


@pytest.mark.parametrize("bites", [True, False])
def test_a_link_given_up_is_used_again_with_everything_configured_anew_and_outputs_off(bites):
    with (
        EmulatedBoard("7i92+7i77", clock="real") as card,
        EthernetServer(card) as server,
        hostmot2.open(f"{server.url}?retry_ms=3&error_limit=2") as board,
    ):
        board.cycle.automatic_watchdog = bites
        driver = board.card("7i77")
        board.encoders.modules[0].filter_rate = 2e6
        driver.start()
        driver.analog[0].volts, driver.analog_enable = 3.0, True
        driver.exchange()
        before = configuration(board, card, server)
        assert len(before) >= 2
        assert all(before.values())

        lose_the_link(server, driver)
        with pytest.raises(errors.TransportError):
            board.recover()  # the cause is not gone
        forget(card, server, before)
        server.set_fault("")
        with pytest.raises(errors.LinkFailed):
            driver.exchange()  # and nothing goes on by itself
        board.recover()

        assert configuration(board, card, server) == before
        assert not board.watchdog.armed
        assert not driver.started
        with server.card.hold():
            assert card.sserial[0].remote(1).get("analogena") == 0
        driver.start()
        assert driver.analog[0].volts == 0.0
        driver.analog[0].volts, driver.analog_enable = 2.0, True
        driver.exchange()
        with server.card.hold():
            assert card.sserial[0].remote(1).get("analogena") == 1


def test_a_link_that_could_not_be_taken_up_is_given_up_again():
    """One failure is no reason to give a link up, but behind it nothing is configured and outputs are on."""
    with (
        EmulatedBoard("7i92+7i77", clock="real") as card,
        EthernetServer(card) as server,
        hostmot2.open(f"{server.url}?retry_ms=3") as board,
    ):
        board.cycle.automatic_watchdog = False
        driver = board.card("7i77")
        driver.start()
        driver.analog[0].volts, driver.analog_enable = 3.0, True
        driver.exchange()
        lose_the_link(server, driver)
        with pytest.raises(errors.TransportError):
            board.recover()
        server.set_fault("")
        with pytest.raises(errors.LinkFailed):
            driver.exchange()
        board.recover()
        assert not driver.started


@pytest.mark.parametrize("back", [True, False])
def test_closing_tries_a_link_that_was_given_up_once_more(back):
    with EmulatedBoard("7i92+7i77", clock="real") as card, EthernetServer(card) as server:
        board = hostmot2.open(f"{server.url}?retry_ms=3")
        board.cycle.automatic_watchdog = False
        driver = board.card("7i77")
        driver.start()
        driver.exchange()
        ddr = board.module(Gtag.IOPORT).register_address(Ioport.ddr.number, 0)
        lose_the_link(server, driver)
        if not back:
            with pytest.raises(errors.LinkFailed):
                board.close()
            return
        server.set_fault("")
        with server.card.hold():
            assert card.read(ddr), "pins are driven"
        board.close()
        with server.card.hold():
            assert card.read(ddr) == 0
