"""Finding Ethernet cards: known addresses, given networks, the ARP table.

A card is what answers with the HostMot2 cookie; no table of boards decides. Unlike a ping this tells cards
from other hosts, and it writes nothing.
"""

from __future__ import annotations

import fcntl
import ipaddress
import select
import socket
import struct
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hostmot2 import lbp16
from hostmot2.errors import HostMot2Error
from hostmot2.ethernet.service import EthernetService
from hostmot2.registers import Lbp16Space
from hostmot2.transports.udp import UdpLink

DEFAULT_ADDRESSES: Final = ("192.168.1.121", "10.10.10.10")
"""Fixed by jumper, and as shipped in the EEPROM."""
VENDOR_PREFIX: Final = "00:60:1b"
COOKIE: Final = 0x55AACAFE
_COOKIE_READ: Final = lbp16.read(Lbp16Space.HOSTMOT2, 0x100, increment=False)
_MAX_HOSTS: Final = 4096
Progress = Callable[[str, int, int], object]
_SIOCGIFADDR, _SIOCGIFNETMASK = 0x8915, 0x891B


@dataclass(frozen=True)
class FoundCard:
    """A card that answered."""

    url: str
    address: str
    name: str
    """As the card says; empty when it does not."""
    mac: str
    firmware_version: int
    jumpers: int


@dataclass(frozen=True)
class Discovery:
    """What a search brought."""

    cards: tuple[FoundCard, ...]
    asked: int
    """Addresses asked."""
    hints: tuple[str, ...]
    """Why a card may be there and not be reached, and what to do."""


@dataclass(frozen=True)
class Interface:
    """A network interface with an IPv4 address."""

    name: str
    network: ipaddress.IPv4Interface


def _silent(_what: str, _done: int, _total: int) -> None:
    """Nobody looks."""


def interfaces() -> list[Interface]:
    """The host's interfaces that have an IPv4 address (the first one of each)."""
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for _, name in socket.if_nameindex():
            request = struct.pack("256s", name.encode())
            try:
                address = fcntl.ioctl(sock, _SIOCGIFADDR, request)[20:24]
                mask = fcntl.ioctl(sock, _SIOCGIFNETMASK, request)[20:24]
            except OSError:
                continue  # down, or IPv6 only
            network = f"{socket.inet_ntoa(address)}/{socket.inet_ntoa(mask)}"
            found.append(Interface(name, ipaddress.IPv4Interface(network)))
    return found


def arp_addresses(table: str | None = None) -> list[str]:
    """Addresses in the ARP table whose MAC is of the cards' maker."""
    text = Path("/proc/net/arp").read_text() if table is None else table
    rows = (line.split() for line in text.splitlines()[1:])
    return [row[0] for row in rows if len(row) >= 4 and row[3].lower().startswith(VENDOR_PREFIX)]


def _hosts(networks: Iterable[str]) -> list[str]:
    hosts: list[str] = []
    for text in networks:
        network = ipaddress.IPv4Network(text, strict=False)
        if network.num_addresses > _MAX_HOSTS:
            raise ValueError(f"{text} has {network.num_addresses} addresses; search at most {_MAX_HOSTS}")
        hosts += [str(host) for host in network.hosts()]
    return hosts


def _networks_of(names: Sequence[str], known: Sequence[Interface]) -> list[str]:
    by_name = {interface.name: interface for interface in known}
    missing = [name for name in names if name not in by_name]
    if missing:
        raise ValueError(f"no interface {missing[0]} with an IPv4 address; there are {', '.join(by_name)}")
    return [str(by_name[name].network.network) for name in names]


def hints(addresses: Iterable[str], known: Sequence[Interface]) -> list[str]:
    """For each address that no interface's network holds: what to do."""
    told = []
    for text in addresses:
        address = ipaddress.IPv4Address(text)
        if any(address in interface.network.network for interface in known):
            continue
        own = address + 1 if address.packed[3] < 254 else address - 1
        told.append(
            f"this host has no address in {address}'s network: "
            f"sudo ip addr add {own}/24 dev INTERFACE (the one the card is plugged into)"
        )
    return told


def answers(
    addresses: Sequence[str], timeout: float = 0.3, port: int = lbp16.PORT, progress: Progress = _silent
) -> list[str]:
    """Those of the addresses where something answers a read of the cookie with the cookie."""
    found: dict[str, None] = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.setblocking(False)
        for count, address in enumerate(addresses, 1):
            _ask(sock, address, port)
            if count % 32 == 0:  # the kernel holds few unresolved neighbours
                _collect(sock, port, time.monotonic() + 0.02, found)
                progress("asked", count, len(addresses))
        _collect(sock, port, time.monotonic() + timeout, found)
        progress("asked", len(addresses), len(addresses))
    return list(found)


def _ask(sock: socket.socket, address: str, port: int) -> None:
    try:
        sock.sendto(_COOKIE_READ, (address, port))
    except OSError:
        return  # no route: the hints tell


def _collect(sock: socket.socket, port: int, deadline: float, found: dict[str, None]) -> None:
    while (left := deadline - time.monotonic()) > 0:
        if not select.select([sock], [], [], left)[0]:
            return
        try:
            reply, (address, from_port) = sock.recvfrom(2048)
        except OSError:
            continue
        if from_port == port and reply == COOKIE.to_bytes(4, "little"):
            found[address] = None


def _identify(address: str, port: int, timeout: float) -> FoundCard:
    url = f"udp://{address}" + ("" if port == lbp16.PORT else f":{port}")
    link = UdpLink(address, port, timeout=timeout)
    try:
        facts = EthernetService(link).facts()
        return FoundCard(url, address, facts.name, facts.mac, facts.firmware_version, facts.jumpers)
    except HostMot2Error:
        return FoundCard(url, address, "", "", 0, 0)  # it has HostMot2, that is enough to connect
    finally:
        link.close()


def discover(
    addresses: Sequence[str] = DEFAULT_ADDRESSES,
    *,
    subnets: Sequence[str] = (),
    interface_names: Sequence[str] = (),
    timeout: float = 0.3,
    port: int = lbp16.PORT,
    progress: Progress = _silent,
) -> Discovery:
    """Ask `addresses`, the maker's in the ARP table, and every host of `subnets` and of interfaces' networks.

    timeout: seconds to wait for answers. progress: called with "asked", how many, of how many.
    Raises ValueError for a network that is none or is too big.
    """
    known = interfaces()
    networks = [*subnets, *_networks_of(interface_names, known)]
    targets = list(dict.fromkeys([*addresses, *arp_addresses(), *_hosts(networks)]))
    found = answers(targets, timeout, port, progress)
    cards = tuple(_identify(address, port, timeout) for address in found)
    missing = [address for address in addresses if address not in found]
    return Discovery(cards, len(targets), tuple(hints(missing, known)))
