"""Network links over netlink, by pyroute2: what they are, and the two settings that cost latency.

pyroute2 (extra `doctor`) is licensed GPL-2.0-or-later or Apache-2.0, at the user's choice; it is used under
Apache-2.0.
"""

from __future__ import annotations

import errno
import ipaddress
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

_NO_ROUTE = (errno.ENETUNREACH, errno.EHOSTUNREACH)
_UNSUPPORTED = (errno.EOPNOTSUPP, errno.EINVAL, errno.ENODEV)  # the last two of devices that are no NICs
NEEDS = "network settings need pyroute2: pip install 'hostmot2[doctor]'"


@dataclass(frozen=True)
class Link:
    """One network interface. kind: "" for hardware, else veth, bridge and so on. addresses: with prefixes."""

    name: str
    index: int
    up: bool
    carrier: bool
    mac: str
    kind: str
    addresses: tuple[str, ...]


@dataclass(frozen=True)
class Coalescing:
    """How long interrupts are held back. Microseconds; 0: none."""

    rx_usecs: int
    tx_usecs: int
    adaptive_rx: bool
    adaptive_tx: bool


class Links(Protocol):
    """What the examination asks of the network."""

    def all(self) -> list[Link]:
        """Every interface."""

    def towards(self, address: str) -> tuple[str, bool]:
        """The interface packets to an address leave by, and whether they go there without a gateway."""

    def coalescing(self, name: str) -> Coalescing | None:
        """An interface's interrupt coalescing; None if its driver has none."""

    def set_coalescing(self, name: str, **values: int) -> None:
        """Change fields of Coalescing. OSError if the driver refuses."""

    def eee(self, name: str) -> bool | None:
        """Whether Energy-Efficient Ethernet is on; None if the driver has none."""

    def set_eee(self, name: str, on: bool) -> None:
        """Switch it. OSError if the driver refuses."""


_FIELDS = {
    "rx_usecs": "rx_coalesce_usecs",
    "tx_usecs": "tx_coalesce_usecs",
    "adaptive_rx": "use_adaptive_rx_coalesce",
    "adaptive_tx": "use_adaptive_tx_coalesce",
}


class NetlinkLinks:
    """The machine's own network. ImportError with what to install if pyroute2 is not there."""

    def __init__(self) -> None:
        try:
            from pyroute2 import IPRoute
            from pyroute2.ethtool import Ethtool
        except ModuleNotFoundError as missing:
            raise ImportError(NEEDS) from missing
        self._route, self._ethtool = IPRoute, Ethtool

    def all(self) -> list[Link]:
        """Every interface."""
        with self._route() as route:
            addresses: dict[int, list[str]] = {}
            for message in route.get_addr(family=2):
                text = f"{message.get_attr('IFA_ADDRESS')}/{message['prefixlen']}"
                addresses.setdefault(message["index"], []).append(text)
            return [
                _link(message, tuple(addresses.get(message["index"], ()))) for message in route.get_links()
            ]

    def towards(self, address: str) -> tuple[str, bool]:
        """See Links."""
        wanted = str(ipaddress.IPv4Address(address))
        with self._route() as route:
            try:
                found = route.route("get", dst=wanted)[0]
            except Exception as refusal:
                if getattr(refusal, "code", None) not in _NO_ROUTE:
                    raise
                return "", False
            names = {message["index"]: message.get_attr("IFLA_IFNAME") for message in route.get_links()}
        return names.get(found.get_attr("RTA_OIF"), ""), found.get_attr("RTA_GATEWAY") is None

    def coalescing(self, name: str) -> Coalescing | None:
        """See Links."""
        with self._ethtool() as ethtool:
            try:
                found = ethtool.get_coalesce(name)
            except Exception as refusal:
                _raise_unless_unsupported(refusal)
                return None
        numbers = {ours: int(found[theirs]) for ours, theirs in _FIELDS.items()}
        return Coalescing(
            numbers["rx_usecs"],
            numbers["tx_usecs"],
            bool(numbers["adaptive_rx"]),
            bool(numbers["adaptive_tx"]),
        )

    def set_coalescing(self, name: str, **values: int) -> None:
        """See Links."""
        with self._ethtool() as ethtool:
            found = ethtool.get_coalesce(name)
            for ours, value in values.items():
                found[_FIELDS[ours]] = int(value)
            with _as_os_error(name):
                ethtool.set_coalesce(name, found)

    def eee(self, name: str) -> bool | None:
        """See Links."""
        from hostmot2.doctor.eee import get_eee

        try:
            return get_eee(name)
        except Exception as refusal:
            _raise_unless_unsupported(refusal)
            return None

    def set_eee(self, name: str, on: bool) -> None:
        """See Links."""
        from hostmot2.doctor.eee import set_eee

        with _as_os_error(name):
            set_eee(name, on)


@contextmanager
def _as_os_error(name: str) -> Iterator[None]:
    """pyroute2's errors as the operating system's."""
    try:
        yield
    except OSError:
        raise
    except Exception as refusal:
        code = getattr(refusal, "code", None) or errno.EOPNOTSUPP
        raise OSError(code, f"{os.strerror(code)} by its driver", name) from refusal


def _raise_unless_unsupported(refusal: Exception) -> None:
    """Nothing for "not supported" in any of pyroute2's forms; raises everything else."""
    code = getattr(refusal, "code", None) or getattr(refusal, "errno", None)
    if type(refusal).__name__ == "NotSupportedError" or code in _UNSUPPORTED:
        return
    raise refusal


def _link(message: Any, addresses: tuple[str, ...]) -> Link:
    info = message.get_attr("IFLA_LINKINFO")
    return Link(
        name=message.get_attr("IFLA_IFNAME"),
        index=message["index"],
        up=bool(message["flags"] & 1),
        carrier=bool(message.get_attr("IFLA_CARRIER")),
        mac=message.get_attr("IFLA_ADDRESS") or "",
        kind=info.get_attr("IFLA_INFO_KIND") if info else "",
        addresses=addresses,
    )
