"""The other end of the UDP driver, in virtual time: answers from a dialogue's file, and nothing else.

No card and no emulator is behind it. Each reply arrives TRAVEL_NS after the datagram before it in the file.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import Any

from udp_dialogue import Datagram, Dialogue, Numbers, difference, load, reply_lines, request_lines

from hostmot2._core import ffi, lib
from hostmot2.transports.udp import UdpLink

TRAVEL_NS = 100_000
"""There and back."""


class Peer:
    """A carrier. `problem` is what the driver should not have sent; from then on nothing is carried."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.numbers = Numbers()
        self.problem = ""
        self._arriving: list[tuple[int, bytes]] = []
        self._last_number: int | None = None
        self._name = ""
        self._dialogue = Dialogue("", [])
        self._next = 0
        self._callbacks = (
            ffi.callback("int(void *, const uint8_t *, size_t)", self._send),
            ffi.callback("int(void *, uint8_t *, size_t)", self._receive),
            ffi.callback("void(void *, int64_t)", self._wait),
            ffi.callback("int64_t(void *)", lambda _: self.now_ns),
            ffi.callback("void(void *, int64_t)", self._pause),
            ffi.callback("void(void *)", lambda _: None),
        )
        self.carrier: Any = ffi.new("hm2_carrier *", (ffi.NULL, *self._callbacks))

    def play(self, name: str) -> None:
        """The next dialogue; its n is the number of the last datagram before it."""
        self._name, self._dialogue, self._next = name, load(name), 0
        if self._last_number is not None:
            self.numbers.n = self._last_number

    def finished(self) -> None:
        """All of the dialogue must have been said by now."""
        left = self._dialogue.datagrams[self._next :]
        if not self.problem and left:
            self.problem = "\n".join(
                [f"{self._name}.txt, {left[0].kind} {left[0].number}: never sent", *left[0].lines]
            )

    # -- the carrier's operations

    def _send(self, _self: Any, data: Any, length: int) -> int:
        request = bytes(ffi.buffer(data, length))
        self.numbers.learn(request)
        self._last_number = self.numbers.last(request) or self._last_number
        if not self.problem:
            self.accept(request)
        return -errno.EPIPE if self.problem else 0

    def accept(self, request: bytes) -> None:
        """Compare with the file, byte by byte, and send what stands below."""
        datagrams = self._dialogue.datagrams
        expected = datagrams[self._next] if self._next < len(datagrams) else None
        if expected is None:
            got = "\n".join(request_lines(request, self.numbers))
            self.problem = f"{self._name}.txt is over, and the driver sent\n{got}"
            return
        if self.numbers.bytes(expected.hex) != request:
            got_lines = request_lines(request, self.numbers)
            self.problem = difference(self._name, expected.number, expected.lines, got_lines)
            return
        self._next += 1
        while self._next < len(datagrams) and datagrams[self._next].kind == "<":
            self.deliver(self.numbers.bytes(datagrams[self._next].hex))
            self._next += 1

    def deliver(self, reply: bytes) -> None:
        """Put a reply on its way."""
        due = max([self.now_ns, *(at for at, _ in self._arriving)]) + TRAVEL_NS
        self._arriving.append((due, reply))

    def _receive(self, _self: Any, data: Any, capacity: int) -> int:
        if not self._arriving or self._arriving[0][0] > self.now_ns:
            return -errno.EAGAIN
        reply = self._arriving.pop(0)[1][:capacity]
        ffi.memmove(data, reply, len(reply))
        return len(reply)

    def _wait(self, _self: Any, ns: int) -> None:
        until = self.now_ns + ns
        self.now_ns = min(until, max(self._arriving[0][0], self.now_ns)) if self._arriving else until

    def _pause(self, _self: Any, ns: int) -> None:
        self.now_ns += max(0, ns)


class PeerLink(UdpLink):
    """The driver's link on that carrier."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        super().__init__("peer", spin_us=0)

    def _open(self, config: Any, out: Any) -> int:
        return int(lib.hm2_udp_carrier_bus(self._peer.carrier, config, self.bus, out, self._error))


Answer = Callable[[bytes, int], bytes | None]


class RecordingPeer(Peer):
    """Writes down what the driver says to `answer(request, now_ns)`; `plan` tells what becomes of it."""

    def __init__(self, answer: Answer) -> None:
        super().__init__()
        self._answer = answer
        self._late: list[tuple[int, bytes, bytes]] = []

    def record(self, name: str, comment: str, plan: dict[int, str]) -> None:
        """Start a new dialogue."""
        self._name, self._dialogue, self._plan = name, Dialogue(comment, []), plan
        if self._last_number is not None:
            self.numbers.n = self._last_number

    @property
    def dialogue(self) -> Dialogue:
        """What was said."""
        return self._dialogue

    def finished(self) -> None:
        """Nothing is expected."""

    def accept(self, request: bytes) -> None:
        """Any request is right."""
        number = 1 + sum(datagram.kind == ">" for datagram in self._dialogue.datagrams)
        fate = self._plan.get(number, "")
        self._write_down(">", number, _OF_REQUESTS.get(fate, ""), request_lines(request, self.numbers))
        late, self._late = self._late, []
        for earlier, asked, reply in late:
            self._reply(earlier, asked, reply, "late")
        reply = self._answer(request, self.now_ns) if fate != "request lost" else None
        if reply is None or fate == "reply lost":
            return
        if fate == "late":
            self._late.append((number, request, reply))
            return
        self._reply(number, request, reply)
        if fate == "twice":
            self._reply(number, request, reply, "again")

    def _reply(self, number: int, request: bytes, reply: bytes, title: str = "") -> None:
        self._write_down("<", number, title, reply_lines(request, reply, self.numbers))
        self.deliver(reply)

    def _write_down(self, kind: str, number: int, title: str, lines: list[str]) -> None:
        hexadecimal = "".join(line.partition("|")[0].replace(" ", "") for line in lines)
        self._dialogue.datagrams.append(Datagram(kind, number, title, hexadecimal, lines))


_OF_REQUESTS = {
    "request lost": "never arrives",
    "reply lost": "its reply is lost",
    "late": "its reply is late",
}
