"""The C port (csrc/sserial*.c) as Python calls: statuses become exceptions, structures become facts.

Not thread-safe: `SserialPort` holds the board's lock around every call.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.cycle import Cycle, Order
from hostmot2.errors import StaleRequest, check, new_error
from hostmot2.handles import own, words_at
from hostmot2.layout import Layout
from hostmot2.process_data import ProcessData, Words
from hostmot2.registers import SslbpChannel, SslbpLocal
from hostmot2.sserial.counters import ChannelCounters, read_counters
from hostmot2.sserial.errors import NoFirmware, raise_for
from hostmot2.sserial.evidence import Identity
from hostmot2.sserial.masks import numbers
from hostmot2.sserial.status import ChannelStatus, Fault

CHANNELS: int = lib.HM2_SSERIAL_CHANNELS
"""Of one port, at most."""

NORMAL: int = lib.HM2_SSERIAL_NORMAL
SETUP: int = lib.HM2_SSERIAL_SETUP

INTERFACE_TYPE = 0x12
"""What SSLBP says it is."""

LAST_LOCAL_ADDRESS = 0xFFF

TRIES = 4

_MODES = {lib.HM2_SSERIAL_NORMAL: "normal", lib.HM2_SSERIAL_SETUP: "setup"}
_WORDS_PER_CHANNEL = lib.HM2_SSERIAL_DATA_REGISTERS


class Core:
    """One SSERIAL instance on a `struct hm2_board`."""

    def __init__(
        self,
        board: Any,
        number: int,
        *,
        base: int,
        strides: tuple[int, int],
        instance: int,
        channels: int,
        registers: int,
    ) -> None:
        self._board = board
        self.number = number
        self.channels = min(channels, CHANNELS)
        self.registers = registers
        self.error = new_error()
        self._requested = ffi.new("uint32_t *")
        self.revision = ""
        self.clock_hz = 0
        self._at_start: dict[int, int] = {}  # of channels: disturbances before it
        self._block = (0, 0)  # address of channel 0's variables, distance of channels
        config = ffi.new("hm2_sserial_config *", (base, *strides, instance, self.channels, registers))
        handle = ffi.new("struct hm2_sserial **")
        check(lib.hm2_sserial_open(board, config, handle, self.error), self.error)
        self.handle, self._kept = own(handle[0], lib.hm2_sserial_free)
        self._image = lib.hm2_sserial_get_image(self.handle)
        self._data: ProcessData | None = None

    def check(self, status: int) -> int:
        """The status itself, or the exception it stands for."""
        if status < 0:
            raise_for(status, self.error, self.number)
        return status

    @property
    def disturbances(self) -> int:
        """How often the card has carried out an old request once more (lbp16.md 2)."""
        return int(lib.hm2_board_disturbances(self._board))

    def disturbed(self, channel: int) -> bool:
        """Whether the card has carried out an old request since the channel was started.

        It may have been a stop, or a start in another mode: what such a channel answers is not the remote's.
        """
        return self.disturbances != self._at_start.get(channel)

    def _repeat(self, what: str, call: Callable[[], int]) -> None:
        """Do what can be done again without harm, until no old request came between. Raises StaleRequest."""
        for _ in range(TRIES):
            before = self.disturbances
            self.check(call())
            if self.disturbances == before:
                return
        raise stale(self.number, what)

    # -- state

    @property
    def started(self) -> int:
        """Mask of started channels."""
        return int(lib.hm2_sserial_started(self.handle))

    @property
    def mode(self) -> str:
        """stopped, normal or setup."""
        return _MODES.get(lib.hm2_sserial_mode(self.handle), "stopped")

    @property
    def existing(self) -> int:
        """Mask of the channels there are."""
        return (1 << self.channels) - 1

    # -- commands

    def reset(self) -> None:
        """Reset the processor and wait for its firmware."""
        self.check(lib.hm2_sserial_reset(self.handle, self.error))

    def identify(self) -> int:
        """Learn revision, clock and where channels' variables are; returns the firmware's channel count."""
        facts = self.read_local(0, 8)
        if facts[SslbpLocal.interface_type.number] != INTERFACE_TYPE:
            raise NoFirmware(
                f"smart serial port {self.number}: interface type 0x{facts[0]:02X} is not SSLBP's",
                expected=INTERFACE_TYPE,
                received=facts[0],
            )
        minor = facts[SslbpLocal.minor_revision.number]
        self.revision = f"{facts[SslbpLocal.major_revision.number]}.{minor:02d}"
        self._block = facts[SslbpLocal.channel_start.number], facts[SslbpLocal.channel_stride.number]
        self.clock_hz = int.from_bytes(self.read_local(SslbpLocal.clock_hz.number, 4), "little")
        return facts[SslbpLocal.channels.number]

    def start(self, mask: int, mode: int, software_modes: Mapping[int, int]) -> int:
        """Start channels; returns the mask of those that did not start."""
        for channel, software_mode in software_modes.items():
            lib.hm2_sserial_set_software_mode(self.handle, channel, software_mode)
        self._at_start |= dict.fromkeys(numbers(mask & ~self.started), self.disturbances)
        return self.check(lib.hm2_sserial_start(self.handle, mask, mode, self.error))

    def stop(self, mask: int = 0) -> None:
        """Stop channels; 0: STOP ALL. Again if an old request came between: over a DOIT it stops nobody."""
        what = f"channels {mask or self.existing:#04x} were stopped"
        self._repeat(what, lambda: lib.hm2_sserial_stop(self.handle, mask, self.error))

    def cycle(self, mask: int) -> tuple[int, int]:
        """One step of the pipeline: failed channels (and HM2_SSERIAL_NEWS), and whom that speaks of."""
        status = self.check(lib.hm2_sserial_cycle(self.handle, mask, self._requested, self.error))
        return status, int(self._requested[0])

    def join(self, cycle: Cycle, after: Callable[[], None]) -> None:
        """Make the port a part of the board's cycle; `after` is called behind each exchange."""
        part = ffi.new("hm2_cyclic *")
        lib.hm2_sserial_part(self.handle, part)
        cycle.add(part, (part, self), Order.SSERIAL)
        cycle.after(after)

    def set_cyclic(self, mask: int) -> None:
        """The channels that the board's cycle moves."""
        lib.hm2_sserial_set_cyclic(self.handle, mask)

    def cyclic_result(self) -> tuple[int, int]:
        """What the cycle's last exchange brought; as `cycle`."""
        status = self.check(lib.hm2_sserial_cyclic_result(self.handle, self._requested, self.error))
        return status, int(self._requested[0])

    # -- local variables

    def read_local(self, address: int, count: int) -> bytes:
        """Bytes of the firmware's memory."""
        _check_local(address, count)
        data = ffi.new("uint8_t[]", count)
        what = f"local address {address:#05x} was read"
        self._repeat(what, lambda: lib.hm2_sserial_read_local(self.handle, address, data, count, self.error))
        return bytes(data)

    def write_local(self, address: int, data: bytes) -> None:
        """Write bytes into the firmware's memory."""
        _check_local(address, len(data))
        what = f"local address {address:#05x} was written"
        self._repeat(
            what, lambda: lib.hm2_sserial_write_local(self.handle, address, data, len(data), self.error)
        )

    def block(self, channel: int) -> int:
        """Address of a channel's variables. Raises NoFirmware for SSLBP before 1.34, which does not tell."""
        start, stride = self._block
        if not stride:
            raise NoFirmware(
                f"smart serial port {self.number}: SSLBP {self.revision} does not tell where channels are"
            )
        return start + channel * stride

    @property
    def tells_blocks(self) -> bool:
        """Whether channels' variables can be found."""
        return bool(self._block[1])

    def counters(self) -> tuple[ChannelCounters, ...]:
        """The firmware's counters of all channels."""
        return tuple(self.channel_counters(n) for n in range(self.channels))

    def channel_counters(self, channel: int) -> ChannelCounters:
        """The firmware's counters of one channel."""
        return read_counters(self.read_local, channel, self.block(channel))

    def line_errors(self, channel: int) -> int:
        """Errors on the channel's line since its last stop, as in CS; 0 where the firmware does not tell."""
        if not self.tells_blocks:
            return 0
        return self.read_local(self.block(channel) + SslbpChannel.error_log.number, 1)[0]

    def sizes(self, channel: int) -> tuple[int, int]:
        """Bytes received (with the fault byte) and sent in a process data exchange; (0, 0): not known."""
        if not self.tells_blocks:
            return 0, 0
        receive, transmit = self.read_local(self.block(channel) + SslbpChannel.receive_size.number, 2)
        return receive, transmit

    # -- remotes in setup mode

    def read_remote(self, channel: int, address: int, size: int, space: int = 0) -> int:
        """A value of a remote's memory. Raises StaleRequest if the channel is disturbed."""
        _check_access(address, size)
        value = ffi.new("uint64_t *")
        what = f"address {address:#06x} of channel {channel} was read"
        self._access(what, channel, lib.hm2_sserial_read_remote, space, address, size, value)
        return int(value[0])

    def write_remote(self, channel: int, address: int, value: int, size: int, space: int = 0) -> None:
        """Write a value of a remote's memory; negative ones as two's complement."""
        _check_access(address, size)
        if not -(1 << 8 * size - 1) <= value < 1 << 8 * size:
            raise ValueError(f"{value} does not fit into {size} bytes")
        raw = value & (1 << 8 * size) - 1
        what = f"address {address:#06x} of channel {channel} was written"
        self._access(what, channel, lib.hm2_sserial_write_remote, space, address, size, raw)

    def access(self, channel: int, command: int, address: int, value: int) -> int:
        """One LBP command as it is, once: the value it reads."""
        held = ffi.new("uint64_t *", value)
        what = f"command {command:#04x} was sent to channel {channel}"
        self._access(what, channel, lib.hm2_sserial_access, command, address, held)
        return int(held[0])

    def read_table(self, channel: int, pointer: int, table: int, *rest: Any) -> int:
        """`discovery.ReadTable` of a channel."""
        return int(lib.hm2_sserial_read_toc(self.handle, channel, pointer, table, *rest))

    def _access(self, what: str, channel: int, function: Any, *arguments: Any) -> None:
        started = self.started
        status = function(self.handle, channel, *arguments, self.error)
        if self.disturbed(channel) and self.started == started:
            raise stale(self.number, what)
        self.check(status)  # a command that hung has stopped all channels, which says more

    # -- what is known of channels

    def identity(self, channel: int) -> Identity:
        """What the remote answered at the channel's last start."""
        facts: Any = ffi.new("hm2_sserial_identity *")
        lib.hm2_sserial_get_identity(self.handle, channel, facts)
        name = facts.name.to_bytes(4, "little").rstrip(b"\0 ").decode("ascii", "replace")
        return Identity(facts.unit_number, name, facts.toc, ChannelStatus(facts.cs))

    def set_bits(self, channel: int, layout: Layout | None, fault_word: tuple[int, int] | None) -> None:
        """What process data a channel moves; None: not known, all registers."""
        every = 32 * self.registers
        bits = (every, every) if layout is None else (layout.input_bits, layout.output_bits)
        self.check(lib.hm2_sserial_set_bits(self.handle, channel, *bits, self.error))
        lib.hm2_sserial_watch(self.handle, channel, *(fault_word or (0, 0)))

    def set_process_data(self, layouts: Mapping[int, Layout]) -> ProcessData:
        """Process data in the port's own registers, packed and unpacked by each transfer."""
        self._data = ProcessData(
            layouts, input_image=self._words("inputs"), output_image=self._words("outputs")
        )
        lib.hm2_sserial_set_process_data(self.handle, self._data.plan)
        return self._data

    def _words(self, member: str) -> Words:
        """A member of the image as [channel, register]."""
        address = ffi.cast("uint8_t *", self._image) + ffi.offsetof("hm2_sserial_image", member)
        return words_at(address, (CHANNELS, _WORDS_PER_CHANNEL), self._kept)[:, : self.registers]

    def take_faults(self) -> tuple[list[Fault], int]:
        """New faults, oldest first, and how many were lost because nobody took them."""
        events, lost = ffi.new("hm2_sserial_event[]", lib.HM2_SSERIAL_EVENTS), ffi.new("uint64_t *")
        count = lib.hm2_sserial_take_events(self.handle, events, lib.HM2_SSERIAL_EVENTS, lost)
        faults = [
            Fault(
                channel=event.channel,
                transfer=event.transfer,
                time_ns=event.time_ns,
                status=ChannelStatus(event.cs),
                failed=bool(event.failed),
                rising=event.rising,
                word=event.word,
                word_rising=event.word_rising,
            )
            for event in events[0:count]
        ]
        return faults, int(lost[0])

    def transfers(self) -> dict[str, Any]:
        """What the driver counted."""
        counters: Any = ffi.new("hm2_sserial_counters *")
        lib.hm2_sserial_get_counters(self.handle, counters)
        return {
            "doits": counters.doits,
            "failed": list(counters.failed)[: self.channels],
            "too_soon": counters.too_soon,
            "hung": counters.hung,
            "overwritten": counters.overwritten,
            "hidden": counters.hidden,
            "last_doit_us": counters.last_doit_ns / 1000,
        }


def stale(port: int, what: str) -> StaleRequest:
    """What to say of an access that an old request has disturbed. `what`: "address 0x10 was read"."""
    return StaleRequest(
        f"smart serial port {port}: while {what} the card carried out an old request once more, so that "
        "nobody can say what came of it"
    )


def _check_local(address: int, count: int) -> None:
    if not 0 <= address <= LAST_LOCAL_ADDRESS + 1 - count or not 1 <= count <= 256:
        raise ValueError(f"{count} bytes at local address {address:#x} are outside 0..0xFFF")


def _check_access(address: int, size: int) -> None:
    if size not in (1, 2, 4, 8):
        raise ValueError(f"size {size} is not 1, 2, 4 or 8")
    if not 0 <= address <= 0x10000 - size:
        raise ValueError(f"address {address:#x} is outside the remote's 64 KiB")
