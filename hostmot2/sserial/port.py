"""A smart-serial port: one SSERIAL instance with up to eight channels, a remote on each.

Source: sserial.md and both SSLBP observed sheets; the protocol itself is in csrc/sserial*.c.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

from hostmot2._core import ffi, lib
from hostmot2.board import SafeOff
from hostmot2.idrom import ModuleDescriptor, PinDescriptor
from hostmot2.layout import table
from hostmot2.process_data import ProcessData
from hostmot2.registers import Gtag, Sserial
from hostmot2.remotes.discovery import RemoteDescription
from hostmot2.sserial.channel import HEADER, Channel
from hostmot2.sserial.core import SETUP, Core
from hostmot2.sserial.errors import NoRemote, NotStarted
from hostmot2.sserial.evidence import Identity
from hostmot2.sserial.masks import numbers
from hostmot2.sserial.memory import PortMemory
from hostmot2.sserial.places import places
from hostmot2.sserial.remotes import Remotes
from hostmot2.sserial.results import DoitResult, Scan, StartResult
from hostmot2.sserial.status import ChannelStatus, Fault, tell

if TYPE_CHECKING:
    from hostmot2.board import Board

StartMode = Literal["normal", "setup"]

FAULTS_KEPT = 1000

_doit = lib.hm2_sserial_doit
_NEWS: int = lib.HM2_SSERIAL_NEWS
_GOOD = tuple(DoitResult(0, mask) for mask in range(256))


class SserialPort(PortMemory):
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
        self.faults: deque[Fault] = deque(maxlen=FAULTS_KEPT)
        """New faults as they appeared, the latest last."""
        self.on_faults: list[Callable[[tuple[Fault, ...]], None]] = []
        """All called with new faults, whoever's transfer brought them, while the board's lock is held."""
        self.faults_lost = 0
        """Faults that came faster than they were taken."""
        self.last_cycle = DoitResult(0)
        """What the board's last exchange brought; `requested` is 0 if no DOIT had ended."""
        self._cyclic = 0
        self._joined = False
        self._lock = board.lock
        self._is_ready = False
        self._open(max((pin.secondary_pin & 0x0F for pin in self.pins), default=1))
        board.on_close(self._end, SafeOff.SSERIAL)
        # a bite has cut the remotes off: when the pins come back nothing may go on where it was
        board.on_restore(self._end, SafeOff.SSERIAL)

    def _open(self, channels: int) -> None:
        module = self._module
        self._core = Core(
            self._board.handle,
            self.number,
            base=module.base,
            strides=(module.register_stride, module.instance_stride),
            instance=self._instance,
            channels=channels,
            registers=7 if module.gtag == Gtag.SSERIAL_B else 3,
        )
        # for doit, plain pointers: cffi takes those faster than owning ones, which the core holds
        self._handle = ffi.cast("struct hm2_sserial *", self._core.handle)
        self._error = ffi.cast("hm2_error *", self._core.error)
        self._channels = tuple(Channel(self, n) for n in range(self._core.channels))
        self._remotes = Remotes(self._core, self._channels, places(self._board.pins, self.pins))

    def _identify(self) -> None:
        channels = self._core.identify()
        if 1 <= channels <= 8 and channels != self._core.channels:
            self._open(channels)  # the firmware knows better than the pins, which may be masked out
            self._core.identify()

    def _end(self) -> None:
        if self._is_ready:
            self.stop()

    # -- the product's heart

    def start(self, mask: int, mode: StartMode = "normal") -> StartResult:
        """Start the channels in `mask` (bit n: channel n), their outputs zero until you set them.

        normal: process data. Switches the port's pins to it, and reads the tables of remotes that are not
        known yet (once, but the full scale of an 8I20 each time that nothing else runs: 36 ms for a 7I77,
        3 ms for an 8I20, 55 ms more where a channel is silent). Faults of the start are told at its end.
        Channels that run already go on undisturbed, unless they are at fault: those are stopped and started
        anew.
        setup: access to the remotes' memory, for `read_remote` and `parameters`.

        A channel that does not start does not keep others from it: see the result's `failed` and its text
        for why, or `raise_for_failed()`.

        Then blocks until the firmware is done, and running channels get no transfer meanwhile: 1 ms where a
        remote is, 17 ms where none answers, 0.3 s for a remote that stays busy. An armed watchdog hears
        nothing all that time: start before you drive pins, or give it more.

        Raises WatchdogBite, PortRunning for setup while channels run, CommandHung if the firmware had to be
        stopped, ValueError for a mask outside 0..0xFF, TransportError.
        """
        _check_mask(mask)
        if mode not in ("normal", "setup"):
            raise ValueError(f"mode is 'normal' or 'setup', not {mode!r}")
        with self._lock:
            self._ready()
            self._connect()
            failed = self._start_setup(mask) if mode == "setup" else self._start_normal(mask)
            if failed:  # looking for remotes may take longer than the watchdog waits; then they are cut off
                self._board.cycle.raise_for_bite()
            self._take_faults()  # of the start: enables set behind it are not for the first exchange to drop
            started, repeated = mask & self.started, self._remotes.repeated
            if not failed:
                return StartResult(started, 0, repeated=repeated)
            rows = tuple(self._remotes.evidence(mask))
            return StartResult(started, failed, rows, tuple(self._remotes.others(mask)), repeated)

    def stop(self, mask: int | None = None) -> None:
        """Zero the outputs of the channels in `mask`, send that, and stop them. None: STOP ALL.

        Clears their faults and counters. Raises CommandHung, TransportError.
        """
        stopped = 0xFF if mask is None else mask
        _check_mask(stopped)
        with self._lock:
            self._ready()
            self._remotes.zero(stopped)
            if stopped:
                self._core.stop(0 if mask is None else stopped)

    def doit(self, mask: int | None = None) -> DoitResult:
        """Send the outputs of the channels in `mask` (None: all started), and take their inputs in.

        One exchange with the remotes, 45 to 130 us. A channel in `failed` has kept its old inputs; `faults`
        are the new ones. Must be repeated every 50 ms (remotes' watchdog; 8I20: 40 ms), else the remotes'
        outputs go off until stop() and start().

        Raises NotStarted if nothing was started, CommandHung, TransportError, ValueError for the mask.
        """
        if mask is None:
            mask = self._started_or_raise()
        try:
            with self._lock:
                status = _doit(self._handle, mask, self._error)
        except OverflowError:
            status = lib.HM2_ERR_RANGE
        if status == 0:
            return _GOOD[mask]
        return self._doit_result(status, mask, mask)

    def doit_pipelined(self, mask: int | None = None) -> DoitResult:
        """One step of a pipeline: take in what the last step's DOIT brought, send the outputs, do not wait.

        `requested` names the channels the result speaks of; it is 0 in the first step. For fixed cycles of
        at least 0.2 ms. Errors as `doit`, and SserialError if the last DOIT is still at work: then nothing
        was sent.
        """
        if mask is None:
            mask = self._started_or_raise()
        _check_mask(mask)
        with self._lock:
            status, requested = self._core.cycle(mask)
        return self._doit_result(status, mask, requested)

    @property
    def cyclic(self) -> int:
        """Mask of the channels whose process data is part of the board's cycle; 0 unless set.

        Each exchange of `board.cycle` then takes in what the last one's DOIT brought and sends the next, for
        those that are started. `last_cycle` is its result. A period of at least 0.2 ms lets one follow the
        other (0.6 ms where reading and writing are one exchange); a DOIT too soon is left out and counted.
        """
        return self._cyclic

    @cyclic.setter
    def cyclic(self, mask: int) -> None:
        _check_mask(mask)
        with self._lock:
            self._ready()
            if not self._joined:
                self._core.join(self._board.cycle, self._after_cycle)
                self._joined = True
            self._core.set_cyclic(mask)
            self._cyclic = mask

    def _after_cycle(self) -> None:
        if self._cyclic:
            status, requested = self._core.cyclic_result()
            self.last_cycle = self._doit_result(status, 0, requested)

    def reset(self) -> None:
        """Zero the outputs and reset the port's processor: all channels stopped, default baud rates."""
        with self._lock:
            self._ready()
            self.stop()
            self._core.reset()

    # -- what is on it

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels by number."""
        if not self._is_ready and not self._board.read_only and not self._board.closed:
            with self._lock:
                self._ready()
        return self._channels

    @property
    def process_data(self) -> ProcessData:
        """The elements of all described channels; a new object when a remote has changed."""
        return self._remotes.process_data

    def scan(self, *, setup_rate: bool = False) -> Scan:
        """Look at every channel: who answers, what it is, and why a channel cannot be used.

        Reads all tables anew. setup_rate: where nothing answers, also look for a remote whose set-up jumper
        is in place (60 ms more). Afterwards everything is stopped. Raises PortRunning while channels move
        process data.
        """
        with self._lock:
            self._ready()
            self._refuse_while_running()
            self._connect()
            rows = self._remotes.look(self._core.existing)
            if setup_rate:
                rows = self._remotes.look_at_setup_rate(rows)
            self._board.cycle.raise_for_bite()
            return Scan(rows)

    def discover(self, channel: int) -> RemoteDescription:
        """Read one remote's tables anew; see Channel.discover."""
        known = self.channels[channel]
        with self._lock:
            self._refuse_while_running()
            self._connect()
            rows = self._remotes.look(1 << channel)
            if known.problem is not None:
                raise known.problem
            if known.description is None:
                raise self._remotes.no_remote(f"{known.label} did not start ({rows[0].reason})", rows)
            return known.description

    def pause(self, seconds: float) -> None:
        """Let time pass on the board's clock."""
        self._board.pause(seconds)

    @property
    def transfers(self) -> dict[str, Any]:
        """What was counted, as in `hm2_sserial_counters` (csrc/hm2.h), and starts_repeated."""
        return self._core.transfers() | {"starts_repeated": self._remotes.repeats}

    # -- what channels ask their port

    def identity(self, channel: int) -> Identity:
        """What the remote answered at the last start of the channel."""
        return self._core.identity(channel)

    def read_status(self, channel: int) -> ChannelStatus:
        """The channel's CS register, read now."""
        return ChannelStatus(self._board.read(self.register_address(Sserial.cs.number, channel)))

    def register_address(self, register: int, channel: int = 0) -> int:
        """The byte address of one of the port's registers; `register` as in `registers.Sserial`."""
        return self._module.register_address(register, self._instance, channel)

    @property
    def data_registers(self) -> int:
        """How many registers a channel has for process data, 3 or 7."""
        return self._core.registers

    def no_remote(self, channel: int) -> NoRemote:
        """The exception for a channel on which nothing has answered, with what to check."""
        message = f"{self.label} channel {channel}: no remote has answered here"
        rows = self._remotes.evidence(1 << channel)
        return self._remotes.no_remote(message, rows, ask=not self._board.read_only)

    def look_if_stopped(self, channel: int) -> None:
        """Look at the channels once, if that disturbs nothing, so that their elements are known."""
        if not self._remotes.looked >> channel & 1 and not self.started and not self._board.read_only:
            self.scan()

    # -- starting

    def _connect(self) -> None:
        """Switch the FPGA pins to smart serial; idempotent."""
        if self.pins:
            self._board.ioport.claim(self.pins, "sserial", after_bite=True)

    def _started_or_raise(self) -> int:
        started = self._core.started
        if not started:
            raise NotStarted(f"{self.label}: no channel is started")
        return started

    def _start_setup(self, mask: int) -> int:
        self._refuse_while_running()
        if not self.started:
            self._core.stop()  # a start that broke off on the bus may have left channels running
        return self._remotes.start(mask, SETUP)

    def _start_normal(self, mask: int) -> int:
        if self.mode == "setup":
            self._core.stop()
        self._stop_sick(mask)
        return self._remotes.start_described(mask & ~self.started)

    def _stop_sick(self, mask: int) -> None:
        """Stop running channels that are at fault: only a stop clears that, and start() was asked for."""
        sick = 0
        for number in numbers(mask & self.started):
            status = self.read_status(number)
            if status.live_fault or status.status or status.local_fault:
                sick |= 1 << number
        if sick:
            self.stop(sick)

    # -- small things

    def _doit_result(self, status: int, mask: int, requested: int) -> DoitResult:
        if status < 0:
            _check_mask(mask)
            self._core.check(status)
        faults = self._take_faults() if status & _NEWS else ()
        return DoitResult(status & 0xFF, requested, faults)

    def _take_faults(self) -> tuple[Fault, ...]:
        with self._lock:
            found, lost = self._core.take_faults()
            self.faults_lost += lost
            for i, fault in enumerate(found):
                known = self._channels[fault.channel].description
                if known is not None and known.fault_names:
                    found[i] = replace(fault, fault_names=known.fault_names)
            faults = tuple(found)
            if faults:
                self.faults.extend(faults)
                tell(self.on_faults, faults)
        return faults

    def rows(self) -> list[tuple[str, ...]]:
        """Channels and elements as rows of a table, CS read now."""
        return [row for channel in self.channels for row in channel.rows()]

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"smart serial port {self.number}"

    def __repr__(self) -> str:
        firmware = f"SSLBP {self.revision}, " if self.revision else ""
        title = f"{self.label}: {firmware}{self.mode}, started 0x{self.started:02X}"
        return title if self._board.closed else title + "\n" + table([HEADER, *self.rows()])


def _check_mask(mask: int) -> None:
    if not 0 <= mask <= 0xFF:
        raise ValueError(f"channel mask {mask:#x} is outside 0..0xFF")
