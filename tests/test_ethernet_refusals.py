"""What an Ethernet card, its emulation and its service refuse: the error, and that nothing was written."""

from __future__ import annotations

import dataclasses
import select
import socket
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from bitfile_samples import payload, xilinx

from hostmot2 import errors, flash_layout, lbp16
from hostmot2.bitfile import parse_bitfile
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.ethernet import DESCRIPTIONS, EthernetCard, EthernetDescription, EthernetServer, Fault
from hostmot2.ethernet import EthernetService, Flash, discovery
from hostmot2.registers import Lbp16Space
from hostmot2.transports.udp import UdpLink

USER = 0x100000


@pytest.fixture
def server() -> Iterator[EthernetServer]:
    with EthernetServer(EthernetCard(EthernetDescription("7I92"))) as server:
        yield server


@pytest.fixture
def link(server: EthernetServer) -> Iterator[UdpLink]:
    link = UdpLink(server.host, server.port)
    yield link
    link.close()


# ---- the emulated card


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        ({"mac": "01:60:1b:10:12:34"}, "01:60:1b:10:12:34 is no station's MAC address"),
        ({"mac": "00:00:00:00:00:00"}, "is no station's MAC address"),
        ({"mac": "00:60:1b:10:12"}, "is no station's MAC address"),
        ({"name": "7I92-AND-MUCH-MORE"}, "7I92-AND-MUCH-MORE is longer than 16"),
        ({"jumpers": 4}, "IP jumpers are 0 to 3, not 4"),
        ({"jumpers": -1}, "IP jumpers are 0 to 3, not -1"),
        ({"flash_id": 0x20}, "flash id 0x20 is not known"),
        ({"ip": "10.10.10.300"}, r"10\.10\.10\.300"),
    ],
)
def test_a_card_that_cannot_be(facts: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        EthernetCard(dataclasses.replace(DESCRIPTIONS["7i92"], **facts))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("delay=5", "5: a time is a number with us, ms or s"),
        ("jitter=fast", "fast: a time is"),
        ("loss=101%", "101%: a probability is"),
        ("dup=nan", "nan: a probability is"),
        ("burn=1", "burn: faults are loss, dup"),
        ("direction=up", "up: a direction is requests, replies or both"),
        ("seed=x", "x"),
    ],
)
def test_faults_that_are_none(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Fault.parse(text)


def test_faults_by_direction() -> None:
    assert Fault.parse("delay=1.5ms,direction=replies") == Fault(delay_us=1500, requests=False)
    assert Fault.parse("loss=10%,direction=requests") == Fault(loss=0.1, replies=False)
    assert Fault.parse("direction=both,seed=0x7") == Fault(seed=7)


def test_flash_beside_the_protocol_ends_where_it_ends() -> None:
    card = EthernetCard(DESCRIPTIONS["7i92"])
    end = card.flash_size
    card.flash_write(end - 2, b"ab")
    assert card.flash_read(end - 2, 2) == b"ab"
    with pytest.raises(ValueError, match=f"flash 0x{end - 1:X} . 2 bytes"):
        card.flash_read(end - 1, 2)
    with pytest.raises(ValueError, match=f"flash 0x{end - 1:X} . 2 bytes"):
        card.flash_write(end - 1, b"xy")
    assert card.flash_read(end - 2, 2) == b"ab", "not even the part that would fit"


def test_a_board_of_raw_words_needs_a_description() -> None:
    words = EmulatedBoard("7i92+7i77", clock="virtual").read(0x0400, 256)
    with EmulatedBoard(words, clock="virtual") as board:
        with pytest.raises(ValueError, match="needs a description="):
            EthernetServer(board)
        with EthernetServer(board, description=DESCRIPTIONS["7i92"]) as server:
            assert server.port


def test_a_closed_server_does_nothing_more(server: EthernetServer) -> None:
    server.close()
    with pytest.raises(errors.TransportClosed, match="the server is closed"):
        server.set_fault(Fault(loss=1.0))
    server.close()  # again


# ---- flash


def image() -> Any:
    return parse_bitfile(xilinx(payload(600)))


def answering(
    link: UdpLink, monkeypatch: pytest.MonkeyPatch, answer: Callable[[bytes], bytes | None]
) -> None:
    """`answer` may say something else than the card; TransportTimeout if that is b""."""
    real = link.exchange

    def exchange(commands: bytes, **options: Any) -> bytes:
        heard = real(commands, **options)
        said = answer(commands)
        if said == b"":
            raise errors.TransportTimeout("lost")
        return heard if said is None else said

    monkeypatch.setattr(link, "exchange", exchange)


def test_an_unknown_flash_is_not_written(
    server: EthernetServer, link: UdpLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = server.card.flash_read(0, server.card.flash_size)
    monkeypatch.setattr(flash_layout, "_SIZES", {})
    with pytest.raises(errors.FlashError, match="7I92: flash id 0x14 is not known"):
        Flash(link).write(image())
    assert server.card.flash_read(0, len(before)) == before


ADDRESS_READ = lbp16.read(Lbp16Space.FLASH, 0)


def test_a_flash_that_stands_elsewhere_than_after_a_write_is_an_error(
    link: UdpLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    flash = Flash(link)
    flash.info()
    wrong = (0x123456).to_bytes(4, "little")
    answering(link, monkeypatch, lambda sent: wrong if sent == ADDRESS_READ else None)
    with pytest.raises(errors.FlashError, match="flash address is 0x123456 after an access at") as caught:
        flash.write(image())
    assert (caught.value.address, caught.value.received) == (USER, 0x123456)


def test_a_card_that_goes_silent_while_it_is_written_is_a_timeout(
    link: UdpLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    flash = Flash(link)
    flash.info()
    asked: list[bytes] = []
    answering(link, monkeypatch, lambda sent: asked.append(sent) or b"")
    with pytest.raises(errors.TransportTimeout):
        flash.write(image())
    assert 1 < len(asked) < 20, "tried again, but not for ever"
    asked.clear()
    with pytest.raises(errors.TransportTimeout):
        flash.read(USER, 4)
    assert 1 < len(asked) < 20


# ---- service


def test_an_address_that_reads_back_differently_is_an_error(
    link: UdpLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    eeprom = lbp16.read(Lbp16Space.EEPROM, 0, 24)
    answering(link, monkeypatch, lambda sent: bytes(48) if sent == eeprom else None)
    with pytest.raises(errors.TransportError, match=r"holds 0\.0\.0\.0 after 10\.0\.0\.9 was written"):
        EthernetService(link).set_ip("10.0.0.9")


@pytest.mark.parametrize("silent_reads", [False, True])
def test_an_address_whose_acknowledge_is_lost_is_looked_at(
    server: EthernetServer, link: UdpLink, monkeypatch: pytest.MonkeyPatch, silent_reads: bool
) -> None:
    """Taken for "not written" it surprises at the next power-up: the card is elsewhere."""
    eeprom = lbp16.read(Lbp16Space.EEPROM, 0, 24)
    answering(link, monkeypatch, lambda sent: None if sent == eeprom and not silent_reads else b"")
    if silent_reads:
        with pytest.raises(errors.TransportTimeout) as caught:
            EthernetService(link).set_ip("10.0.0.9")
        assert "10.0.0.9 may be stored" in caught.value.report()
    else:
        EthernetService(link).set_ip("10.0.0.9")
    assert server.card.peek(2, 0x20) == 0x0009


def test_an_unknown_card_is_not_reloaded() -> None:
    with EthernetServer(EthernetCard(EthernetDescription("7I9999"))) as server:
        link = UdpLink(server.host, server.port)
        before = server.card.image
        with pytest.raises(errors.FlashError, match="7I9999 is not known: how its FPGA reloads"):
            EthernetService(link).reload()
        assert server.card.image == before
        link.close()


# ---- looking for cards


def test_a_network_is_asked_in_portions() -> None:
    told: list[tuple[str, int, int]] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nobody:
        nobody.bind(("127.0.0.1", 0))
        port = nobody.getsockname()[1]
        addresses = [f"127.0.1.{n}" for n in range(1, 41)]
        found = discovery.answers(addresses, 0.0, port, progress=lambda *each: told.append(each))
    assert found == []
    assert told == [("asked", 32, 40), ("asked", 40, 40)]


def test_neither_a_missing_route_nor_a_wake_up_without_a_packet_ends_the_search(
    server: EthernetServer, link: UdpLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    link.exchange(lbp16.write(Lbp16Space.HOSTMOT2, 0x100, [0x55AACAFE]))
    real, calls = select.select, []

    def wake(read: Any, write: Any, other: Any, timeout: float) -> Any:
        calls.append(timeout)
        return (read, [], []) if len(calls) == 1 else real(read, write, other, timeout)

    monkeypatch.setattr(select, "select", wake)
    addresses = ["255.255.255.255", server.host]  # broadcasts are not allowed on such a socket
    assert discovery.answers(addresses, 0.2, server.port) == [server.host]
    assert len(calls) > 1


def test_what_answers_with_the_cookie_alone_is_named_by_its_address() -> None:
    """It has HostMot2, which is enough to connect; a name is not invented for it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        deaf.bind(("127.0.0.1", 0))
        port = deaf.getsockname()[1]
        found = discovery._identify("127.0.0.1", port, 0.001)
    assert (found.url, found.name, found.mac) == (f"udp://127.0.0.1:{port}", "", "")
