"""udp://: an Ethernet card, LBP16 in UDP datagrams. Fact sheet lbp16.md 2, 8."""

from __future__ import annotations

import os
import socket
import struct
from typing import Any
from urllib.parse import parse_qs, urlsplit

from hostmot2 import errors, lbp16
from hostmot2._core import ffi, lib
from hostmot2.registers import Lbp16Board, Lbp16Space
from hostmot2.transports.base import LinkCounters, Transport

LBP_VERSION = 3
"""The first version with the scratch words that sequence numbers need."""


class UdpLink:
    """A connected socket to one card: the bus a Board takes over, and the card's other memory spaces.

    One thread at a time. `timeout` is in seconds, for commands of this class; the board has its own.
    """

    def __init__(
        self,
        host: str,
        port: int = lbp16.PORT,
        *,
        timeout: float = 0.2,
        spin_us: int = 30,
        retry_ms: float = 25.0,
        error_limit: int = 10,
    ) -> None:
        self.host, self.port, self.timeout = host, port, timeout
        config: Any = ffi.new("hm2_udp_config *")
        lib.hm2_udp_defaults(config)
        config.spin_ns = spin_us * 1000
        config.retry_ns = round(retry_ms * 1e6)
        config.error_limit = error_limit
        self.bus: Any = ffi.new("hm2_bus *")
        """The `hm2_bus *`."""
        self._error = errors.new_error()
        out: Any = ffi.new("struct hm2_udp **")
        self._check(self._open(config, out))
        self._udp = out[0]
        self._closed = False

    def _open(self, config: Any, out: Any) -> int:
        """Make the bus; a status."""
        try:
            address = socket.getaddrinfo(self.host, self.port, socket.AF_INET, socket.SOCK_DGRAM)[0][4][0]
        except socket.gaierror as error:
            raise errors.CardNotFound(f"{self.host}: {error.strerror}") from error
        return int(lib.hm2_udp_bus(str(address).encode(), self.port, config, self.bus, out, self._error))

    @property
    def handle(self) -> Any:
        """The `struct hm2_udp *`. Raises TransportClosed."""
        if self._closed:
            raise errors.TransportClosed(f"udp://{self.host}:{self.port} is closed")
        return self._udp

    def _check(self, status: int) -> None:
        if status == lib.HM2_ERR_IO:
            reason = os.strerror(self._error.os_errno)
            raise errors.TransportError(
                f"udp://{self.host}:{self.port}: {reason}", os_errno=int(self._error.os_errno)
            )
        if status == lib.HM2_ERR_TIMEOUT:
            raise errors.TransportTimeout(f"udp://{self.host}:{self.port}: no answer")
        errors.check(status, self._error)

    def exchange(self, commands: bytes, timeout: float | None = None) -> bytes:
        """Any commands as one datagram; what they read.

        Every exchange is acknowledged by the card, those that only write as well. Reads are repeated when
        unanswered, writes never. Raises TransportTimeout (also when the card found an error in the
        commands: it says nothing then), LinkFailed, ValueError for no packet or one too big.
        """
        size = lbp16.reply_size(commands)
        reply = ffi.new("uint8_t[]", max(1, size))
        wait = self.timeout if timeout is None else timeout
        handle = self.handle  # closed: the bus's clock is gone with it
        deadline = self.bus.now_ns(self.bus.self) + round(wait * 1e9)
        self._check(lib.hm2_udp_lbp16(handle, commands, len(commands), reply, size, deadline, self._error))
        return bytes(ffi.buffer(reply, size))

    def send(self, commands: bytes) -> None:
        """One datagram that the card will not answer."""
        self._check(lib.hm2_udp_send(self.handle, commands, len(commands), self._error))

    def read_words(self, space: int, address: int, count: int) -> list[int]:
        """16-bit words of a space other than HostMot2 and flash."""
        return list(struct.unpack(f"<{count}H", self.exchange(lbp16.read(space, address, count))))

    @property
    def counters(self) -> LinkCounters:
        """What happened so far."""
        counters: Any = ffi.new("hm2_udp_counters *")
        lib.hm2_udp_get_counters(self.handle, counters)
        values = {name: int(getattr(counters, name)) for name in LinkCounters.__dataclass_fields__}
        return LinkCounters(**{**values, "failed": bool(values["failed"])})  # type: ignore[arg-type]

    def clear(self) -> None:
        """Error level 0; forget the card's last sequence number, as after a restart of its engine."""
        lib.hm2_udp_clear(self.handle)

    def give_up(self) -> None:
        """As by too many errors: LinkFailed until clear()."""
        lib.hm2_udp_give_up(self.handle)

    def close(self) -> None:
        """Close the socket, unless a board has taken the bus over and closed it."""
        if not self._closed:
            self._closed = True
            self.bus.close(self.bus.self)

    def disown(self) -> None:
        """The bus was closed by the board that took it over."""
        self._closed = True


def _options(url: str) -> dict[str, float]:
    known = {"spin_us": int, "retry_ms": float, "error_limit": int}
    options: dict[str, float] = {}
    for key, values in parse_qs(urlsplit(url).query).items():
        if key not in known:
            raise ValueError(f"{url}: options are {', '.join(known)}, not {key}")
        options[key] = known[key](values[-1])
    return options


def open_transport(url: str) -> Transport:
    """Open the card at `udp://host[:port][?spin_us=30&retry_ms=25&error_limit=10]`.

    The card is asked for its name and LBP16 version; no table of boards decides. Raises TransportTimeout
    if nothing answers, FirmwareTooOld without scratch words, ValueError for another URL.
    """
    parts = urlsplit(url)
    if not parts.hostname:
        raise ValueError(f"{url}: udp://HOST[:PORT]")
    link = UdpLink(parts.hostname, parts.port or lbp16.PORT, **_options(url))  # type: ignore[arg-type]
    return transport_over(link, url)


def transport_over(link: UdpLink, url: str) -> Transport:
    """The card at the end of a link, which is closed if it is none that can be used. Errors as for a URL."""
    try:
        name, version = _identify(link)
        if version < LBP_VERSION:
            raise errors.FirmwareTooOld(
                f"{url}: {name} speaks LBP16 version {version}, {LBP_VERSION} is needed",
                expected=LBP_VERSION,
                received=version,
            )
    except BaseException:
        link.close()
        raise
    return Transport(
        bus=link.bus,
        url=url,
        model=name or None,
        keep=(link,),
        on_close=[link.disown],
        on_recover=[link.clear],
        on_give_up=[link.give_up],
        given_up=lambda: link.counters.failed,
        link_counters=lambda: link.counters,
    )


def _identify(link: UdpLink) -> tuple[str, int]:
    facts = link.exchange(lbp16.read(Lbp16Space.BOARD, Lbp16Board.card_name.number, 9))
    return facts[:16].split(b"\0")[0].decode("ascii", "replace"), int.from_bytes(facts[16:18], "little")
