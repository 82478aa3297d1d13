"""A card on UDP whose network misbehaves exactly as a test says: the emulated engine behind a socket."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from types import TracebackType

from lbp16_reference import parse

from hostmot2.emulator.ethernet import EthernetCard, EthernetDescription

Script = Callable[["ScriptedCard", bytes], list[bytes | None]]


class ScriptedCard:
    """`script(card, request)` gives the datagrams to send for a request; `card.run` has it done."""

    def __init__(self) -> None:
        self.engine = EthernetCard(EthernetDescription("7I92"))
        self.requests: list[bytes] = []
        self.script: list[Script] = []
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.05)
        self.port = self._socket.getsockname()[1]
        self._stopping = False
        self._thread = threading.Thread(target=self._serve)

    def run(self, request: bytes) -> bytes | None:
        return self.engine.process(request)

    def writes_to(self, address: int) -> int:
        """How often a request that holds a write to this HostMot2 address was carried out or not, sent."""
        return sum(
            command.write and command.space == 0 and command.address == address
            for request in self.requests
            for command in parse(request)
        )

    def _serve(self) -> None:
        while not self._stopping:
            try:
                request, peer = self._socket.recvfrom(2048)
            except TimeoutError:
                continue
            self.requests.append(request)
            step = self.script.pop(0) if self.script else answer
            for reply in step(self, request):
                if reply is not None:
                    self._socket.sendto(reply, peer)

    def __enter__(self) -> ScriptedCard:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping = True
        self._thread.join()
        self._socket.close()


def answer(card: ScriptedCard, request: bytes) -> list[bytes | None]:
    return [card.run(request)]


def lose_request(card: ScriptedCard, request: bytes) -> list[bytes | None]:
    return []


def lose_reply(card: ScriptedCard, request: bytes) -> list[bytes | None]:
    card.run(request)
    return []


def deliver_twice(card: ScriptedCard, request: bytes) -> list[bytes | None]:
    return [card.run(request), card.run(request)]


def double_reply(card: ScriptedCard, request: bytes) -> list[bytes | None]:
    reply = card.run(request)
    return [reply, reply]


def after(earlier: int) -> Script:
    """An earlier request arrives late: just before this one."""

    def late(card: ScriptedCard, request: bytes) -> list[bytes | None]:
        return [card.run(card.requests[earlier]), card.run(request)]

    return late


def say(*replies: bytes) -> Script:
    """Made-up datagrams first, then the true answer."""
    return lambda card, request: [*replies, card.run(request)]


def distort(change: Callable[[bytes], bytes]) -> Script:
    return lambda card, request: [change(card.run(request) or b"")]
