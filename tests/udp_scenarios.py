"""What the driver does in each dialogue of tests/golden/udp, and what it must have made of the answers."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest
from udp_peer import Peer, PeerLink

from hostmot2._core import ffi, lib
from hostmot2.board import Board
from hostmot2.errors import TransportError, TransportTimeout, check
from hostmot2.ethernet.flash import Flash
from hostmot2.ethernet.service import EthernetService
from hostmot2.sserial.core import NORMAL, Core
from hostmot2.transports.base import LinkCounters
from hostmot2.transports.udp import transport_over

CHANNELS = 0x03
CYCLE_NS = 1_000_000


class Session:
    """A driver at work on a peer. Parts are made by the scenarios that come first."""

    board: Board
    core: Core
    done: tuple[int, int]

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        self.link = PeerLink(peer)

    @property
    def counters(self) -> LinkCounters:
        return self.link.counters

    def cycle(self) -> None:
        """One cycle as an engine runs it: a deadline after a millisecond, below the time of a repeat."""
        cycle, error, start = self.board.cycle, ffi.new("hm2_error *"), self.peer.now_ns
        check(lib.hm2_cycle_begin(cycle.handle, error), error)
        status = lib.hm2_cycle_finish(cycle.handle, start + CYCLE_NS, error)
        self.peer.now_ns = max(self.peer.now_ns, start + CYCLE_NS)
        check(status, error)
        self.done = self.core.cyclic_result()

    def close(self) -> None:
        """Let go of everything, whatever was reached."""
        self.peer.problem = self.peer.problem or "over"
        with contextlib.suppress(TransportError):
            self.board.close() if hasattr(self, "board") else self.link.close()


def open_card(s: Session) -> None:
    s.board = Board(transport_over(s.link, "udp://peer"))
    assert s.board.name == "7I92"
    assert [module.base for module in s.board.modules] == [0x0C00, 0x1000, 0x3500, 0, 0x5A00, 0x0200]
    assert len(s.board.pins) == 34


def start_smart_serial(s: Session) -> None:
    s.core = Core(s.board.handle, 0, base=0x5A00, strides=(0x100, 0x40), instance=0, channels=3, registers=3)
    s.core.reset()
    assert s.core.identify() == 3
    assert s.core.revision == "1.43"
    s.core.stop()
    assert s.core.start(CHANNELS, NORMAL, {}) == 0
    found = [s.core.identity(channel) for channel in (0, 1)]
    assert [(one.unit_number, one.name) for one in found] == [(0x12000001, "7I77"), (0x11000001, "7I77")]


def set_up_encoders(s: Session) -> None:
    assert len(s.board.encoders) == 12


def first_cycle(s: Session) -> None:
    image = lib.hm2_sserial_get_image(s.core.handle)
    image.outputs[0][0] = 0x0000BBAA
    image.outputs[1][0:3] = [0x30666199, 0x7FF33313, 0x00006000]
    s.core.join(s.board.cycle, lambda: None)
    s.core.set_cyclic(CHANNELS)
    s.board.cycle.arm_watchdog()
    s.cycle()
    assert s.done == (0, 0)


def first_cycle_lost(s: Session) -> None:
    s.core.join(s.board.cycle, lambda: None)
    s.core.set_cyclic(CHANNELS)
    with pytest.raises(TransportTimeout):
        s.cycle()
    s.cycle()
    assert s.done == (0, 0)  # the registers still hold unit numbers, which are no inputs


def pipelined_cycle(s: Session) -> None:
    s.cycle()
    assert s.done == (0, CHANNELS)
    image = lib.hm2_sserial_get_image(s.core.handle)
    assert [image.inputs[0][n] for n in range(3)] == [0xA4A3A2A1, 0, 0]
    assert not s.board.watchdog.has_bitten


def cycle_lost(s: Session) -> None:
    before = s.counters
    with pytest.raises(TransportTimeout):
        s.cycle()
    s.cycle()
    after = s.counters
    assert s.done == (0, CHANNELS)
    assert after.missed == before.missed + 1
    assert (after.requests_lost, after.writes_lost, after.error_level) == (0, 0, 1)


def cycle_request_lost(s: Session) -> None:
    with pytest.raises(TransportTimeout):
        s.cycle()
    s.cycle()
    assert s.done == (0, CHANNELS)
    assert (s.counters.requests_lost, s.counters.writes_lost) == (1, 1)


def reply_twice(s: Session) -> None:
    before = s.counters.discarded
    s.cycle()
    assert s.done == (0, CHANNELS)
    s.cycle()
    assert s.done == (0, CHANNELS)
    assert s.counters.discarded == before + 1


def reply_late(s: Session) -> None:
    before = s.counters.discarded
    with pytest.raises(TransportTimeout):
        s.cycle()
    s.cycle()
    assert s.counters.discarded == before + 1


def feed_watchdog(s: Session) -> None:
    s.board.watchdog.feed()
    assert not s.board.watchdog.check()


def write_whose_reply_is_lost(s: Session) -> None:
    s.board.write(0x1100, 0x0000CCCC)
    assert s.counters.retries == 1


def write_that_is_lost(s: Session) -> None:
    before = s.counters
    s.board.write(0x1100, 0x0000CCCC)
    assert s.counters.retries == before.retries + 1
    assert s.counters.writes_lost == before.writes_lost


def close_card(s: Session) -> None:
    s.core.stop()
    s.board.close()


def card_information(s: Session) -> None:
    service = EthernetService(s.link)
    facts = service.facts()
    assert (facts.name, facts.eeprom_name, facts.mac) == ("7I92", "7I92", "00:60:1b:10:12:34")
    assert (facts.lbp_version, facts.firmware_version, facts.jumpers) == (3, 15, 1)
    assert facts.eeprom_ip == "10.10.10.10"
    assert service.counters().error_flags == 0
    service.time_stamps()


def change_ip(s: Session) -> None:
    EthernetService(s.link).set_ip("192.168.1.50")


def read_flash(s: Session) -> None:
    flash = Flash(s.link)
    info = flash.info()
    assert (info.flash_id, info.user_address, info.boot_block_ok) == (0x14, 0x100000, True)
    assert flash.read(0x100000, 256) == b"\xff" * 256


@dataclass(frozen=True)
class Scenario:
    """`run`: what the driver does. `after`: what comes before. `plan`: what goes wrong, by request."""

    run: Callable[[Session], Any]
    title: str
    after: str = ""
    plan: dict[int, str] = field(default_factory=dict)


SCENARIOS = {
    "open": Scenario(open_card, "Board(): card name and LBP16 version, ID block, IDROM, modules, pins"),
    "sserial_start": Scenario(
        start_smart_serial, "smart serial: reset, who is there, STOP ALL, START of channels 0 and 1", "open"
    ),
    "encoders": Scenario(
        set_up_encoders,
        "board.encoders: selects of the multiplexers driven, rates and filters",
        "sserial_start",
    ),
    "first_cycle": Scenario(first_cycle, "the watchdog armed, a cycle that sends the first DOIT", "encoders"),
    "first_cycle_lost": Scenario(
        first_cycle_lost,
        "the first cycle is lost: what START left in the registers is not taken for inputs",
        "sserial_start",
        {1: "request lost"},
    ),
    "cycle": Scenario(
        pipelined_cycle,
        "a cycle: one request, one reply, results of the last DOIT and the next one",
        "first_cycle",
    ),
    "cycle_lost": Scenario(
        cycle_lost,
        "a cycle whose reply is lost: told, not repeated; the next one looks before it writes a DOIT",
        "cycle",
        {1: "reply lost"},
    ),
    "cycle_request_lost": Scenario(
        cycle_request_lost,
        "a cycle whose request is lost: the next one learns it from the card's number",
        "cycle",
        {1: "request lost"},
    ),
    "reply_twice": Scenario(
        reply_twice, "a reply that arrives twice: the second one is thrown away", "cycle", {1: "twice"}
    ),
    "reply_late": Scenario(
        reply_late, "a reply later than its cycle: it is not taken for the next one's", "cycle", {1: "late"}
    ),
    "watchdog_feed": Scenario(feed_watchdog, "the watchdog is fed and looked at outside the cycle", "cycle"),
    "write_reply_lost": Scenario(
        write_whose_reply_is_lost,
        "a write whose reply is lost: the card has carried it out when asked, and it is not sent again",
        "open",
        {1: "reply lost"},
    ),
    "write_lost": Scenario(
        write_that_is_lost,
        "a write that is lost: denied twice by the card, it is sent again",
        "open",
        {1: "request lost"},
    ),
    "close": Scenario(
        close_card, "everything off: zeroes to the remotes, STOP ALL, pins, the watchdog bites", "cycle"
    ),
    "card_information": Scenario(
        card_information, "card information: name, versions, MAC, addresses, counters, time stamps"
    ),
    "ip_change": Scenario(change_ip, "the EEPROM's IP address: key and address in one datagram, read back"),
    "flash_read": Scenario(read_flash, "flash: identification, boot block, a page of the user image"),
}


def chain(name: str) -> list[str]:
    """A scenario behind those that must come before it."""
    after = SCENARIOS[name].after
    return [*(chain(after) if after else []), name]
