"""What an Ethernet card tells and takes beside its HostMot2 registers. Fact sheet lbp16.md 5, 6."""

from __future__ import annotations

import ipaddress
import struct
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from hostmot2 import boards, errors, flash_layout, lbp16
from hostmot2.errors import FirmwareTooOld, FlashError, TransportError, TransportTimeout
from hostmot2.registers import Lbp16Board, Lbp16Control, Lbp16Eeprom, Lbp16Key, Lbp16Space, Lbp16Timer
from hostmot2.transports.udp import UdpLink

EEPROM_KEY: Final = Lbp16Key.EEPROM
"""Opens the user's part of the EEPROM for one datagram. MAC and name stay closed: there is no key here."""

JUMPERS: Final = ("fixed 192.168.1.121", "address in EEPROM", "BOOTP", "invalid")
RELOAD_FIRMWARE: Final = 15
_MARK_ADDRESS, _MARK = Lbp16Timer.scratch.number + 14, 0x5A5A
"""The last scratch word: no driver uses it, and it is 0 after a restart."""
_RESTART_ATTEMPTS: Final = 4
RESTART_TIMEOUT: Final = 10.0
"""Seconds a card gets to come back: FPGA configuration and a new Ethernet link."""


@dataclass(frozen=True)
class CardFacts:
    """Who the card is."""

    name: str
    lbp_version: int
    firmware_version: int
    jumpers: int
    """0 fixed address, 1 EEPROM, 2 BOOTP; as sampled at boot."""
    mac: str
    eeprom_ip: str
    """The address used with the jumpers on EEPROM, from the next boot on."""
    eeprom_name: str
    led_mode: int
    part: str | None
    """The FPGA, if the board is known."""


@dataclass(frozen=True)
class PacketCounters:
    """The engine's counters since it started; packet counters wrap at 65536, error counters stop there."""

    error_flags: int
    parse_errors: int
    memory_errors: int
    write_errors: int
    received: int
    received_lbp: int
    received_bad: int
    sent: int
    sent_lbp: int
    sent_bad: int


@dataclass(frozen=True)
class TimeStamps:
    """Microseconds of the card's free running 16-bit clock, which wraps every 65.5 ms."""

    now: int
    receive_start: int
    receive_end: int
    send_start: int
    send_end: int


class EthernetService:
    """A card's other memory spaces. One thread at a time; do not use while a Board drives the card."""

    def __init__(self, link: UdpLink) -> None:
        self.link = link

    def facts(self) -> CardFacts:
        """Names, versions, addresses. Raises TransportTimeout."""
        info = self.link.exchange(lbp16.read(Lbp16Space.BOARD, Lbp16Board.card_name.number, 11))
        eeprom = self.link.exchange(lbp16.read(Lbp16Space.EEPROM, 0, 24))
        name = _text(info[:16])
        version, firmware, jumpers = struct.unpack_from("<3H", info, 16)
        board = boards.find(name)
        return CardFacts(
            name=name,
            lbp_version=version,
            firmware_version=firmware,
            jumpers=jumpers,
            mac=":".join(f"{octet:02x}" for octet in reversed(eeprom[2:8])),
            eeprom_ip=_address(eeprom),
            eeprom_name=_text(eeprom[16:32]),
            led_mode=int.from_bytes(eeprom[0x28:0x2A], "little"),
            part=board.fpga if board else None,
        )

    def set_ip(self, ip: str) -> None:
        """Write the EEPROM address and read it back; it holds from the next boot on with jumpers on EEPROM.

        Raises ValueError for an address no host can have, TransportError if it did not take.
        """
        address = ipaddress.IPv4Address(ip)
        if address.is_multicast or address.is_loopback or address.is_unspecified or address.is_reserved:
            raise ValueError(f"{ip} cannot be a card's address")
        a, b, c, d = address.packed
        key = lbp16.write(Lbp16Space.CONTROL, Lbp16Control.write_key.number, [EEPROM_KEY])
        write = lbp16.write(Lbp16Space.EEPROM, Lbp16Eeprom.ip_low.number, [c << 8 | d, a << 8 | b])
        with suppress(TransportTimeout):  # only the acknowledge may be lost: what it holds now decides
            self.link.exchange(key + write, timeout=1.0)
        try:
            stored = _address(self.link.exchange(lbp16.read(Lbp16Space.EEPROM, 0, 24)))
        except TransportError as silence:
            silence.add_note(f"{address} may be stored: look at it (`hm2 ip`) before the next power-up")
            raise
        if stored != str(address):
            raise TransportError(f"the EEPROM holds {stored} after {address} was written")

    def counters(self) -> PacketCounters:
        """The engine's error and packet counters."""
        return PacketCounters(*self.link.read_words(Lbp16Space.CONTROL, Lbp16Control.error_flags.number, 10))

    def clear_errors(self) -> None:
        """Error flags and LBP error counters to 0."""
        self.link.exchange(lbp16.write(Lbp16Space.CONTROL, Lbp16Control.error_flags.number, [0, 0, 0, 0]))

    def time_stamps(self) -> TimeStamps:
        """Now, and those of the last packet."""
        reply = self.link.exchange(
            lbp16.read(Lbp16Space.TIMER, Lbp16Timer.timestamp.number)
            + lbp16.read(Lbp16Space.BOARD, Lbp16Board.rx_start.number, 4)
        )
        return TimeStamps(*struct.unpack("<5H", reply))

    def reset(self, timeout: float = RESTART_TIMEOUT) -> None:
        """Restart the Ethernet engine and wait until it answers. The FPGA's registers stay.

        Jumpers and EEPROM are read again, so the card may come back under another address: then this
        raises TransportTimeout.
        """
        self._restart(lbp16.write(Lbp16Space.CONTROL, Lbp16Control.reset.number, [1]), timeout)

    def reload(self, *, fallback: bool = False, timeout: float = RESTART_TIMEOUT) -> None:
        """Configure the FPGA anew from its flash (power-up state: all outputs off) and wait for the card.

        Raises FirmwareTooOld before firmware 15, FlashError for an unknown board, TransportTimeout when
        the card does not come back.
        """
        facts = self.facts()
        if facts.firmware_version < RELOAD_FIRMWARE:
            raise FirmwareTooOld(
                f"{facts.name}: firmware {facts.firmware_version} cannot reload, {RELOAD_FIRMWARE} can",
                expected=RELOAD_FIRMWARE,
                received=facts.firmware_version,
            )
        if facts.part is None:
            raise FlashError(f"{facts.name} is not known: how its FPGA reloads is not either")
        words = (
            flash_layout.efinix_reload_words(fallback)
            if is_efinix(facts.part)
            else flash_layout.xilinx_reload_words(flash_layout.FALLBACK_ADDRESS if fallback else 0)
        )
        self._restart(
            b"".join(
                lbp16.write(Lbp16Space.CONTROL, Lbp16Control.icap.number, [word], increment=False)
                for word in words
            ),
            timeout,
        )

    def _restart(self, commands: bytes, timeout: float) -> None:
        """Send what makes the card restart. No card acknowledges that; a scratch word shows if it did."""
        self.link.exchange(lbp16.write(Lbp16Space.TIMER, _MARK_ADDRESS, [_MARK]))
        for _ in range(_RESTART_ATTEMPTS):
            self.link.send(commands)
            self.link.clear()
            self._wait(timeout)
            if self.link.read_words(Lbp16Space.TIMER, _MARK_ADDRESS, 1) != [_MARK]:
                return
        raise TransportError(
            f"udp://{self.link.host}: told to restart {_RESTART_ATTEMPTS} times the card goes on as before"
        )

    def _wait(self, timeout: float) -> None:
        # what was sent takes effect at once, so the first answer is that of the restarted card
        deadline = time.monotonic() + timeout
        while True:
            try:
                self.link.exchange(lbp16.read(Lbp16Space.BOARD, Lbp16Board.card_name.number, 8), timeout=0.1)
            except errors.TransportError:
                self.link.clear()
                if time.monotonic() >= deadline:
                    raise TransportTimeout(
                        f"udp://{self.link.host}: the card did not come back within {timeout:g} s. "
                        "It may have another address now: see its IP jumpers."
                    ) from None
                time.sleep(0.02)
            else:
                self.link.clear()
                return


def is_efinix(part: str) -> bool:
    """Whether a part is one of Efinix, by its name."""
    return part.startswith("T")


def _text(name: bytes) -> str:
    return name.split(b"\0")[0].decode("ascii", "replace")


def _address(eeprom: bytes) -> str:
    return str(ipaddress.IPv4Address(bytes(reversed(eeprom[0x20:0x24]))))
