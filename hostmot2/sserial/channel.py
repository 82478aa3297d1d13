"""One channel of a smart-serial port and the remote at its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hostmot2.elements import Inputs, Outputs
from hostmot2.layout import table
from hostmot2.registers import SslbpChannel
from hostmot2.remotes.discovery import Mode, RemoteDescription
from hostmot2.remotes.parameters import Parameters
from hostmot2.sserial.counters import ChannelCounters
from hostmot2.sserial.errors import NotDiscovered
from hostmot2.sserial.status import ChannelStatus

if TYPE_CHECKING:
    from hostmot2.sserial.port import SserialPort

MAX_BAUD = 10_000_000
"""The fastest that remotes know (index 11)."""


class Channel:
    """A channel by number. Made by its port, valid as long as the board is open."""

    def __init__(self, port: SserialPort, number: int) -> None:
        self._port = port
        self.number = number
        self.description: RemoteDescription | None = None
        """What the remote says of itself; None until it has been discovered."""
        self.problem: Exception | None = None
        """Why there is no description although something answered."""
        self._mode = 0

    @property
    def started(self) -> bool:
        """Whether the channel moves process data or is in setup mode."""
        return bool(self._port.started >> self.number & 1)

    @property
    def name(self) -> str:
        """The remote's name, such as "7I77"; "" if none has answered."""
        return self._port.identity(self.number).name

    @property
    def unit_number(self) -> int:
        """The remote's unit number, 0 if none has answered. Its top byte is a device code on many remotes."""
        return self._port.identity(self.number).unit_number

    @property
    def status(self) -> ChannelStatus:
        """The CS register, read now."""
        return self._port.read_status(self.number)

    @property
    def counters(self) -> ChannelCounters:
        """The firmware's error counters, read now."""
        return self._port.channel_counters(self.number)

    @property
    def mode(self) -> int:
        """The remote's software mode, 0..255; takes effect at the next start.

        A mode the remote does not have makes the normal start fail with the remote fault "illegal mode".
        """
        return self._mode

    @mode.setter
    def mode(self, mode: int) -> None:
        if not 0 <= mode <= 0xFF:
            raise ValueError(f"software mode {mode} is outside 0..255")
        self._mode = mode

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The software modes that the remote names."""
        return self._described().modes

    @property
    def baud_rate(self) -> int:
        """Bits per second on the line, 2500000 unless changed; until the next reset() of the port.

        At 115200 only setup mode works. Set: PortRunning while a channel of the port is started.
        """
        return self._port.channel_variable(self.number, SslbpChannel.baud_rate)

    @baud_rate.setter
    def baud_rate(self, baud: int) -> None:
        if not 1 <= baud <= MAX_BAUD:
            raise ValueError(f"baud rate {baud} is outside 1..{MAX_BAUD}")
        self._port.channel_variable(self.number, SslbpChannel.baud_rate, baud)

    @property
    def crc(self) -> bool:
        """Whether frames carry a checksum, True unless changed; stopping does not restore it.

        For remotes whose own checksum was switched off. Set: PortRunning as for `baud_rate`.
        """
        return not self._port.channel_variable(self.number, SslbpChannel.disable_crc)

    @crc.setter
    def crc(self, on: bool) -> None:
        self._port.channel_variable(self.number, SslbpChannel.disable_crc, 0 if on else 0xFF)

    def discover(self) -> RemoteDescription:
        """Read the remote's tables anew.

        Raises PortRunning while channels move process data, NoRemote if nothing answers, BrokenTable (also
        for the parameters' table) and UnsupportedRemote. Afterwards the channel is stopped.
        """
        description = self._port.discover(self.number)
        description.raise_for_parameters()
        return description

    @property
    def inputs(self) -> Inputs:
        """What the remote reports, by element name in engineering units; as of the last good transfer.

        0 after a start until the first one. Take it anew behind a start() or scan() that found another remote
        or mode on the port: elements of before raise NotDiscovered then.

        Raises NoRemote, BrokenTable, NotDiscovered when the elements are not known.
        """
        self._described()
        return self._port.process_data.inputs[self.number]

    @property
    def outputs(self) -> Outputs:
        """What is commanded to the remote, by element name; the next doit() sends it. Errors as `inputs`."""
        self._described()
        return self._port.process_data.outputs[self.number]

    @property
    def parameters(self) -> Parameters:
        """The remote's parameters by name. Errors as `inputs`; BrokenTable if their table is broken."""
        description = self._described()
        description.raise_for_parameters()
        return Parameters(self, description.parameters, description.aliases)

    def read_remote(self, address: int, size: int = 1, *, space: int = 0) -> int:
        """A value from the remote's memory; size 1, 2, 4 or 8 bytes, space 0 RAM, 1 EEPROM.

        Starts the channel in setup mode if the port is stopped. Raises PortRunning while channels move
        process data, NoRemote, RemoteSilent (after repeated tries), ValueError for the arguments.
        """
        return self._port.read_remote(self.number, address, size, space)

    def write_remote(self, address: int, value: int, size: int = 1, *, space: int = 0) -> None:
        """Write a value of `size` bytes to the remote's memory. Errors as `read_remote`."""
        self._port.write_remote(self.number, address, value, size, space)

    def _described(self) -> RemoteDescription:
        self._port.look_if_stopped(self.number)
        if self.description is not None:
            return self.description
        if self.problem is not None:
            raise self.problem
        if self.started:
            raise NotDiscovered(f"{self.label}: started while others ran", index=self.number)
        raise self._port.no_remote(self.number)

    def rows(self) -> list[tuple[str, ...]]:
        """The channel and its elements as rows of a table."""
        identity = self._port.identity(self.number)
        status = self.status
        state = ", ".join((status.state, *(status.live if self.started else ())))
        unit = f"{identity.unit_number:08X}" if identity.name else "-"
        head = (str(self.number), identity.name or "-", unit, state)
        if self.description is None:
            return [(*head, str(self.problem or ""), "", "")]
        rows: list[tuple[str, ...]] = []
        data = self._port.process_data
        for arrow, elements in (("in", data.inputs[self.number]), ("out", data.outputs[self.number])):
            for name in elements:
                field = elements.field(name)
                value = elements[name]
                text = f"{value:g}" if isinstance(value, float) else str(value)
                rows.append(("", "", "", "", f"{arrow} {name}", text, field.unit))
        if not rows:
            return [(*head, "no elements", "", "")]
        return [(*head, *rows[0][4:]), *rows[1:]]

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"{self._port.label} channel {self.number}"

    def __repr__(self) -> str:
        return table([HEADER, *self.rows()])


HEADER = ("channel", "name", "unit", "state", "element", "value", "unit of value")
