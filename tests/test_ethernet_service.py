"""Service of an Ethernet card: facts, EEPROM, counters, reset, reload, flash, discovery."""

from __future__ import annotations

import ipaddress
from pathlib import Path

import pytest
from bitfile_samples import efinix, payload, xilinx

from hostmot2 import errors, flash_layout, lbp16
from hostmot2.bitfile import parse_bitfile
from hostmot2.emulator.ethernet import EthernetCard, EthernetDescription, EthernetServer
from hostmot2.ethernet import EthernetService, Flash, discovery
from hostmot2.ethernet.discovery import Interface
from hostmot2.registers import Lbp16Space
from hostmot2.transports.udp import UdpLink

USER = 0x100000


def serve(**facts):
    quick = {"restart_us": 30_000, "reload_us": 30_000, "name": "7I92", **facts}
    return EthernetServer(EthernetCard(EthernetDescription(**quick)))


@pytest.fixture
def server():
    with serve() as server:
        yield server


@pytest.fixture
def link(server):
    link = UdpLink(server.host, server.port)
    yield link
    link.close()


def test_facts(server, link):
    facts = EthernetService(link).facts()
    assert (facts.name, facts.eeprom_name, facts.part) == ("7I92", "7I92", "6slx9tqg144")
    assert (facts.lbp_version, facts.firmware_version, facts.jumpers) == (3, 15, 1)
    assert (facts.mac, facts.eeprom_ip) == ("00:60:1b:10:12:34", "10.10.10.10")


def test_ip_change_is_stored_and_confirmed(server, link):
    service = EthernetService(link)
    service.set_ip("192.168.1.50")
    assert (server.card.peek(2, 0x20), server.card.peek(2, 0x22)) == (0x0132, 0xC0A8)
    assert service.facts().eeprom_ip == "192.168.1.50"
    for bad in ("224.0.0.1", "127.0.0.1", "0.0.0.0", "255.255.255.255", "10.10.10", "x"):
        with pytest.raises(ValueError, match=r"."):
            service.set_ip(bad)
    assert service.facts().eeprom_ip == "192.168.1.50"
    assert server.card.peek(6, 6) == 0


def test_an_address_that_does_not_take_is_told(server, link, monkeypatch):
    monkeypatch.setattr("hostmot2.ethernet.service.EEPROM_KEY", 0x1234)
    with pytest.raises(errors.TransportError):
        EthernetService(link).set_ip("192.168.1.50")
    assert EthernetService(link).counters().write_errors == 1


def test_counters_and_clearing(server, link):
    link.send(bytes.fromhex("80420001"))
    service = EthernetService(link)
    counters = service.counters()
    assert (counters.error_flags, counters.parse_errors) == (1, 1)
    assert counters.received == counters.received_lbp + 2  # the broken one, and this one not yet counted
    service.clear_errors()
    assert service.counters().parse_errors == 0


def test_time_stamps_move(server, link):
    service = EthernetService(link)
    first, second = service.time_stamps(), service.time_stamps()
    assert first.receive_start != second.receive_start
    assert (second.now - second.receive_start) % 0x10000 < 0x8000


def test_reset_clears_the_engine_and_keeps_the_registers(server, link):
    link.exchange(lbp16.write(Lbp16Space.HOSTMOT2, 0x40, [7]))
    link.exchange(lbp16.write(Lbp16Space.TIMER, 0x18, [9]))
    EthernetService(link).reset()
    assert server.card.peek(4, 0x18) == 0
    assert link.exchange(lbp16.read(Lbp16Space.HOSTMOT2, 0x40)) == bytes([7, 0, 0, 0])
    assert link.counters.writes_lost == 0


@pytest.mark.parametrize("name", ["7I92", "7I92T"])
@pytest.mark.parametrize("fallback", [False, True])
def test_reload(name, fallback):
    with serve(name=name, efinix=name.endswith("T")) as server:
        link = UdpLink(server.host, server.port)
        link.exchange(lbp16.write(Lbp16Space.HOSTMOT2, 0x40, [7]))
        EthernetService(link).reload(fallback=fallback)
        assert server.card.image == ("fallback" if fallback else "user")
        assert link.exchange(lbp16.read(Lbp16Space.HOSTMOT2, 0x40)) == bytes(4)
        link.close()


@pytest.mark.parametrize("kind", ["reset", "reload"])
def test_a_lost_restart_is_sent_again(server, link, monkeypatch, kind):
    """No card acknowledges it, and one that never heard of it answers at once, as if it were back."""
    link.exchange(lbp16.write(Lbp16Space.TIMER, 0x18, [9]))
    link.exchange(lbp16.write(Lbp16Space.HOSTMOT2, 0x40, [7]))
    send, lost = link.send, []
    monkeypatch.setattr(link, "send", lambda sent: send(sent) if lost else lost.append(sent))
    getattr(EthernetService(link), kind)()
    assert server.card.peek(4, 0x18) == 0
    stays = 7 if kind == "reset" else 0
    assert link.exchange(lbp16.read(Lbp16Space.HOSTMOT2, 0x40)) == bytes([stays, 0, 0, 0])


def test_a_card_that_does_not_restart_is_told(server, link, monkeypatch):
    monkeypatch.setattr(link, "send", lambda _sent: None)
    with pytest.raises(errors.TransportError, match="goes on as before"):
        EthernetService(link).reload(timeout=0.1)


def test_a_card_that_stays_away_is_told(server, link):
    server.card.flash_write(USER, b"\xff" * 64)
    server.card.flash_write(0x10000, b"\xff" * 64)
    with pytest.raises(errors.TransportTimeout, match="come back"):
        EthernetService(link).reload(timeout=0.3)


def test_old_firmware_cannot_reload():
    with serve(firmware_version=14) as server:
        link = UdpLink(server.host, server.port)
        with pytest.raises(errors.FirmwareTooOld):
            EthernetService(link).reload()
        link.close()


def test_flash_info(server, link):
    info = Flash(link).info()
    assert (info.size, info.user_address, info.user_size) == (0x200000, USER, 0x100000)
    assert info.boot_block_ok


def test_flash_write_verify_and_nothing_below_the_user_area(server, link):
    below = server.card.flash_read(0, USER)
    server.card.flash_write(USER, b"\x00" * 0x30000)
    image = parse_bitfile(xilinx(payload(0x10000 + 777)))
    flash = Flash(link)
    with pytest.raises(errors.FlashError, match="0x100000"):
        flash.verify(image)
    steps = []
    assert flash.write(image, progress=lambda what, done, total: steps.append((what, done, total))) == 2
    assert server.card.flash_read(USER, len(image.data)) == image.data
    assert server.card.flash_read(USER + len(image.data), 0x20000 - len(image.data)).strip(b"\xff") == b""
    assert server.card.flash_read(USER + 0x20000, 16) == bytes(16)  # sectors that are not needed stay
    assert server.card.flash_read(0, USER) == below
    assert [step for step in steps if step[0] == "erase"][-1] == ("erase", len(image.data), len(image.data))
    flash.verify(image)


def test_flash_write_under_loss(server, link):
    server.set_fault("loss=5%,dup=3%,seed=4")
    image = parse_bitfile(xilinx(payload(5000, seed=2)))
    Flash(link).write(image)
    assert server.card.flash_read(USER, len(image.data)) == image.data


def test_dry_run_changes_nothing(server, link):
    before = server.card.flash_read(0, 0x200000)
    assert Flash(link).write(parse_bitfile(xilinx(payload(70000))), dry_run=True) == 2
    assert server.card.flash_read(0, 0x200000) == before


@pytest.mark.parametrize(
    "image", [xilinx(payload(2000), part="6slx16ftg256"), efinix(payload(2000)), xilinx(payload(0x100001))]
)
def test_images_that_do_not_belong_are_refused(server, link, image):
    before = server.card.flash_read(0, 0x200000)
    with pytest.raises(errors.BitfileError):
        Flash(link).write(parse_bitfile(image))
    assert server.card.flash_read(0, 0x200000) == before


def test_a_wrong_boot_block_stops_the_write(server, link):
    server.card.flash_write(20, b"\x12")
    with pytest.raises(errors.FlashError, match="boot block"):
        Flash(link).write(parse_bitfile(xilinx(payload(2000))))


def test_the_user_area_is_guarded(server, link):
    flash = Flash(link)
    for address in (0, 0x10000, USER - 0x100, 0x200000):
        with pytest.raises(errors.FlashError, match="outside"):
            flash._erase(address)
        with pytest.raises(errors.FlashError, match="outside"):
            flash._write_page(address, bytes(256))


def test_backup_is_the_whole_device(server, link):
    assert Flash(link).backup() == server.card.flash_read(0, 0x200000)


def test_efinix_cards_have_no_boot_block():
    with serve(name="7I96S", efinix=True) as server:
        link = UdpLink(server.host, server.port)
        flash = Flash(link)
        assert flash.info().boot_block_ok is None
        image = parse_bitfile(efinix(payload(3000)))
        flash.write(image)
        assert server.card.flash_read(USER, 3000) == image.data
        link.close()


def test_a_broken_write_is_found(server, link, monkeypatch):
    monkeypatch.setattr("hostmot2.ethernet.flash._KEY", 0x5A03)
    image = parse_bitfile(xilinx(payload(3000)))
    flash = Flash(link)
    write_page = flash._write_page
    monkeypatch.setattr(
        flash, "_write_page", lambda address, page: write_page(address, page[:8] + b"\0" + page[9:])
    )
    with pytest.raises(errors.FlashError) as caught:
        flash.write(image)
    assert caught.value.address == USER + 8


def test_unknown_boards_are_left_alone():
    with serve(name="7I99X") as server:
        link = UdpLink(server.host, server.port)
        with pytest.raises(errors.FlashError, match="not known"):
            Flash(link).info()
        link.close()


def test_discovery_finds_what_answers_with_the_cookie(server):
    link = UdpLink(server.host, server.port)
    link.exchange(lbp16.write(Lbp16Space.HOSTMOT2, 0x100, [0x55AACAFE]))
    link.close()
    found = discovery.discover(["127.0.0.1", "127.0.0.2"], port=server.port, timeout=0.2)
    assert [(card.address, card.name, card.mac) for card in found.cards] == [
        ("127.0.0.1", "7I92", "00:60:1b:10:12:34")
    ]
    assert found.cards[0].url == f"udp://127.0.0.1:{server.port}"


def test_discovery_asks_for_no_name_to_connect():
    with serve(name="NOBODY") as server:
        link = UdpLink(server.host, server.port)
        assert discovery.answers(["127.0.0.1"], 0.05, server.port) == []  # no cookie, no card
        link.exchange(lbp16.write(Lbp16Space.HOSTMOT2, 0x100, [0x55AACAFE]))
        link.close()
        found = discovery.discover((), subnets=["127.0.0.0/30"], port=server.port, timeout=0.2)
        assert [card.name for card in found.cards] == ["NOBODY"]


def test_addresses_outside_the_hosts_networks_get_a_hint():
    known = [Interface("eth0", ipaddress.IPv4Interface("192.168.1.7/24"))]
    told = discovery.hints(["192.168.1.121", "10.10.10.10"], known)
    assert told == [
        "this host has no address in 10.10.10.10's network: sudo ip addr add 10.10.10.11/24 dev INTERFACE "
        "(the one the card is plugged into)"
    ]


def test_arp_table_by_vendor():
    table = (
        "IP address       HW type     Flags       HW address            Mask     Device\n"
        "10.0.0.5         0x1         0x2         00:60:1B:10:12:34     *        eth0\n"
        "10.0.0.6         0x1         0x2         52:54:00:10:12:34     *        eth0\n"
        "10.0.0.7\n"
    )
    assert discovery.arp_addresses(table) == ["10.0.0.5"]
    assert isinstance(discovery.arp_addresses(), list)


def test_huge_networks_are_refused():
    with pytest.raises(ValueError, match="at most"):
        discovery.discover(subnets=["10.0.0.0/8"])
    with pytest.raises(ValueError, match="no interface"):
        discovery.discover(interface_names=["nope0"])


def test_the_driver_never_uses_the_factory_key():
    root = Path(flash_layout.__file__).parent
    for path in root.rglob("*.py"):
        if path.name != "registers.py":  # the register map names it
            text = path.read_text().lower()
            assert "0x3602" not in text, path
            assert "key.factory" not in text, path
