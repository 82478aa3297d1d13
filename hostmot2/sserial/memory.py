"""What a port reads and writes besides process data: the firmware's variables and the remotes' memory."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import TYPE_CHECKING, Literal

from hostmot2.errors import StaleRequest
from hostmot2.register_map import Register
from hostmot2.sserial.core import Core, stale
from hostmot2.sserial.counters import ChannelCounters
from hostmot2.sserial.errors import PortRunning, RemoteSilent

if TYPE_CHECKING:
    from hostmot2.sserial.remotes import Remotes
    from hostmot2.sserial.results import StartResult

POWER_UP_SECONDS = 0.001
"""Within this the processor has begun, if the card got its power just now, and has ended what it was at."""


STABLE_READS = 8


class PortMemory(ABC):
    """The part of `SserialPort` that needs no process data to run, and mostly that none runs."""

    _core: Core
    _remotes: Remotes
    _lock: AbstractContextManager[object]
    _is_ready: bool

    @property
    @abstractmethod
    def label(self) -> str:
        """What messages call the port."""

    @abstractmethod
    def _identify(self) -> None: ...

    @abstractmethod
    def pause(self, seconds: float) -> None:
        """See SserialPort.pause."""

    @abstractmethod
    def start(self, mask: int, mode: Literal["normal", "setup"] = "normal") -> StartResult:
        """See SserialPort.start."""

    def _ready(self) -> None:
        """Reset the processor and learn what it is, once."""
        if self._is_ready:
            return
        self._core.reset()
        self._identify()
        self._core.stop()
        self._is_ready = True

    @contextmanager
    def untouched(self) -> Iterator[None]:
        """In the with block the first use does not reset the port: read what the last program left.

        Status and counters, that is: every other use belongs behind the block. A program that closed its
        board has stopped its channels, which cleared both; what is left is that of one that was killed.
        Raises NoFirmware, CommandHung, TransportError.
        """
        with self._lock:
            fresh = not self._is_ready
            if fresh:
                self.pause(POWER_UP_SECONDS)
                self._identify()
                self._is_ready = True
            try:
                yield
            finally:
                self._is_ready = not fresh

    @property
    def revision(self) -> str:
        """Of the SSLBP firmware, such as "1.43"; "" before the first use."""
        return self._core.revision

    @property
    def clock_hz(self) -> int:
        """The port's processor clock; 0 before the first use."""
        return self._core.clock_hz

    def counters(self) -> tuple[ChannelCounters, ...]:
        """The firmware's error counters of all channels, read now. Possible while channels run.

        Raises NoFirmware for SSLBP before 1.34, which does not tell where they are.
        """
        with self._lock:
            self._ready()
            return self._core.counters()

    def channel_counters(self, channel: int) -> ChannelCounters:
        """Of one channel: ten bytes, each an exchange or two with the firmware. Errors as `counters`."""
        with self._lock:
            self._ready()
            return self._core.channel_counters(channel)

    def process_data_sizes(self, channel: int) -> tuple[int, int]:
        """Bytes received (with the fault byte) and sent in an exchange, as the last start found out."""
        with self._lock:
            self._ready()
            return self._core.sizes(channel)

    @property
    def started(self) -> int:
        """Mask of the channels that were started and not stopped since."""
        return self._core.started

    @property
    def mode(self) -> str:
        """stopped, normal or setup."""
        return self._core.mode

    def read_local(self, address: int, size: int = 1) -> int:
        """A variable of the firmware, little endian; address 0..0xFFF, size 1..8 bytes."""
        _check_size(size)
        with self._lock:
            self._ready()
            return int.from_bytes(self._core.read_local(address, size), "little")

    def write_local(self, address: int, value: int, size: int = 1) -> None:
        """Write a variable of the firmware, unchecked: a wrong one can hang the port until reset()."""
        _check_size(size)
        if not 0 <= value < 1 << 8 * size:
            raise ValueError(f"{value} does not fit into {size} bytes")
        with self._lock:
            self._ready()
            self._core.write_local(address, value.to_bytes(size, "little"))

    def read_remote(self, channel: int, address: int, size: int, space: int = 0) -> int:
        """See Channel.read_remote."""
        with self._lock:
            for _ in range(STABLE_READS - 1):
                self._enter_setup(channel)
                with suppress(StaleRequest):
                    return self._read_stable(channel, address, size, space)
            self._enter_setup(channel)
            return self._read_stable(channel, address, size, space)

    def _read_stable(self, channel: int, address: int, size: int, space: int) -> int:
        """One damaged answer in 256 passes the CRC: on a line that shows errors two reads must agree."""
        before = self._core.read_remote(channel, address, size, space)
        for _ in range(STABLE_READS - 1):
            if not self._core.line_errors(channel):
                return before
            now = self._core.read_remote(channel, address, size, space)
            if now == before:
                return now
            before = now
        raise RemoteSilent(
            f"{self.label} channel {channel}: no two of {STABLE_READS} reads of address 0x{address:04X} "
            "agree, and the line shows errors",
            index=channel,
            address=address,
        )

    def write_remote(self, channel: int, address: int, value: int, size: int, space: int = 0) -> None:
        """See Channel.write_remote."""
        with self._lock:
            self._enter_setup(channel)
            self._remotes.note_write(channel)
            self._core.write_remote(channel, address, value, size, space)

    def access_remote(self, channel: int, command: int, address: int = 0, value: int = 0) -> int:
        """One LBP command (0x40..0x7F data, 0xC0..0xFF local) passed through in setup mode, once.

        Raises PortRunning, NoRemote, RemoteSilent, ValueError. StaleRequest: an old request came now, or
        since the last one, so that the remote's pointer and memory space may be others.
        """
        with self._lock:
            disturbed = self.started >> channel & 1 and self._core.disturbed(channel)
            self._enter_setup(channel)
            if disturbed:
                raise stale(self._core.number, f"channel {channel} was in setup mode")
            self._remotes.note_write(channel)
            return self._core.access(channel, command, address, value)

    def restart_setup(self, channel: int) -> None:
        """Stop all channels and start this one in setup mode, its counters and errors cleared.

        Raises PortRunning while channels move process data, NoRemote.
        """
        with self._lock:
            self._ready()
            self._refuse_while_running()
            self._core.stop()
            self._enter_setup(channel)

    def channel_variable(self, channel: int, register: Register, value: int | None = None) -> int:
        """A variable of a channel's block in the firmware; with `value` it is written first."""
        size = register.width // 8
        with self._lock:
            self._ready()
            address = self._core.block(channel) + register.number
            if value is not None:
                self._refuse_while_started()
                self._core.write_local(address, value.to_bytes(size, "little"))
                self._core.stop()  # which takes a baud rate over
            return int.from_bytes(self._core.read_local(address, size), "little")

    def _refuse_while_started(self) -> None:
        if self.started:
            raise PortRunning(f"{self.label}: channels {self.started:#04x} are started")

    def _enter_setup(self, channel: int) -> None:
        self._refuse_while_running()
        if self._core.started and self._core.disturbed(channel):
            self._core.stop()
        if self.mode != "setup" or not self.started >> channel & 1:
            self.start(1 << channel, "setup").raise_for_failed()

    def _refuse_while_running(self) -> None:
        if self.mode == "normal":
            raise PortRunning(f"{self.label}: channels {self.started:#04x} move process data")


def _check_size(size: int) -> None:
    if not 1 <= size <= 8:
        raise ValueError(f"size {size} is outside 1..8")
