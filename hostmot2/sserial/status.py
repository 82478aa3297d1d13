"""The CS register in words, and new faults by their edges. Source: sserial.md 3.2, 3.3.

Which bits can be believed at the moment of a read:

* live: NotReady, NoRemoteID, COM_STATE, and from the first DOIT after a start on the remote fault byte;
* sticky until the channel is stopped (firmware up to 1.43; later ones may clear them): the local fault
  byte, CommunicationError and RemoteFault of the status byte.

Whether one transfer worked is the DATA register's to say, which `DoitResult.failed` repeats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.registers import ComState, CsStatus, LocalFault, RemoteFault

_STICKY_STATUS = CsStatus.COMMUNICATION_ERROR | CsStatus.REMOTE_FAULT

_REMOTE_FAULTS = {
    RemoteFault.WATCHDOG: "watchdog bitten",
    RemoteFault.NO_ENABLE: "not enabled",
    RemoteFault.OVER_TEMPERATURE: "over temperature",
    RemoteFault.OVER_CURRENT: "over current",
    RemoteFault.HIGH_VOLTAGE: "high voltage",
    RemoteFault.LOW_VOLTAGE: "low voltage",
    RemoteFault.ILLEGAL_MODE: "illegal mode",
    RemoteFault.LBP_COMMUNICATION: "LBP communication",
}
_LOCAL_FAULTS = {
    LocalFault.CRC: "CRC error",
    LocalFault.INVALID_COOKIE: "invalid cookie",
    LocalFault.OVERRUN: "overrun",
    LocalFault.TIMEOUT: "timeout",
    LocalFault.EXTRA_CHARACTER: "extra character",
    LocalFault.SERIAL_BREAK: "serial break",
    LocalFault.REMOTE_FAULT: "remote fault",
    LocalFault.TOO_MANY_ERRORS: "too many errors",
}
_STATUS = {
    CsStatus.REMOTE_FAULT: "remote fault",
    CsStatus.COMMUNICATION_ERROR: "communication error",
    CsStatus.NO_REMOTE_ID: "no remote identified",
    CsStatus.NOT_READY: "not ready",
}


def _names(flags: int, texts: dict[Any, str]) -> tuple[str, ...]:
    return tuple(text for bit, text in texts.items() if flags & bit)


@dataclass(frozen=True, slots=True)
class ChannelStatus:
    """One reading of a channel's CS register."""

    word: int

    @property
    def remote_fault(self) -> RemoteFault:
        """The remote's fault byte, live; left over from before until the first DOIT after a start.

        8I20 and 7I64 do not have it: their faults are process data.
        """
        return RemoteFault(self.word >> 24)

    @property
    def com_state(self) -> ComState | int:
        """The firmware's state for this channel; a plain int for one that is not known."""
        code = self.word >> 16 & 0xFF
        return ComState(code) if code in ComState._value2member_map_ else code

    @property
    def status(self) -> CsStatus:
        """The status byte."""
        return CsStatus(self.word >> 8 & 0xFF)

    @property
    def local_fault(self) -> LocalFault:
        """Errors on the line since the channel was last stopped."""
        return LocalFault(self.word & 0xFF)

    @property
    def not_ready(self) -> bool:
        """Whether the channel is stopped, absent or still starting."""
        return bool(self.status & CsStatus.NOT_READY)

    @property
    def live(self) -> tuple[str, ...]:
        """What holds at the moment of the reading, in words."""
        status = self.status & ~_STICKY_STATUS
        return _names(status, _STATUS) + self.fault_names

    @property
    def fault_names(self) -> tuple[str, ...]:
        """The bits of `live_fault` in words."""
        return _names(self.live_fault, _REMOTE_FAULTS)

    @property
    def live_fault(self) -> RemoteFault:
        """The remote's fault byte; none where it has not been heard since the start.

        A stop and the chatter behind a start leave the byte of before (SSLBP observed 2).
        """
        code = self.word >> 16 & 0xFF
        chatter = code in (ComState.CHATTER_SEND, ComState.CHATTER_GET)
        unheard = self.not_ready and code < ComState.FAULT_SEND
        return RemoteFault(0) if chatter or unheard else self.remote_fault

    @property
    def sticky(self) -> tuple[str, ...]:
        """What has happened since the channel was last stopped, in words."""
        return _names(self.status & _STICKY_STATUS, _STATUS) + _names(self.local_fault, _LOCAL_FAULTS)

    @property
    def state(self) -> str:
        """stopped, absent, starting, chatter, dead, running, setup."""
        code = self.word >> 16 & 0xFF
        if code == ComState.RESET:
            return "stopped"
        if code < ComState.CHATTER_SEND:
            gave_up = self.local_fault & LocalFault.TOO_MANY_ERRORS
            return ("absent" if code <= ComState.COOKIE_GET else "failed") if gave_up else "starting"
        if code <= ComState.CHATTER_GET:
            # in chatter the firmware stops sending for good at the 21st error
            return "dead" if self.local_fault & LocalFault.TOO_MANY_ERRORS else "chatter"
        if code in (ComState.SETUP, ComState.SETUP_GET):
            return "setup"
        return "running" if code <= ComState.RUN_GET else f"state 0x{code:02X}"

    def __str__(self) -> str:
        parts = [self.state]
        if self.live:
            parts.append(", ".join(self.live))
        if self.sticky:
            parts.append("since stop: " + ", ".join(self.sticky))
        return "; ".join(parts)

    def __repr__(self) -> str:
        return f"<CS 0x{self.word:08X}: {self}>"


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that was not there in the transfer before.

    transfer: number of the DOIT since the port was opened, 0 for the start. time_ns: on the board's clock.
    failed: the transfer brought no new inputs. rising: bits of CS that have appeared. word, word_rising:
    the remote's own fault word (8I20) and its new bits; fault_names its bits' names.
    """

    channel: int
    transfer: int
    time_ns: int
    status: ChannelStatus
    failed: bool
    rising: int
    word: int = 0
    word_rising: int = 0
    fault_names: tuple[str, ...] = ()

    @property
    def causes(self) -> tuple[str, ...]:
        """What is new, in words; what was known before is in `status`."""
        new = ChannelStatus(self.rising)
        words = _names(new.remote_fault, _REMOTE_FAULTS) + _names(new.local_fault, _LOCAL_FAULTS)
        words += tuple(name for i, name in enumerate(self.fault_names) if name and self.word_rising >> i & 1)
        return words or _names(new.status, _STATUS)

    def __str__(self) -> str:
        what = ", ".join(self.causes) or "transfer failed again"
        failed = " (no new inputs)" if self.failed else ""
        return f"channel {self.channel}: {what}{failed}, CS 0x{self.status.word:08X}"


class FaultWatcher:
    """New faults in a sequence of readings, for recordings and tests; a port watches its own channels.

    A fault is reported when it appears: sticky bits once per stop, live ones each time they come back, a
    failed transfer when the one before was good.
    """

    def __init__(self) -> None:
        self._watches: dict[int, Any] = {}
        self._transfers: dict[int, int] = {}

    def update(self, channel: int, cs: int, failed: bool = False, word: int = 0) -> Fault | None:
        """One transfer's CS, DATA bit and, where the remote has one, fault word."""
        watch = self._watches.setdefault(channel, ffi.new("hm2_fault_watch *"))
        self._transfers[channel] = self._transfers.get(channel, 0) + 1
        if not lib.hm2_fault_watch_step(watch, cs, word, failed):
            return None
        return Fault(
            channel,
            self._transfers[channel],
            0,
            ChannelStatus(cs),
            bool(failed),
            watch.rising,
            word,
            watch.word_rising,
        )

    def stopped(self, channels: Iterable[int] | None = None) -> None:
        """The channels (None: all) were stopped: nothing is known of them any more."""
        for channel in list(self._watches) if channels is None else channels:
            self._watches.pop(channel, None)


def tell(actions: Iterable[Callable[[tuple[Fault, ...]], None]], faults: tuple[Fault, ...]) -> None:
    """Call all with new faults: cards drop their enables in theirs. The first exception is raised last."""
    failed: BaseException | None = None
    for action in actions:
        try:
            action(faults)
        except BaseException as error:
            failed = failed or error
    if failed is not None:
        raise failed
