"""An interface for an Ethernet card alone: no delay of interrupts, one fixed address, nothing else."""

from __future__ import annotations

import ipaddress
import re
from pathlib import Path

from hostmot2.setup.files import MachineFile

NETWORK = Path("/etc/systemd/network")
ADDRESS = "10.10.10.11/24"
"""Beside 10.10.10.10, the address in a card's EEPROM as shipped."""
_LINK = """\
# For udev (systemd 250 or later), whoever manages the network
[Match]
# the interface by its address: names may change
MACAddress={mac}

[Link]
# only the first .link file that matches counts: these three lines are those of the system's own
NamePolicy=keep kernel database onboard slot path
AlternativeNamesPolicy=database onboard slot path
MACAddressPolicy=persistent
# no interrupt is held back (most NICs answer sooner, a few later: hm2 doctor {name} --ab rx-usecs=0 tells)
RxCoalesceSec=0
UseAdaptiveRxCoalesce=no
"""
_NETWORK = """\
# For systemd-networkd
[Match]
Name={name}

[Link]
# the machine may boot with the card switched off
RequiredForOnline=no

[Network]
# this host in the card's network; the card itself has another address
Address={address}
# the address is there before the card is
ConfigureWithoutCarrier=yes
# nothing but the card's packets on this line
DHCP=no
LinkLocalAddressing=no
IPv6AcceptRA=no
LLMNR=no
MulticastDNS=no
EmitLLDP=no
"""
_MAC = re.compile(r"[0-9a-f]{2}(:[0-9a-f]{2}){5}")


def net_files(name: str, mac: str, address: str = ADDRESS) -> tuple[list[MachineFile], list[str]]:
    """The .link and the .network file, and what to do as root once they are installed.

    Raises ValueError for a name, MAC or address that cannot be.
    """
    if not re.fullmatch(r"[A-Za-z0-9_.-]{1,15}", name):
        raise ValueError(f"{name!r} is no interface's name")
    if not _MAC.fullmatch(mac.lower()) or mac == "00:00:00:00:00:00":
        raise ValueError(f"{mac!r} is no MAC address such as 00:11:22:33:44:55")
    host = ipaddress.IPv4Interface(address)
    if host.network.prefixlen > 30 or host.ip == host.network.network_address:
        raise ValueError(f"{address} is no address of a host with its network, such as {ADDRESS}")
    then = [
        "udevadm control --reload && udevadm trigger --action=add --subsystem-match=net",
        "networkctl reload   # where systemd-networkd manages the network; NetworkManager instead:",
        f"nmcli connection add type ethernet ifname {name} con-name hostmot2 ipv4.method manual "
        f"ipv4.addresses {host} ipv6.method disabled",
        f"ethtool --set-eee {name} eee off   # if hm2 doctor {name} found it on; at each boot",
    ]
    link = _LINK.format(mac=mac.lower(), name=name)
    network = _NETWORK.format(name=name, address=host)
    files = [("link", link), ("network", network)]
    return [MachineFile("net", NETWORK / f"70-hostmot2-{name}.{kind}", body) for kind, body in files], then
