"""A smart-serial port: one SSERIAL instance with up to eight channels, a remote on each.

Source: sserial.md and both SSLBP observed sheets; the protocol itself is in csrc/sserial*.c.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hostmot2._core import ffi, lib
from hostmot2.board import SafeOff
from hostmot2.errors import check, new_error
from hostmot2.idrom import ModuleDescriptor, PinDescriptor
from hostmot2.layout import table
from hostmot2.process_data import ProcessData
from hostmot2.registers import Gtag, Sserial, SslbpChannel, SslbpLocal
from hostmot2.sserial import builtin
from hostmot2.sserial.channel import HEADER, Channel
from hostmot2.sserial.counters import ChannelCounters, read_counters
from hostmot2.sserial.discovery import ReadFailed, RemoteDescription, read_tables
from hostmot2.sserial.errors import (
    BrokenTable,
    NoFirmware,
    NotStarted,
    PortRunning,
    RemoteSilent,
    UnsupportedRemote,
    raise_for,
)
from hostmot2.sserial.evidence import ChannelEvidence, DoitResult, Identity, Scan, StartResult
from hostmot2.sserial.status import ChannelStatus, Fault

if TYPE_CHECKING:
    from hostmot2.board import Board

Mode = Literal["normal", "setup"]

INTERFACE_TYPE = 0x12
"""What SSLBP says it is."""

FAULTS_KEPT = 1000


class SserialPort:
    """One port. Nothing is sent and no output is on before start().

    The first use resets the port's processor, which stops what another program left running. Closing the
    board zeroes the outputs and stops all channels. After a fault or a watchdog bite nothing starts again
    by itself: start() does it.

    Thread-safety: every operation holds the board's lock. The elements of `channels` may be read and
    assigned by other threads at any time.
    """

    def __init__(self, board: Board, module: ModuleDescriptor, instance: int, number: int) -> None:
        self._board = board
        self._module = module
        self._instance = instance
        self.number = number
        """Position among the board's ports."""
        self.pins: tuple[PinDescriptor, ...] = tuple(
            pin
            for pin in board.pins
            if pin.secondary_gtag == module.gtag and pin.secondary_unit == instance and pin.secondary_pin
        )
        """The FPGA pins of this port."""
        self.revision = ""
        """Of the SSLBP firmware, such as "1.43"; known from the first use on."""
        self.clock_hz = 0
        """The port's processor clock; known from the first use on."""
        self.faults: deque[Fault] = deque(maxlen=FAULTS_KEPT)
        """New faults as they appeared, the latest last."""
        self.faults_lost = 0
        """Faults that came faster than they were taken."""
        self._registers = 7 if module.gtag == Gtag.SSERIAL_B else 3
        self._error = new_error()
        self._lock = board.lock
        self._is_ready = False
        self._looked = 0  # channels that have been looked at in setup mode
        self._block = (0, 0)  # address of channel 0's block, distance of blocks
        self._results: dict[int, DoitResult] = {}
        self._data: ProcessData | None = None
        self._open(max((pin.secondary_pin & 0x0F for pin in self.pins), default=1))
        board.on_close(self._close, SafeOff.SSERIAL)
        board.on_restore(self._restore)

    # -- life

    def _open(self, channels: int) -> None:
        config: Any = ffi.new(
            "hm2_sserial_config *",
            {
                "base": self._module.base,
                "register_stride": self._module.register_stride,
                "instance_stride": self._module.instance_stride,
                "instance": self._instance,
                "channels": min(channels, lib.HM2_SSERIAL_CHANNELS),
                "data_registers": self._registers,
            },
        )
        handle = ffi.new("struct hm2_sserial **")
        check(lib.hm2_sserial_open(self._board.handle, config, handle, self._error), self._error)
        self._handle = ffi.gc(handle[0], lib.hm2_sserial_free)
        self._image = lib.hm2_sserial_get_image(self._handle)
        self._channels = tuple(Channel(self, n) for n in range(config.channels))
        self._doit = partial(lib.hm2_sserial_doit, self._handle)
        self._data = None
        self._describe_all()

    def _ready(self) -> None:
        """Reset the processor and learn what it is, once."""
        if self._is_ready:
            return
        self._check(lib.hm2_sserial_reset(self._handle, self._error))
        facts = self._read_bytes(0, 8)
        if facts[SslbpLocal.interface_type.number] != INTERFACE_TYPE:
            raise NoFirmware(
                f"{self}: interface type 0x{facts[0]:02X} is not SSLBP's",
                expected=INTERFACE_TYPE,
                received=facts[0],
            )
        self.revision = (
            f"{facts[SslbpLocal.major_revision.number]}.{facts[SslbpLocal.minor_revision.number]:02d}"
        )
        self._block = facts[SslbpLocal.channel_start.number], facts[SslbpLocal.channel_stride.number]
        channels = facts[SslbpLocal.channels.number]
        if 1 <= channels <= lib.HM2_SSERIAL_CHANNELS and channels != len(self._channels):
            self._open(channels)  # the firmware knows better than the pins, which may be masked out
        self.clock_hz = int.from_bytes(self._read_bytes(SslbpLocal.clock_hz.number, 4), "little")
        self._check(lib.hm2_sserial_stop(self._handle, 0, self._error))
        self._is_ready = True

    def _close(self) -> None:
        if self._is_ready:
            self.stop()

    def _restore(self) -> None:
        """After a watchdog bite the pins come back to this port: nothing may go on where it was cut."""
        if self._is_ready:
            self.stop()

    def _check(self, status: int) -> int:
        if status < 0:
            raise_for(status, self._error, self.number)
        return status

    # -- the product's heart

    def start(self, mask: int, mode: Mode = "normal") -> StartResult:
        """Start the channels in `mask` (bit n: channel n), their outputs zero until you set them.

        normal: process data. Switches the port's pins to it, and reads the tables of remotes that are not
        known yet (once; 2 ms where a remote is, 55 ms where none answers). Channels that run already go on
        undisturbed, unless they are at fault: those are stopped and started anew.
        setup: access to the remotes' memory, for `read_remote` and `parameters`.

        A channel that does not start does not keep others from it: see the result's `failed` and its text
        for why, or `raise_for_failed()`.

        Raises PortRunning for setup while channels run, CommandHung if the firmware had to be stopped,
        ValueError for a mask outside 0..0xFF, TransportError.
        """
        _check_mask(mask)
        if mode not in ("normal", "setup"):
            raise ValueError(f"mode is 'normal' or 'setup', not {mode!r}")
        with self._lock:
            self._ready()
            if self.pins:
                self._board.ioport.claim(self.pins, "sserial")
            failed = self._start_setup(mask) if mode == "setup" else self._start_normal(mask)
            return self._result(mask, failed)

    def stop(self, mask: int | None = None) -> None:
        """Zero the outputs of the channels in `mask`, send that, and stop them. None: STOP ALL.

        Clears their faults and counters. Raises CommandHung, TransportError.
        """
        everything = mask is None
        stopped = 0xFF if mask is None else mask
        _check_mask(stopped)
        if not stopped:
            return
        with self._lock:
            self._ready()
            self._zero(stopped)
            self._check(lib.hm2_sserial_stop(self._handle, 0 if everything else stopped, self._error))

    def doit(self, mask: int | None = None) -> DoitResult:
        """Send the outputs of the channels in `mask` (None: all started), and take their inputs in.

        One exchange with the remotes, 45 to 130 us. A channel in `failed` has kept its old inputs; `faults`
        are the new ones. Must be repeated every 50 ms (remotes' watchdog; 8I20: 40 ms), else the remotes'
        outputs go off until stop() and start().

        Raises NotStarted if nothing was started, CommandHung, TransportError, ValueError for the mask.
        """
        with self._lock:
            if mask is None:
                mask = self._started_or_raise()
            elif mask & ~0xFF:
                _check_mask(mask)
            failed = self._doit(mask, self._error)
            if failed < 0:
                self._check(failed)
            if self._image.events:
                return DoitResult(failed, mask, self._take_faults())
        key = mask << 8 | failed
        result = self._results.get(key)
        if result is None:
            result = self._results[key] = DoitResult(failed, mask)
        return result

    def doit_pipelined(self, mask: int | None = None) -> DoitResult:
        """One step of a pipeline: take in what the last step's DOIT brought, send the outputs, do not wait.

        `requested` names the channels the result speaks of; it is 0 in the first step. For fixed cycles of
        at least 0.2 ms. Errors as `doit`, and SserialError if the last DOIT is still at work: then nothing
        was sent.
        """
        with self._lock:
            if mask is None:
                mask = self._started_or_raise()
            _check_mask(mask)
            requested = ffi.new("uint32_t *")
            failed = self._check(lib.hm2_sserial_cycle(self._handle, mask, requested, self._error))
            return DoitResult(failed, requested[0], self._take_faults())

    def reset(self) -> None:
        """Reset the port's processor: all channels stopped, default baud rates. Remotes are not told."""
        with self._lock:
            self._ready()
            self._zero(0xFF)
            self._check(lib.hm2_sserial_reset(self._handle, self._error))

    # -- what is on it

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels by number."""
        if not self._is_ready and not self._board.read_only:
            with self._lock:
                self._ready()
        return self._channels

    @property
    def started(self) -> int:
        """Mask of the channels that were started and not stopped since."""
        return int(lib.hm2_sserial_started(self._handle))

    @property
    def mode(self) -> str:
        """stopped, normal or setup."""
        names = {lib.HM2_SSERIAL_NORMAL: "normal", lib.HM2_SSERIAL_SETUP: "setup"}
        return names.get(lib.hm2_sserial_mode(self._handle), "stopped")

    def scan(self) -> Scan:
        """Look at every channel: who answers, what it is, and why a channel cannot be used.

        Reads all tables anew. Afterwards everything is stopped. Raises PortRunning while channels move
        process data.
        """
        with self._lock:
            self._ready()
            self._refuse_while_running()
            self._check(lib.hm2_sserial_stop(self._handle, 0, self._error))
            if self.pins:
                self._board.ioport.claim(self.pins, "sserial")
            rows: list[ChannelEvidence] = []
            self._look(self._existing, rows)
            return Scan(rows)

    def discover(self, channel: int) -> RemoteDescription:
        """Read one remote's tables anew; see Channel.discover."""
        with self._lock:
            self._ready()
            self._refuse_while_running()
            self._check(lib.hm2_sserial_stop(self._handle, 0, self._error))
            if self.pins:
                self._board.ioport.claim(self.pins, "sserial")
            rows: list[ChannelEvidence] = []
            self._look(1 << channel, rows)
            known = self._channels[channel]
            if known.problem is not None:
                raise known.problem
            if known.description is None:
                self._raise_no_remote(rows)
            assert known.description is not None
            return known.description

    def counters(self) -> tuple[ChannelCounters, ...]:
        """The firmware's error counters of all channels, read now. Possible while channels run.

        Raises NoFirmware for SSLBP before 1.34, which does not tell where they are.
        """
        with self._lock:
            self._ready()
            start, stride = self._block
            if not stride:
                raise NoFirmware(f"{self}: SSLBP {self.revision} does not tell where its counters are")
            return tuple(
                read_counters(self._read_bytes, n, start + n * stride) for n in range(len(self._channels))
            )

    @property
    def transfers(self) -> dict[str, Any]:
        """What the driver counted: doits, failed (per channel), too_soon, hung, last_doit_us."""
        counters: Any = ffi.new("hm2_sserial_counters *")
        lib.hm2_sserial_get_counters(self._handle, counters)
        return {
            "doits": counters.doits,
            "failed": list(counters.failed)[: len(self._channels)],
            "too_soon": counters.too_soon,
            "hung": counters.hung,
            "last_doit_us": counters.last_doit_ns / 1000,
        }

    # -- local variables and remote memory

    def read_local(self, address: int, size: int = 1) -> int:
        """A variable of the firmware, little endian; address 0..0xFFF, size 1..8 bytes."""
        if not 1 <= size <= 8:
            raise ValueError(f"size {size} is outside 1..8")
        with self._lock:
            self._ready()
            return int.from_bytes(self._read_bytes(address, size), "little")

    def write_local(self, address: int, value: int, size: int = 1) -> None:
        """Write a variable of the firmware, unchecked: a wrong one can hang the port until reset()."""
        if not 1 <= size <= 8:
            raise ValueError(f"size {size} is outside 1..8")
        if not 0 <= value < 1 << 8 * size:
            raise ValueError(f"{value} does not fit into {size} bytes")
        if not 0 <= address <= 0xFFF:
            raise ValueError(f"address {address:#x} is outside 0..0xFFF")
        data = value.to_bytes(size, "little")
        with self._lock:
            self._ready()
            self._check(lib.hm2_sserial_write_local(self._handle, address, data, size, self._error))

    def _read_bytes(self, address: int, count: int) -> bytes:
        if not 0 <= address <= 0xFFF:
            raise ValueError(f"address {address:#x} is outside 0..0xFFF")
        data = ffi.new("uint8_t[]", count)
        self._check(lib.hm2_sserial_read_local(self._handle, address, data, count, self._error))
        return bytes(data)

    def read_remote(self, channel: int, address: int, size: int, space: int = 0) -> int:
        """See Channel.read_remote."""
        _check_access(address, size)
        value = ffi.new("uint64_t *")
        with self._lock:
            self._enter_setup(channel)
            status = lib.hm2_sserial_read_remote(
                self._handle, channel, space, address, size, value, self._error
            )
            self._check(status)
        return int(value[0])

    def write_remote(self, channel: int, address: int, value: int, size: int, space: int = 0) -> None:
        """See Channel.write_remote."""
        _check_access(address, size)
        if not -(1 << 8 * size - 1) <= value < 1 << 8 * size:
            raise ValueError(f"{value} does not fit into {size} bytes")
        with self._lock:
            self._enter_setup(channel)
            raw = value & (1 << 8 * size) - 1
            status = lib.hm2_sserial_write_remote(
                self._handle, channel, space, address, size, raw, self._error
            )
            self._check(status)

    def _enter_setup(self, channel: int) -> None:
        self._refuse_while_running()
        if self.mode == "setup" and self.started >> channel & 1:
            return
        result = self.start(1 << channel, "setup")
        if result.failed:
            self._raise_no_remote(result.channels)

    # -- what channels ask their port

    def identity(self, channel: int) -> Identity:
        """What the remote answered at the last start of the channel."""
        facts: Any = ffi.new("hm2_sserial_identity *")
        lib.hm2_sserial_get_identity(self._handle, channel, facts)
        name = facts.name.to_bytes(4, "little").rstrip(b"\0 ").decode("ascii", "replace")
        return Identity(facts.unit_number, name, facts.toc)

    def read_status(self, channel: int) -> ChannelStatus:
        """The channel's CS register, read now."""
        address = self._module.register_address(Sserial.cs.number, self._instance, channel)
        return ChannelStatus(self._board.read(address))

    def look_if_stopped(self, channel: int) -> None:
        """Look at the channels once, if that disturbs nothing, so that their elements are known."""
        with self._lock:
            if not self._looked >> channel & 1 and not self.started and not self._board.read_only:
                self.scan()

    @property
    def process_data(self) -> ProcessData:
        """The elements of all described channels."""
        assert self._data is not None
        return self._data

    # -- starting

    @property
    def _existing(self) -> int:
        return (1 << len(self._channels)) - 1

    def _started_or_raise(self) -> int:
        started = self.started
        if not started:
            raise NotStarted(f"{self}: no channel is started")
        return started

    def _refuse_while_running(self) -> None:
        if self.mode == "normal":
            raise PortRunning(f"{self}: channels {self.started:#04x} move process data")

    def _start_raw(self, mask: int, mode: int) -> int:
        for channel in self._channels:
            lib.hm2_sserial_set_software_mode(self._handle, channel.number, channel.mode)
        return self._check(lib.hm2_sserial_start(self._handle, mask, mode, self._error))

    def _start_setup(self, mask: int) -> int:
        self._refuse_while_running()
        return self._start_raw(mask, lib.HM2_SSERIAL_SETUP)

    def _start_normal(self, mask: int) -> int:
        if self.mode == "setup":
            self._check(lib.hm2_sserial_stop(self._handle, 0, self._error))
        self._stop_sick(mask)
        fresh = mask & self._existing & ~self.started
        if fresh and not self.started:
            self._look_before_start(fresh)
        unusable = self._mask(c for c in self._channels if c.problem is not None) & fresh
        self._zero(fresh)
        running = self.started
        failed = self._start_raw(mask & ~unusable, lib.HM2_SSERIAL_NORMAL) | unusable
        strangers = self._strangers(fresh & ~failed)
        if strangers and not running:
            self._check(lib.hm2_sserial_stop(self._handle, 0, self._error))
            self._look(strangers)
            unusable |= self._mask(c for c in self._channels if c.problem is not None) & fresh
            failed = self._start_raw(mask & ~unusable, lib.HM2_SSERIAL_NORMAL) | unusable
        for channel in self._channels:
            if fresh >> channel.number & 1 and channel.description is not None:
                self.process_data.restart(channel.number)
        return failed

    def _stop_sick(self, mask: int) -> None:
        """Stop running channels that are at fault: only a stop clears that, and start() was asked for."""
        sick = 0
        for channel in self._channels:
            if not (mask & self.started) >> channel.number & 1:
                continue
            status = self.read_status(channel.number)
            if status.remote_fault or status.status or status.local_fault or status.state == "dead":
                sick |= 1 << channel.number
        if sick:
            self.stop(sick)

    def _look_before_start(self, fresh: int) -> None:
        """Read the tables of remotes that are not known. All channels the first time: later ones may run."""
        unknown = self._existing & ~self._looked
        for channel in self._channels:
            known = channel.description
            answered = known is not None or channel.problem is not None
            if (
                fresh >> channel.number & 1
                and answered
                and (known is None or known.software_mode != channel.mode)
            ):
                unknown |= 1 << channel.number
        if unknown & fresh:
            self._look(unknown)

    def _strangers(self, started: int) -> int:
        """Started channels whose remote is not the one that was described; they lose their description."""
        strangers = 0
        for channel in self._channels:
            if not started >> channel.number & 1:
                continue
            found = self.identity(channel.number)
            now = found.unit_number, found.name, found.toc, channel.mode
            if channel.description is None or channel.description.identity != now:
                channel.description, channel.problem = None, None
                strangers |= 1 << channel.number
        if strangers:
            self._describe_all()
        return strangers

    def _result(self, mask: int, failed: int) -> StartResult:
        started = mask & self.started
        rows = self._evidence(mask, started) if failed else []
        return StartResult(started, failed, tuple(rows))

    def _evidence(self, mask: int, started: int) -> list[ChannelEvidence]:
        counters = self.counters() if self._block[1] else ()
        facts: Any = ffi.new("hm2_sserial_identity *")
        rows = []
        for number in range(8):
            if not mask >> number & 1:
                continue
            exists = number < len(self._channels)
            channel = self._channels[number] if exists else None
            lib.hm2_sserial_get_identity(self._handle, number, facts)
            known = channel.description if channel else None
            rows.append(
                ChannelEvidence(
                    channel=number,
                    exists=exists,
                    started=bool(started >> number & 1),
                    identity=self.identity(number),
                    status=ChannelStatus(facts.cs),
                    counters=counters[number] if number < len(counters) else None,
                    problem=channel.problem if channel else None,
                    elements=len(known.fields) if known else 0,
                    parameters=len(known.parameters) if known else 0,
                )
            )
        return rows

    def _raise_no_remote(self, rows: Iterable[ChannelEvidence]) -> None:
        failed = tuple(row for row in rows if not row.started)
        StartResult(0, self._mask_of(row.channel for row in failed), failed).raise_for_failed()

    # -- discovery

    def _look(self, mask: int, rows: list[ChannelEvidence] | None = None) -> None:
        """Start the channels in setup mode, describe their remotes, stop everything."""
        failed = self._start_raw(mask, lib.HM2_SSERIAL_SETUP)
        try:
            for channel in self._channels:
                if not mask >> channel.number & 1:
                    continue
                channel.description, channel.problem = None, None
                if not failed >> channel.number & 1:
                    self._describe(channel)
            self._looked |= mask
            if rows is not None:
                rows += self._evidence(mask, mask & ~failed)
        finally:
            self._check(lib.hm2_sserial_stop(self._handle, 0, self._error))
        self._describe_all()

    def _describe(self, channel: Channel) -> None:
        """One remote's trouble is kept with its channel and leaves the others alone."""
        try:
            channel.description = self._read_description(channel)
        except (BrokenTable, RemoteSilent, UnsupportedRemote) as problem:
            channel.problem = problem

    def _read_description(self, channel: Channel) -> RemoteDescription:
        found = self.identity(channel.number)
        if found.name == "8I20":
            max_current = self.read_remote(channel.number, builtin.MAX_CURRENT_8I20, 2) * 0.01
            return builtin.describe_8i20(found.unit_number, max_current, channel.mode)
        if found.name == "7I64":
            return builtin.describe_7i64(found.unit_number, channel.mode)
        if not found.toc & 0xFFFF:
            raise UnsupportedRemote(
                f"{channel}: {found.name!r} has no table of its process data and is not known by its name",
                index=channel.number,
            )
        return self._read_tables(channel, found)

    def _read_tables(self, channel: Channel, found: Identity) -> RemoteDescription:
        def read_table(pointer: int, table: int, *rest: Any) -> int:
            return int(lib.hm2_sserial_read_toc(self._handle, channel.number, pointer, table, *rest))

        try:
            return read_tables(
                read_table,
                channel.number,
                found.toc,
                name=found.name,
                unit_number=found.unit_number,
                software_mode=channel.mode,
                registers=self._registers,
                sizes=self._sizes(channel.number),
            )
        except ReadFailed as failure:
            raise_for(failure.status, failure.error, self.number)

    def _sizes(self, channel: int) -> tuple[int, int]:
        start, stride = self._block
        if not stride:
            return 0, 0
        receive, transmit = self._read_bytes(start + channel * stride + SslbpChannel.receive_size.number, 2)
        return receive, transmit

    def _describe_all(self) -> None:
        """Process data of all described channels, in the port's own registers."""
        layouts = {c.number: c.description.layout for c in self._channels if c.description is not None}
        if self._data is not None and _same(self._data.layouts, layouts):
            return
        words = np.frombuffer(memoryview(ffi.buffer(self._image)), np.uint32)
        inputs, outputs = (
            words[offset // 4 :][:56].reshape(8, 7)[:, : self._registers]
            for offset in (
                ffi.offsetof("hm2_sserial_image", "inputs"),
                ffi.offsetof("hm2_sserial_image", "outputs"),
            )
        )
        self._data = ProcessData(layouts, input_image=inputs, output_image=outputs)
        lib.hm2_sserial_set_process_data(self._handle, self._data._plan)
        for channel in self._channels:
            self._set_bits(channel)

    def _set_bits(self, channel: Channel) -> None:
        known, every = channel.description, 32 * self._registers
        bits = (every, every) if known is None else (known.layout.input_bits, known.layout.output_bits)
        self._check(lib.hm2_sserial_set_bits(self._handle, channel.number, *bits, self._error))
        register, mask = known.fault_word if known is not None and known.fault_word else (0, 0)
        lib.hm2_sserial_watch(self._handle, channel.number, register, mask)

    # -- small things

    def _zero(self, mask: int) -> None:
        for number, outputs in self.process_data.outputs.items():
            if mask >> number & 1:
                outputs.off()

    def _take_faults(self) -> tuple[Fault, ...]:
        if not self._image.events:
            return ()
        events = ffi.new("hm2_sserial_event[]", lib.HM2_SSERIAL_EVENTS)
        lost = ffi.new("uint64_t *")
        count = lib.hm2_sserial_take_events(self._handle, events, lib.HM2_SSERIAL_EVENTS, lost)
        self.faults_lost += lost[0]
        faults = tuple(self._fault(events[i]) for i in range(count))
        self.faults.extend(faults)
        return faults

    def _fault(self, event: Any) -> Fault:
        known = self._channels[event.channel].description
        return Fault(
            channel=event.channel,
            transfer=event.transfer,
            time_ns=event.time_ns,
            status=ChannelStatus(event.cs),
            failed=bool(event.failed),
            rising=event.rising,
            word=event.word,
            word_rising=event.word_rising,
            fault_names=known.fault_names if known is not None else (),
        )

    def _mask(self, channels: Iterable[Channel]) -> int:
        return self._mask_of(channel.number for channel in channels)

    @staticmethod
    def _mask_of(numbers: Iterable[int]) -> int:
        return sum(1 << number for number in set(numbers))

    def rows(self) -> list[tuple[str, ...]]:
        """Channels and elements as rows of a table, CS read now."""
        return [row for channel in self.channels for row in channel.rows()]

    def __str__(self) -> str:
        return f"smart serial port {self.number}"

    def __repr__(self) -> str:
        firmware = f"SSLBP {self.revision}, " if self.revision else ""
        title = f"{self}: {firmware}{self.mode}, started 0x{self.started:02X}"
        if self._board.closed:
            return title
        return title + "\n" + table([HEADER, *self.rows()])


def _same(old: dict[int, Any], new: dict[int, Any]) -> bool:
    return old.keys() == new.keys() and all(old[n].fields == new[n].fields for n in new)


def _check_mask(mask: int) -> None:
    if not 0 <= mask <= 0xFF:
        raise ValueError(f"channel mask {mask:#x} is outside 0..0xFF")


def _check_access(address: int, size: int) -> None:
    if size not in (1, 2, 4, 8):
        raise ValueError(f"size {size} is not 1, 2, 4 or 8")
    if not 0 <= address <= 0x10000 - size:
        raise ValueError(f"address {address:#x} is outside the remote's 64 KiB")
