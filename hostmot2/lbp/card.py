"""LBP through an FPGA card: the pass-through of SSLBP's setup mode. Source: lbp_serial.md 7.1."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hostmot2.lbp.client import LbpRemote
from hostmot2.lbp.errors import FirmwareRefused, LineSilent
from hostmot2.lbp.frame import COOKIE, DISCOVERY, UNIT_NUMBER, Command
from hostmot2.lbp.link import NORMAL_S, LineCounters
from hostmot2.lbp.opening import SETUP_BAUD
from hostmot2.registers import LbpHeader, LbpKind
from hostmot2.sserial import NoRemote, RemoteSilent, SserialPort

_ACCESS = LbpHeader.access

SETTLE_S = 0.002
"""After a failed transfer the channel may still listen; what it then hears belongs to that transfer."""

FLASH_REVISION = 34
FLASH_REVISION_8I20 = 37
"""Minor revisions of SSLBP 1 from which flash can be reached."""


class CardLink:
    """One channel of a smart-serial port in setup mode. SSLBP makes frames and checks CRCs itself.

    RPCs other than unit number and discovery cannot be passed through (ValueError).
    """

    def __init__(self, port: SserialPort, channel: int) -> None:
        self.port = port
        self.number = channel
        self.url = f"{port.label} channel {channel}"
        self.counters = LineCounters()
        self.crc = True

    def open(self) -> None:
        """Start the channel in setup mode, if need be without CRC: old 8I20s may have theirs switched off.

        Raises NoRemote, PortRunning.
        """
        try:
            self.port.restart_setup(self.number)
        except NoRemote:
            self._without_crc()

    def _without_crc(self) -> None:
        channel = self.port.channels[self.number]
        self.port.stop()
        channel.crc = False
        try:
            self.port.restart_setup(self.number)
            self.crc = False
        except BaseException:
            self.port.stop()
            channel.crc = True  # frames without a checksum are for whoever asked for them
            raise

    def transact(self, command: Command, timeout_s: float = NORMAL_S) -> bytes:
        """See Link.transact. SSLBP waits 50 ms; a cookie is asked for again until `timeout_s`."""
        self.counters.commands += 1
        tries = max(1, round(timeout_s / 0.05)) if command == COOKIE else 1
        while True:
            try:
                return self._access(command)
            except RemoteSilent as silence:
                self.counters.silent += 1
                tries -= 1
                if not tries:
                    raise LineSilent(f"{self.url}: no answer to {command}") from silence
                self.settle()

    def _access(self, command: Command) -> bytes:
        header, rest = command.data[0], command.data[1:]
        if command in (UNIT_NUMBER, DISCOVERY):
            return self._known(command)
        if _ACCESS.kind.get(header) == LbpKind.RPC:
            raise ValueError(f"{self.url}: RPC {header & 0x3F} cannot be passed through a card")
        addressed = _ACCESS.kind.get(header) == LbpKind.DATA and _ACCESS.address.get(header)
        address = int.from_bytes(rest[:2], "little") if addressed else 0
        value = int.from_bytes(rest[2:] if addressed else rest, "little")
        read = self.port.access_remote(self.number, header, address, value)
        return (read & (1 << 8 * command.reply) - 1).to_bytes(command.reply, "little")

    def _known(self, command: Command) -> bytes:
        """What the start has found out."""
        found = self.port.identity(self.number)
        if command == UNIT_NUMBER:
            return found.unit_number.to_bytes(4, "little")
        sizes = bytes(self.port.process_data_sizes(self.number))
        return sizes + found.toc.to_bytes(4, "little")

    def settle(self) -> None:
        """Let the channel finish listening."""
        self.port.pause(SETTLE_S)

    def resync(self) -> None:
        """Start the channel anew: its error counters would soon declare it dead."""
        self.counters.resyncs += 1
        try:
            self.port.restart_setup(self.number)
        except RemoteSilent as silence:
            raise LineSilent(f"{self.url}: {silence}") from silence

    def close(self) -> None:
        """Stop the channel."""
        self.port.stop(1 << self.number)
        if not self.crc:
            self.port.channels[self.number].crc = True


def open_channel(port: SserialPort, channel: int) -> LbpRemote:
    """The remote of a channel, spoken to in setup mode. Raises PortRunning, NoRemote."""
    return LbpRemote(CardLink(port, channel))


def check_flash_revision(port: SserialPort, name: str = "") -> None:
    """Raises FirmwareRefused if the card's SSLBP cannot reach the flash of a remote of this name."""
    major, _, minor = port.revision.partition(".")
    needed = FLASH_REVISION_8I20 if name == "8I20" else FLASH_REVISION
    if (int(major), int(minor)) < (1, needed):
        raise FirmwareRefused(f"{port.label}: SSLBP {port.revision} cannot reach flash, 1.{needed} can")


@contextmanager
def setup_rate(port: SserialPort, channel: int, baud: int = SETUP_BAUD) -> Iterator[None]:
    """Inside, the channel runs at the rate of remotes with their set-up jumper in place, as an update needs.

    Raises FirmwareRefused for SSLBP that cannot reach flash, PortRunning.
    """
    _ = port.channels  # makes itself known with the first use
    port.stop()
    check_flash_revision(port)
    usual = port.channels[channel].baud_rate
    port.channels[channel].baud_rate = baud
    try:
        yield
    finally:
        port.stop()  # the last byte has left before the rate changes
        port.channels[channel].baud_rate = usual
