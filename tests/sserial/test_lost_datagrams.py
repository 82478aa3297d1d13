"""Smart serial over a network that loses a datagram: the repeat comes later than any DOIT lasts."""

import socket
import threading
from typing import Any

import pytest

import hostmot2
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.ethernet import EthernetServer, description


class Relay:
    """Between a driver and a card; `lose` requests from now is lost."""

    def __init__(self, port: int) -> None:
        self.lose = 0
        self.remote: Any = None
        self._here = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._here.bind(("127.0.0.1", 0))
        self._here.settimeout(0.2)
        self.port = self._here.getsockname()[1]
        self._card = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._card.connect(("127.0.0.1", port))
        self._card.settimeout(0.2)
        self._stopping = False
        self._peer: tuple[str, int] | None = None
        self._threads = [threading.Thread(target=run) for run in (self._requests, self._replies)]
        for thread in self._threads:
            thread.start()

    def _requests(self) -> None:
        while not self._stopping:
            try:
                request, self._peer = self._here.recvfrom(2048)
            except TimeoutError:
                continue
            self.lose -= 1
            if self.lose != 0:
                self._card.send(request)

    def _replies(self) -> None:
        while not self._stopping:
            try:
                reply = self._card.recv(2048)
            except TimeoutError:
                continue
            if self._peer:
                self._here.sendto(reply, self._peer)

    def close(self) -> None:
        self._stopping = True
        for thread in self._threads:
            thread.join()
        self._here.close()
        self._card.close()


@pytest.fixture
def relay():
    with EmulatedBoard("7i92+7i77", clock="real") as board:
        server = EthernetServer(board, "127.0.0.1", 0, description=description("7i92+7i77"))
        server.start()
        relay = Relay(server.port)
        relay.remote = board.sserial[0].remote(0)
        yield relay
        relay.close()
        server.close()


def test_a_lost_datagram_of_a_doit_does_not_stop_the_port(relay):
    for number in range(1, 6):
        with hostmot2.open(f"udp://127.0.0.1:{relay.port}?retry_ms=5") as hm2:
            card = hm2.card("7i77")
            hm2.watchdog.timeout = 2.0
            relay.remote.turnaround_us = 6.0
            card.start()
            for _ in range(3):
                card.exchange()
            relay.remote.turnaround_us = 30.0  # the first look at a DOIT comes too early
            relay.lose = number
            assert [card.exchange().failed for _ in range(4)] == [0] * 4


def test_the_cycle_after_a_repeated_doit_does_not_write_over_it(relay):
    """COMMAND written while a DOIT is at work hides its result: DATA reads 0xFF then, all channels failed."""
    with hostmot2.open(f"udp://127.0.0.1:{relay.port}?retry_ms=5") as hm2:
        relay.remote.turnaround_us = 250.0  # a repeat's DOIT is still at work when the next cycle comes
        port = hm2.sserial[0]
        port.start(0x03)
        port.doit(0x03)
        port.cyclic = 0x03
        hm2.cycle.automatic_watchdog = False
        for _ in range(10):
            relay.lose = 1
            for _ in range(8):
                hm2.cycle.run()
                assert port.last_cycle.failed == 0
