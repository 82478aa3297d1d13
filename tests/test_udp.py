"""The UDP transport: datagrams counted, every kind of loss told from the other, no stale reply taken."""

from __future__ import annotations

import errno
import random
import socket
import struct
import threading
from contextlib import contextmanager

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scripted_card import (
    ScriptedCard,
    after,
    answer,
    deliver_twice,
    distort,
    double_reply,
    lose_reply,
    lose_request,
    say,
)

from hostmot2 import errors, lbp16
from hostmot2._core import ffi, lib
from hostmot2.emulator.ethernet import EthernetCard, EthernetDescription, EthernetServer
from hostmot2.registers import Lbp16Space
from hostmot2.transports.udp import UdpLink, open_transport

MS = 1_000_000


class Words:
    """Lists of transfers on a link, as a board sends them."""

    def __init__(self, link: UdpLink) -> None:
        self.link, self.bus, self.error = link, link.bus, errors.new_error()

    def begin(self, *transfers):
        self.lists = []
        for address, words, flags in transfers:
            count = words if isinstance(words, int) else len(words)
            self.lists.append(ffi.new("uint32_t[]", words))
            _ = address, count, flags
        self.c = ffi.new(
            "hm2_transfer[]",
            [
                {"address": t[0], "count": len(buffer), "flags": t[2], "words": buffer}
                for t, buffer in zip(transfers, self.lists, strict=True)
            ],
        )
        errors.check(self.bus.begin(self.bus.self, self.c, len(transfers), self.error), self.error)

    def disturbances(self):
        return self.bus.disturbances(self.bus.self)

    def finish(self, timeout_ms: float = 500):
        deadline = self.bus.now_ns(self.bus.self) + round(timeout_ms * MS)
        errors.check(self.bus.finish(self.bus.self, deadline, self.error), self.error)
        return [list(buffer) for buffer in self.lists]

    def exchange(self, *transfers, timeout_ms: float = 500):
        self.begin(*transfers)
        return self.finish(timeout_ms)


def read(address: int, count: int = 1, flags: int = 0):
    return (address, count, flags)


def write(address: int, *words: int):
    return (address, list(words), lib.HM2_TRANSFER_WRITE)


@contextmanager
def linked(port: int, **options):
    link = UdpLink("127.0.0.1", port, **options)
    try:
        yield Words(link)
    finally:
        link.close()


@pytest.fixture
def card():
    with ScriptedCard() as card:
        yield card


@pytest.fixture
def words(card):
    with linked(card.port, retry_ms=20) as words:
        words.exchange(read(0))
        yield words


CYCLE = 5  # milliseconds: below the retry time, as a cycle's deadline is


def test_a_pipelined_cycle_is_one_request_and_one_reply():
    with EthernetServer() as server, linked(server.port) as words:
        reads = [read(a) for a in (0x1000, 0x0D00, 0x3900)] + [read(0x3600, 6), read(0x3700, 6)]
        reads += [read(0x5B00 + 0x100 * r + 4 * c) for r in range(6) for c in range(2)]
        writes = [write(0x1000, 1, 2), write(0x0E00, 0x5A000000)]
        writes += [write(0x5B00 + 0x100 * r + 4 * c, r) for r in range(6) for c in range(2)]
        for _ in range(10):
            words.begin(*writes, *reads)
            words.finish()
        assert (server.counters.requests, server.counters.replies) == (10, 10)
        assert words.link.counters.requests == words.link.counters.replies == 10


def test_lists_are_split_by_request_and_by_reply_size():
    with EthernetServer() as server, linked(server.port) as words:
        values = list(range(0x4000))
        words.exchange(write(0, *values))
        # 1472 - 16 bytes of numbers: two commands of 127 and one of 107 words, with 4 bytes each
        assert server.counters.requests == -(-0x4000 // 361)
        assert words.exchange(read(0, 0x4000))[0] == values
        # 1472 - 8 bytes of numbers: 366 words
        assert server.counters.requests - 46 == -(-0x4000 // 366)
        assert server.card.peek(6, 0) == 0


def test_transfers_happen_in_list_order():
    with EthernetServer() as server, linked(server.port) as words:
        got = words.exchange(write(8, 1), read(8), write(8, 2), read(8))
        assert got == [[1], [1], [2], [2]]


def test_same_address_reads_and_writes_stay_at_their_address():
    with EthernetServer() as server, linked(server.port) as words:
        same = lib.HM2_TRANSFER_SAME_ADDRESS
        words.exchange(write(0, 1, 2, 3), (0, [7, 8, 9], lib.HM2_TRANSFER_WRITE | same))
        assert words.exchange(read(0, 3), read(0, 3, same)) == [[9, 2, 3], [9, 9, 9]]


transfer = st.one_of(
    st.tuples(st.integers(0, 63), st.integers(1, 400), st.just(0)),
    st.tuples(st.integers(0, 63), st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=300), st.just(1)),
)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(lists=st.lists(st.lists(transfer, min_size=1, max_size=30), min_size=1, max_size=5))
def test_any_list_over_udp_is_that_list_on_memory(lists):
    with EthernetServer() as server, linked(server.port) as words:
        model = [0] * 600
        for operations in lists:
            expected = []
            for place, content, is_write in operations:
                count = len(content) if is_write else content
                if is_write:
                    model[place : place + count] = content
                expected.append(model[place : place + count])
            assert words.exchange(*[(4 * p, c, w) for p, c, w in operations]) == expected


@pytest.mark.parametrize("direction", ["requests", "replies", "both"])
def test_under_loss_duplication_and_reordering_values_are_right(direction):
    generator = random.Random(direction)
    with EthernetServer() as server, linked(server.port, retry_ms=3, error_limit=0) as words:
        model = [0] * 64
        server.set_fault(f"loss=8%,dup=8%,reorder=8%,direction={direction},seed=5")
        for step in range(300):
            place = generator.randrange(60)
            values = [generator.getrandbits(32) for _ in range(4)]
            if step % 2:
                words.exchange(write(4 * place, *values), timeout_ms=3000)
                model[place : place + 4] = values
            else:
                assert words.exchange(read(4 * place, 4), timeout_ms=3000) == [model[place : place + 4]]
        counters, served = words.link.counters, server.counters
        assert counters.retries
        assert served.lost
        assert served.duplicated
        assert served.reordered


@pytest.mark.parametrize("direction", ["requests", "replies", "both"])
def test_a_cycle_under_faults_gives_its_own_values_or_none(direction):
    """Each cycle writes its number and reads it back: any value that is returned must be that number."""
    with EthernetServer() as server, linked(server.port, error_limit=0) as words:
        server.set_fault(f"loss=10%,dup=10%,reorder=10%,jitter=3ms,direction={direction},seed=9")
        good = stale = 0
        for number in range(1, 250):
            try:
                got = words.exchange(write(0x40, number), read(0x40), read(0x40, 3), timeout_ms=2)
            except errors.TransportTimeout:
                stale += 1
                continue
            good += 1
            assert got[1] == [number]
            assert got[2][0] == number
        assert good
        assert stale
        assert words.link.counters.exchanges == good
        assert words.link.counters.missed == stale


def test_a_late_reply_is_not_taken_for_a_fresh_one(card, words):
    words.exchange(write(0, 11))
    card.script = [lose_reply, after(-2)]
    with pytest.raises(errors.TransportTimeout):
        words.exchange(read(0), timeout_ms=CYCLE)
    card.engine.process(bytes.fromhex("81c20000") + struct.pack("<I", 22))
    assert words.exchange(read(0)) == [[22]]
    assert words.link.counters.discarded >= 1  # more if a slow machine repeated a request


def test_a_duplicated_reply_is_discarded(card, words):
    card.script = [double_reply]
    words.exchange(write(0, 1))
    assert words.exchange(read(0)) == [[1]]
    assert words.link.counters.discarded == 1
    assert words.link.counters.repeated == 0


def test_a_request_that_arrives_twice_is_counted(card, words):
    card.script = [lambda card, request: deliver_twice(card, request)[1:]]
    words.exchange(read(0))
    assert words.link.counters.repeated == 1


def test_a_lost_write_is_told_at_the_next_exchange(card, words):
    card.script = [lose_request]
    with pytest.raises(errors.TransportTimeout):
        words.exchange(write(0, 5), timeout_ms=CYCLE)
    assert words.link.counters.writes_lost == 0
    assert words.exchange(read(0)) == [[0]]
    counters = words.link.counters
    assert (counters.missed, counters.requests_lost, counters.writes_lost) == (1, 1, 1)


def test_a_lost_read_request_loses_no_write(card, words):
    card.script = [lose_request, lose_request]
    for _ in range(2):
        with pytest.raises(errors.TransportTimeout):
            words.exchange(read(0), timeout_ms=CYCLE)
    words.exchange(read(0))
    counters = words.link.counters
    assert (counters.missed, counters.requests_lost, counters.writes_lost) == (2, 2, 0)


def test_a_lost_reply_of_a_write_loses_no_write(card, words):
    card.script = [lose_reply]
    with pytest.raises(errors.TransportTimeout):
        words.exchange(write(0, 5), timeout_ms=CYCLE)
    assert words.exchange(read(0)) == [[5]]
    counters = words.link.counters
    assert (counters.missed, counters.requests_lost, counters.writes_lost) == (1, 0, 0)


def test_an_old_write_that_comes_late_is_told(card, words):
    words.exchange(write(0, 1))  # request 1
    words.exchange(write(0, 2))
    card.script = [after(1)]
    assert words.exchange(read(0)) == [[1]]
    counters = words.link.counters
    assert (counters.out_of_order, counters.writes_lost) == (1, 1)
    assert words.disturbances() > 0


def test_a_write_that_arrives_twice_is_told_of_and_a_read_is_not(card, words):
    card.script = [deliver_twice]
    words.exchange(read(0))
    words.exchange(read(0))
    assert (words.link.counters.repeated, words.disturbances()) == (1, 0)
    card.script = [deliver_twice]
    words.exchange(write(0, 1))
    words.exchange(read(0))
    assert words.link.counters.repeated == 2
    assert words.disturbances() > 0


@pytest.mark.parametrize("first", [write(0, 1), read(0)])
def test_an_old_request_is_told_of_if_the_newest_came_again_behind_it(card, words, first):
    """The card's number is then the right one; the replies show it.

    An old write behind the request before it is answered as it was at first; that request is not.
    """

    def burst(card, request):
        return [card.run(each) for each in (*card.requests[1:-1], request)]

    words.exchange(first)
    words.exchange(write(0, 2))
    card.script = [burst]
    words.exchange(read(0))
    assert words.disturbances() > 0


def test_a_request_that_an_older_one_of_the_same_list_follows_is_told_of(card, words):
    """More than a datagram holds; its second is carried out before its first."""

    def swapped(card, request):
        return [card.run(request), card.run(card.requests[-2])]

    card.script = [lambda card, request: [], swapped]
    words.exchange(write(0, *range(800)))
    assert words.disturbances() > 0
    assert words.link.counters.foreign == 0


def test_a_write_whose_first_sending_comes_after_all_is_told_of(card, words):
    def both(card, request):
        return [card.run(card.requests[1]), card.run(request)]

    card.script = [lose_request, answer, answer, both]
    words.exchange(write(0x40, 5))
    assert card.writes_to(0x40) == 2
    assert words.disturbances() > 0


def test_another_program_on_the_card_is_told(card, words):
    card.engine.process(bytes.fromhex("82d1100044332211"))
    words.exchange(read(0))
    assert words.link.counters.foreign == 1
    assert words.disturbances() == 0


def test_a_lost_write_request_is_repeated_once_the_card_denied_it_twice(card, words):
    card.script = [lose_request]
    assert words.exchange(write(0x40, 5), read(0x40)) == [[5], [5]]
    assert words.link.counters.retries == 1
    assert card.writes_to(0x40) == 2
    assert words.link.counters.writes_lost == 0


def test_a_carried_out_write_is_never_repeated(card, words):
    card.script = [lose_reply]
    assert words.exchange(write(0x40, 5), read(0x40), write(0x40, 6)) == [[5], [6], [6]]
    assert card.writes_to(0x40) == 2
    assert words.link.counters.retries == 1


def test_a_carried_out_write_survives_loss_of_probes(card, words):
    card.script = [lose_reply, lose_request, lose_reply]
    words.exchange(write(0x40, 5))
    assert card.writes_to(0x40) == 1


def test_a_write_held_up_and_overtaken_by_the_probe_is_not_repeated(card, words):
    """The request arrives only after the probe: the second probe tells."""

    def probe_first(card, request):
        reply = card.run(request)
        card.run(card.requests[-2])
        return [reply]

    card.script = [lose_request, probe_first]
    assert words.exchange(write(0x40, 5)) == [[5]]
    assert card.writes_to(0x40) == 1
    assert card.engine.process(bytes.fromhex("81424000")) == struct.pack("<I", 5)


def test_a_fifo_is_never_read_twice(card, words):
    card.script = [lose_reply]
    fifo = read(0x80, 2, lib.HM2_TRANSFER_SAME_ADDRESS)
    with pytest.raises(errors.TransportTimeout):
        words.exchange(fifo, timeout_ms=120)
    assert sum(b"\x02\x42\x80\x00" in request for request in card.requests) == 1


def test_a_fifo_read_that_was_never_carried_out_is_repeated(card, words):
    card.script = [lose_request]
    assert words.exchange(read(0x80, 2, lib.HM2_TRANSFER_SAME_ADDRESS)) == [[0, 0]]


def test_made_up_replies_are_not_believed(card, words):
    card.engine.process(bytes.fromhex("81c20000") + struct.pack("<I", 0xCAFE))
    card.script = [say(b"", b"\x01", bytes(7), bytes(8), bytes(12), bytes(1472), bytes(1800))]
    assert words.exchange(read(0)) == [[0xCAFE]]
    counters = words.link.counters
    assert counters.discarded + counters.malformed == 7


@pytest.mark.parametrize(
    "change",
    [lambda r: r[:-8] + r[-4:], lambda r: r[:4] + bytes(4) + r[4:], lambda r: r[-4:], lambda r: r + b"\0\0"],
)
def test_a_reply_of_the_wrong_length_is_never_taken(card, words, change):
    card.script = [distort(change)]
    with pytest.raises(errors.TransportTimeout):
        words.exchange(read(0), timeout_ms=CYCLE)
    assert words.exchange(read(0)) == [[0]]


def test_one_loss_is_a_stale_cycle_five_in_a_row_an_error(card, words):
    card.script = [lose_request] * 6
    for _ in range(4):
        with pytest.raises(errors.TransportTimeout):
            words.exchange(read(0), timeout_ms=CYCLE)
    with pytest.raises(errors.LinkFailed) as caught:
        words.exchange(read(0), timeout_ms=CYCLE)
    assert (caught.value.expected, caught.value.received) == (10, 10)
    sent = len(card.requests)
    with pytest.raises(errors.LinkFailed):
        words.exchange(read(0))
    assert len(card.requests) == sent  # given up means silent: the card's watchdog does the rest
    words.link.clear()
    card.script = []
    assert words.exchange(read(0)) == [[0]]


def test_good_exchanges_lower_the_error_level(card, words):
    for _ in range(8):
        card.script = [lose_request]
        with pytest.raises(errors.TransportTimeout):
            words.exchange(read(0), timeout_ms=CYCLE)
        for _ in range(2):
            words.exchange(read(0))
    assert words.link.counters.error_level == 0


def test_a_restarted_engine_is_not_taken_for_lost_writes():
    facts = EthernetDescription("7I92", restart_us=1000)
    with EthernetServer(EthernetCard(facts)) as server, linked(server.port) as words:
        words.exchange(write(0, 1))
        words.link.exchange(lbp16.write(Lbp16Space.CONTROL, 0x1C, [1]))
        words.link.clear()
        assert words.exchange(read(0)) == [[1]]
        assert words.link.counters.writes_lost == words.link.counters.foreign == 0


def test_nobody_listening_is_told_at_once():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    link = UdpLink("127.0.0.1", port)
    with pytest.raises(errors.TransportError, match=f"udp://127.0.0.1:{port}: Connection refused") as caught:
        link.exchange(lbp16.read(Lbp16Space.BOARD, 0))
    assert caught.value.os_errno == errno.ECONNREFUSED
    link.close()


def test_several_cards_are_asked_before_any_is_awaited():
    """The first card answers only when the second has been asked."""
    asked = threading.Event()

    def once_the_other_was_asked(card, request):
        return [card.run(request)] if asked.wait(3) else []

    def tell(card, request):
        asked.set()
        return [card.run(request)]

    with ScriptedCard() as one, ScriptedCard() as two, linked(one.port) as first, linked(two.port) as second:
        one.script, two.script = [once_the_other_was_asked], [tell]
        first.begin(write(0, 1), read(0))
        second.begin(write(0, 2), read(0))
        assert second.finish(2000) == [[2], [2]]
        assert first.finish(2000) == [[1], [1]]
        assert first.link.counters.error_level == second.link.counters.error_level == 0


def test_raw_commands_reach_the_other_spaces(card, words):
    link = words.link
    assert link.exchange(lbp16.read(Lbp16Space.BOARD, 0, 8)) == b"7I92".ljust(16, b"\0")
    assert link.read_words(Lbp16Space.EEPROM, 2, 3) == [0x1234, 0x1B10, 0x0060]
    with pytest.raises(ValueError, match="out of range"):
        link.exchange(lbp16.read(Lbp16Space.HOSTMOT2, 0, 127) * 3)
    with pytest.raises(ValueError, match="whole"):
        link.exchange(b"\x01")


def test_raw_writes_are_never_repeated(card, words):
    card.script = [lose_reply]
    with pytest.raises(errors.TransportTimeout):
        words.link.exchange(lbp16.write(Lbp16Space.CONTROL, 0x14, [1]), timeout=0.1)
    assert sum(b"\x81\xd9\x14\x00" in request for request in card.requests) == 1


def test_firmware_without_scratch_words_is_refused():
    old = EthernetCard(EthernetDescription("7I92", lbp_version=2))
    with EthernetServer(old) as server, pytest.raises(errors.FirmwareTooOld):
        open_transport(server.url)


@pytest.mark.parametrize("url", ["udp://", "udp://127.0.0.1?speed=9"])
def test_urls_that_cannot_be(url):
    with pytest.raises(ValueError, match="udp://"):
        open_transport(url)


def test_use_after_close():
    with EthernetServer() as server:
        link = UdpLink("127.0.0.1", server.port)
        link.close()
        link.close()
        with pytest.raises(errors.TransportClosed):
            link.exchange(lbp16.read(Lbp16Space.BOARD, 0))


def test_a_name_that_nobody_knows_is_no_card(monkeypatch):
    def unknown(*_arguments):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    with pytest.raises(errors.CardNotFound, match="lathe: Name or service not known"):
        open_transport("udp://lathe")
