"""What is known of the remotes of a port, and how it is found out. The caller holds the board's lock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from hostmot2.errors import StaleRequest
from hostmot2.process_data import ProcessData
from hostmot2.registers import ComState, LbpSpace, LocalFault, SslbpChannel
from hostmot2.remotes import builtin
from hostmot2.remotes.discovery import ReadFailed, RemoteDescription, read_tables
from hostmot2.sserial.core import NORMAL, SETUP, Core, stale
from hostmot2.sserial.errors import (
    BrokenTable,
    NoRemote,
    NotDiscovered,
    RemoteSilent,
    SetupJumper,
    UnsupportedRemote,
    raise_for,
)
from hostmot2.sserial.evidence import ChannelEvidence
from hostmot2.sserial.masks import bits, numbers
from hostmot2.sserial.places import Place
from hostmot2.sserial.results import no_remote

if TYPE_CHECKING:
    from hostmot2.sserial.channel import Channel

SETUP_BAUD = 115200

CLEAN_STARTS = 3
"""So often a channel whose line showed errors during its start is started anew."""


class Remotes:
    """The descriptions of a port's remotes (kept in its channels) and their process data."""

    def __init__(self, core: Core, channels: tuple[Channel, ...], places: dict[int, Place]) -> None:
        self._core = core
        self._channels = channels
        self._places = places
        self.looked = 0
        """Channels that have been looked at in setup mode."""
        self.repeated = 0
        """Channels whose last start was done more than once, because answers were lost or damaged in it."""
        self.unsure = 0
        """Channels whose description may have become wrong: described anew before their process data runs."""
        self.written = 0
        """Those of them whose remote was written, and so is there: they are looked at first."""
        self.repeats = 0
        """How many starts of channels were repeated so far."""
        self.process_data: ProcessData = core.set_process_data({})

    def start(self, mask: int, mode: int) -> int:
        """Start channels; returns those that did not start. What has a problem is not started normally."""
        usable = mask
        if mode == NORMAL:
            usable &= ~bits(c.number for c in self._channels if c.problem is not None)
        modes = {c.number: c.mode for c in self._channels}
        fresh = usable & ~self._core.started
        failed = self._core.start(usable, mode, modes)
        again = self._noisy(usable & ~failed) | self._unit_unheard(failed) | self._disturbed(fresh)
        self.repeated = again
        for _ in range(CLEAN_STARTS):
            if not again:
                break
            self.repeats += again.bit_count()
            self._core.stop(again)
            failed = failed & ~again | self._core.start(again, mode, modes)
            again = self._noisy(again & ~failed) | self._disturbed(again)
        if self._disturbed(again):
            self._core.stop(fresh)
            raise stale(self._core.number, f"channels {fresh:#04x} were started")
        return failed | mask & ~usable

    def _disturbed(self, mask: int) -> int:
        return bits(n for n in numbers(mask) if self._core.disturbed(n))

    def _noisy(self, mask: int) -> int:
        """Started channels whose line showed errors meanwhile.

        An answer that came twice is taken for the next one: unit number and name would be those of nobody.
        """
        return bits(n for n in numbers(mask) if self._core.identity(n).status.local_fault)

    def _unit_unheard(self, failed: int) -> int:
        """Channels whose start ended at the unit number: the one answer the firmware does not ask for again.

        A remote is there, because its cookie and status have been heard, and nothing of it runs, so that
        starting it once more risks nothing. Source: sserial.md 3.4.
        """
        found = {n: self._core.identity(n).status for n in numbers(failed)}
        return bits(
            n
            for n, status in found.items()
            if status.com_state == ComState.UNIT_NUMBER_GET and status.local_fault & LocalFault.TIMEOUT
        )

    def zero(self, mask: int) -> None:
        """All outputs of the channels to 0."""
        for number, outputs in self.process_data.outputs.items():
            if mask >> number & 1:
                outputs.off()

    def _restart(self, mask: int) -> None:
        """Counters of freshly started channels begin anew, and no input is one of before."""
        for number in self.process_data.layouts:
            if mask >> number & 1:
                self.process_data.restart(number)
                self.process_data.clear_inputs(number)

    def start_described(self, fresh: int) -> int:
        """Start channels normally, each as the remote it is described as; returns those that did not start.

        While others run nothing is described anew: tables would need setup mode, new process data would zero
        the outputs of the channels that run.
        """
        running = self._core.started
        unread = 0 if running else self._scaled_by_parameter(fresh) & ~self._look_before_start(fresh)
        self.zero(fresh)
        failed = self.start(fresh, NORMAL)
        self.unsure |= unread | (self._scale_pending(fresh) if running else 0)
        strangers = self._strangers(fresh & self._core.started)
        why = "and what it is cannot be read while other channels run"
        if strangers and not running:
            self.look(strangers, keep=True)
            failed = self.start(fresh, NORMAL)
            strangers = self._strangers(fresh & self._core.started)
            why = "once more since its tables were read"
        failed |= self._stop_changed(strangers, why)
        self._restart(fresh)
        return failed

    def _scaled_by_parameter(self, mask: int) -> int:
        """Channels whose full scale is read at each start: one of before could be a wrong current.

        Behind the start, which tells in 17 ms that a drive is off. To look for it takes 55 ms, and the card's
        watchdog waits for 50.
        """
        return self._described_as(mask, lambda known: known.scaled_by_parameter)

    def _scale_pending(self, mask: int) -> int:
        """Channels whose full scale is another one if they were powered up again since it was read."""
        return self._described_as(mask, lambda known: known.scale_pending)

    def _described_as(self, mask: int, holds: Callable[[RemoteDescription], bool]) -> int:
        found = ((n, self._channels[n].description) for n in numbers(mask & self._core.existing))
        return bits(n for n, known in found if known is not None and holds(known))

    def _look_before_start(self, fresh: int) -> int:
        """Read the tables of remotes that are not known; returns the channels looked at.

        All channels the first time: later some may run.
        """
        unknown = self._core.existing & ~self.looked | self.written
        for number in numbers(fresh & self._core.existing):
            channel = self._channels[number]
            known = channel.description
            if channel.problem is not None or (known is not None and known.software_mode != channel.mode):
                unknown |= 1 << number
        if not unknown & (fresh | self.written):
            return 0
        self.look(unknown, keep=True)
        return unknown

    def note_write(self, channel: int) -> None:
        """A remote's memory was written: its full scale may be another one."""
        known = self._channels[channel].description
        if known is not None and known.scaled_by_parameter:
            self.unsure |= 1 << channel
            self.written |= 1 << channel

    def _strangers(self, started: int) -> int:
        """Started channels whose remote, or software mode, is not the one that was described."""
        strangers = 0
        for number in numbers(started):
            channel, found = self._channels[number], self._core.identity(number)
            now = found.unit_number, found.name, found.toc, channel.mode
            if channel.description is None or channel.description.identity != now:
                strangers |= 1 << number
        return strangers | self.unsure & started

    def _stop_changed(self, strangers: int, why: str) -> int:
        """Stop the strangers that have elements of another remote; returns their mask."""
        changed = [number for number in numbers(strangers) if self._channels[number].description is not None]
        for number in changed:
            channel = self._channels[number]
            channel.description = None
            channel.problem = NotDiscovered(
                f"{channel.label}: another remote, software mode or full scale than before, {why}",
                index=number,
            )
        if changed:
            self._core.stop(bits(changed))
        return bits(changed)

    def look(self, mask: int, *, keep: bool = False) -> list[ChannelEvidence]:
        """Start channels in setup mode, describe their remotes, stop everything.

        One remote's trouble is kept with its channel and leaves the others alone. keep: of a remote that was
        to say its full scale again and is silent now, the description stays, unsure.
        """
        self._core.stop()
        before = {number: self._channels[number].description for number in numbers(mask)}
        self.unsure &= ~mask
        self.written &= ~mask
        self.looked &= ~mask  # until it is done: what breaks off has seen nobody
        for number in numbers(mask):
            self._channels[number].description, self._channels[number].problem = None, None
        self.start(mask, SETUP)
        try:
            noisy = self._noisy(mask & self._core.started)
            for number in numbers(mask & self._core.started):
                channel = self._channels[number]
                try:
                    if noisy >> number & 1:
                        raise damaged(self._core, number)
                    channel.description = self._described(number)
                except (BrokenTable, RemoteSilent, UnsupportedRemote) as problem:
                    channel.problem = problem
            self.looked |= mask
            rows = self.evidence(mask)
            for number in numbers(mask if keep else 0):
                channel, known = self._channels[number], before[number]
                silent = channel.description is None and isinstance(channel.problem, RemoteSilent | None)
                if silent and known is not None and known.scaled_by_parameter:
                    channel.description = known
                    self.unsure |= 1 << number
        finally:
            self._core.stop()
        self._update_process_data()
        return rows

    def _described(self, number: int) -> RemoteDescription:
        """What a remote in setup mode says of itself, on a line and a network that show no error meanwhile.

        One damaged answer in 256 passes the CRC, and a wrong limit in a table is a wrong output for ever.
        """
        mode = self._channels[number].mode
        for _ in range(CLEAN_STARTS):
            broken: Exception | None = None
            try:
                found = describe(self._core, number, mode)
            except (BrokenTable, RemoteSilent, StaleRequest) as problem:
                broken = problem
            noisy = self._core.line_errors(number)
            if not self._core.disturbed(number) and (not noisy or isinstance(broken, RemoteSilent)):
                if broken is not None:
                    raise broken
                return found
            self.repeats += 1
            self._core.stop(1 << number)
            if self._core.start(1 << number, SETUP, {number: mode}):
                break
        if noisy:
            raise damaged(self._core, number, "while its tables are read")
        raise stale(self._core.number, f"the tables of channel {number} were read")

    def look_at_setup_rate(self, rows: list[ChannelEvidence]) -> list[ChannelEvidence]:
        """Look at channels that were silent for remotes that answer at the rate of their set-up jumper only.

        That is kept as their channels' problem. Nothing may run. Rates are as before afterwards.
        """
        mask = bits(row.channel for row in rows if not row.found)
        if not mask or not self._core.tells_blocks:
            return rows
        places = {n: self._core.block(n) + SslbpChannel.baud_rate.number for n in numbers(mask)}
        usual = {number: self._core.read_local(place, 4) for number, place in places.items()}
        try:
            self._rates(places, dict.fromkeys(places, SETUP_BAUD.to_bytes(4, "little")))
            self.start(mask, SETUP)
            for number in numbers(mask & self._core.started):
                found, channel = self._core.identity(number), self._channels[number]
                name = found.name or "a remote"
                channel.problem = SetupJumper(
                    f"channel {number}: {name} answers at 115.2 kbaud only", index=number
                )
        finally:
            self._core.stop()
            self._rates(places, usual)
        return [replace(row, problem=self._channels[row.channel].problem) for row in rows]

    def _rates(self, places: dict[int, int], rates: dict[int, bytes]) -> None:
        for number, place in places.items():
            self._core.write_local(place, rates[number])
        self._core.stop()  # which takes them over

    def evidence(self, mask: int, *, counted: bool = True) -> list[ChannelEvidence]:
        """What the channels show, a row each; with counters, ten bytes each that take an exchange or more."""
        told = counted and self._core.tells_blocks
        rows = []
        for number in numbers(mask):
            channel = self._channels[number] if number < len(self._channels) else None
            rows.append(
                ChannelEvidence(
                    channel=number,
                    exists=channel is not None,
                    started=bool(self._core.started >> number & 1),
                    identity=self._core.identity(number),
                    counters=self._core.channel_counters(number) if told and channel is not None else None,
                    problem=channel.problem if channel else None,
                    description=channel.description if channel else None,
                    place=self._places.get(number, Place("")),
                )
            )
        return rows

    def others(self, mask: int, *, ask: bool = True) -> list[ChannelEvidence]:
        """What the channels not in `mask` showed when they were last looked at.

        ask: those that never were are looked at now, unless a channel is started. Call it behind evidence():
        it stops everything.
        """
        unseen = self._core.existing & ~mask & ~self.looked
        if ask and unseen and not self._core.started:
            self.look(unseen)
        # while channels run their watchdogs wait for this
        return self.evidence(self._core.existing & ~mask & self.looked, counted=not self._core.started)

    def no_remote(self, message: str, rows: list[ChannelEvidence], *, ask: bool = True) -> NoRemote:
        """The exception for channels on which nothing answered, with what the others show."""
        return no_remote(message, rows, [*rows, *self.others(bits(row.channel for row in rows), ask=ask)])

    def _update_process_data(self) -> None:
        """Process data of all described channels, unless it is what it was."""
        layouts = {c.number: c.description.layout for c in self._channels if c.description is not None}
        old = self.process_data.layouts
        if old.keys() == layouts.keys() and all(old[n].fields == layouts[n].fields for n in layouts):
            return
        before, self.process_data = self.process_data, self._core.set_process_data(layouts)
        before.retire(
            NotDiscovered(
                f"smart serial port {self._core.number}: another remote or software mode was found, and "
                "these elements are of before; take `inputs` and `outputs` of the channel anew",
                causes=("they were kept over a start() or scan() that found something else on a channel",),
                fix="Take them from the channel after start(); what is kept of before moves nothing.",
            )
        )
        for channel in self._channels:
            word = channel.description.fault_word if channel.description is not None else None
            self._core.set_bits(channel.number, layouts.get(channel.number), word)


def damaged(core: Core, channel: int, when: str = "at every start") -> RemoteSilent:
    """What to say of a channel whose line shows errors again and again."""
    status = core.identity(channel).status
    errors = f" ({', '.join(status.sticky)})" if status.sticky else ""
    return RemoteSilent(
        f"smart serial port {core.number} channel {channel}: answers arrive damaged {when}{errors}, so what "
        "they say is not believed",
        index=channel,
        received=status.word,
    )


def describe(core: Core, channel: int, software_mode: int) -> RemoteDescription:
    """What a remote in setup mode says of itself, or what is known of it by its name.

    Raises BrokenTable, UnsupportedRemote, RemoteSilent, and errors of the port and the board.
    """
    found = core.identity(channel)
    read = partial(core.read_remote, channel)
    stored = partial(core.read_remote, channel, space=LbpSpace.EEPROM)
    if known := builtin.describe(found.name, found.unit_number, read, software_mode, read_stored=stored):
        return known
    if not found.toc & 0xFFFF:
        raise UnsupportedRemote(
            f"smart serial port {core.number} channel {channel}: {found.name!r} has no table of its process "
            "data and is not known by its name",
            index=channel,
        )
    try:
        return read_tables(
            partial(core.read_table, channel),
            channel,
            found.toc,
            name=found.name,
            unit_number=found.unit_number,
            software_mode=software_mode,
            registers=core.registers,
            sizes=core.sizes(channel),
        )
    except ReadFailed as failure:
        raise_for(failure.status, failure.error, core.number)
