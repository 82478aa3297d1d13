"""A recording in the card's place: the driver sees what it saw then, and must do what it did then.

Opening, starting remotes and whatever else is not in the cycle needs a card; an emulated one of the same kind
serves (`emu://...`). During the replay nothing reaches it: reads come from the recording, writes are compared
with the recorded ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hostmot2._core import ffi, lib
from hostmot2.board import Board, SafeOff
from hostmot2.record_ring import STAGES
from hostmot2.recording.bus import BusAround, places
from hostmot2.recording.likeness import raise_for_another_card, raise_for_other_remotes
from hostmot2.recording.recording import Recording
from hostmot2.registers import Gtag, Watchdog
from hostmot2.transports import open_transport
from hostmot2.transports.base import Transport


@dataclass(frozen=True, slots=True)
class Difference:
    """A word that was not written as it was then; None: not at all."""

    index: int  # of the record
    register: int  # byte address
    recorded: int | None
    written: int | None

    def __str__(self) -> str:
        then, now = ("nothing" if w is None else f"0x{w:08X}" for w in (self.recorded, self.written))
        return f"record {self.index}, register 0x{self.register:04X}: {then} then, {now} now"


class Replay(BusAround):
    """A bus that plays the records of `recording`, one cycle each.

        replay = Replay(read("run.mcap"), "emu://5i25+7i77?clock=virtual")
        with replay.open() as hm2:
            hm2.sserial.start(0x07); hm2.sserial.cyclic = 0x07     # as it was when recording began
            for index in range(len(replay)):
                replay.play(index)
                hm2.cycle.run()         # of the engine's read-modify-write style: read(), then write()
            replay.stop()

    A failed exchange fails again with its status, and a bite is raised in each cycle until it was accepted;
    who catches HostMot2Error goes on. `differences` are the writes that were not as recorded.
    Raises ValueError if the recording has no raw registers; open() and play() do for a card or remotes that
    are not as they were then: their registers would be taken for something else.
    """

    def __init__(self, recording: Recording, under: Transport | str) -> None:
        super().__init__(open_transport(under) if isinstance(under, str) else under)
        if not recording.image:
            raise ValueError(f"{recording.path} has no raw registers")
        self.recording = recording
        self.differences: list[Difference] = []
        self._words: dict[int, int] = {register: word for word, register in enumerate(recording.image)}
        self._index: int | None = None
        self._paused_ns = 0
        self._written: dict[int, int] = {}
        self._arm: Callable[[], None] | None = None
        self._armed_at = 0
        self._status: int | None = None
        self._board: Board | None = None  # whose remotes have not been looked at yet

    def __len__(self) -> int:
        return len(self.recording.records)

    def open(self) -> Board:
        """A board on this bus; closing it stops the replay first. Raises ValueError for another card."""
        board = Board(self.transport)
        try:
            raise_for_another_card(self.recording, board)
        except BaseException:
            board.close()
            raise
        board.on_close(self.stop, SafeOff.SESSION)
        self._follow_watchdog(board)
        self._board = board
        return board

    def _follow_watchdog(self, board: Board) -> None:
        """The watchdog is armed in the record in which it was fed first.

        An engine arms it when some cycles have run already. The status read until then is that of a watchdog
        not yet armed: no bite.
        """
        found = [module for module in board.modules if module.gtag == Gtag.WATCHDOG]
        if not found:
            return
        status, feed = (found[0].register_address(r.number) for r in (Watchdog.status, Watchdog.reset))
        fed = np.flatnonzero(self.recording.fresh(feed, written=True))
        if status | 1 in self._words:  # arming itself was recorded: the driver does it in its time
            return
        board.cycle.automatic_watchdog = False
        if fed.size:
            self._armed_at, self._status = int(fed[0]), status
            self._arm = board.watchdog.arm

    def play(self, index: int) -> None:
        """The coming exchanges are those of record `index`. IndexError; ValueError: other remotes."""
        if not 0 <= index < len(self):
            raise IndexError(f"record {index} of {len(self)}")
        if self._board is not None:
            raise_for_other_remotes(self.recording, self._board)
            self._board = None
        self._compare()
        self._index = None
        if index >= self._armed_at and self._arm is not None:
            self._arm()
            self._arm = None
        self._index, self._paused_ns = index, 0

    def stop(self) -> None:
        """Exchanges go to the card below again."""
        self._compare()
        self._index = None

    def begin(self, transfers: Any, count: int, error: Any) -> int:
        """Recorded words instead of an exchange."""
        if self._index is None:
            return super().begin(transfers, count, error)
        record = self.recording.records[self._index]
        if record["status"] and not self._came_back(record, transfers, count):
            return _fail(int(record["status"]), error)
        for address, write, words, index in places(transfers, count):
            if write:
                self._written[address] = words[index]
            elif address in self._words:
                unarmed = address == self._status and self._index <= self._armed_at
                words[index] = 0 if unarmed else int(record["words"][self._words[address]])
            else:
                status = self._from_below(address, words, index, error)
                if status:
                    return status
        return int(lib.HM2_OK)

    def _came_back(self, record: Any, transfers: Any, count: int) -> bool:
        """Of a cycle's exchanges one may have come back although another did not."""
        slots = (self._words.get(address | write) for address, write, _, _ in places(transfers, count))
        return any(_is_fresh(record, slot) for slot in slots if slot is not None)

    def finish(self, deadline_ns: int, error: Any) -> int:
        """Nothing to wait for."""
        return super().finish(deadline_ns, error) if self._index is None else int(lib.HM2_OK)

    def now_ns(self) -> int:
        """When the record's answer was there, and what has been waited since."""
        if self._index is None:
            return super().now_ns()
        record = self.recording.records[self._index]
        answered = int(record["start_ns"]) + int(record["stage_ns"][STAGES.index("reply")])
        return answered + self._paused_ns

    def pause_ns(self, ns: int) -> None:
        """Takes no time while replaying, but who waits for something must see time pass."""
        if self._index is None:
            super().pause_ns(ns)
        else:
            self._paused_ns += max(ns, 0)

    def _from_below(self, address: int, words: Any, index: int, error: Any) -> int:
        """A register that was not in the recorded cycles."""
        one = ffi.new("hm2_transfer *", (address, 1, 0, words + index))
        status = super().begin(one, 1, error)
        return status or super().finish(super().now_ns() + lib.HM2_BOARD_TIMEOUT_NS, error)

    def _compare(self) -> None:
        if self._index is None or self.recording.records["status"][self._index]:
            self._written.clear()
            return
        recorded = self._recorded_writes(self._index)
        for register in sorted({*recorded, *self._written}):
            then, now = recorded.get(register), self._written.get(register)
            if then != now:
                self.differences.append(Difference(self._index, register, then, now))
        self._written.clear()

    def _recorded_writes(self, index: int) -> dict[int, int]:
        record = self.recording.records[index]
        return {
            register & ~1: int(record["words"][word])
            for register, word in self._words.items()
            if register & 1 and _is_fresh(record, word)
        }


def _is_fresh(record: Any, word: int) -> bool:
    return bool(record["fresh"][word // 32] >> np.uint32(word % 32) & 1)


def _fail(status: int, error: Any) -> int:
    if error != ffi.NULL:
        ffi.memmove(error, ffi.new("hm2_error *"), ffi.sizeof("hm2_error"))
        error.status, error.index = status, -1
        ffi.memmove(error.where, b"replayed", 8)
    return status


def remote_inputs(recording: Recording, index: int) -> dict[tuple[int, int], bytes]:
    """(port, channel) -> process data the remote had sent by record `index`, as `EmulatedRemote.inputs`.

    Remotes none of whose registers were recorded are left out; so is everything without descriptors.
    """
    result: dict[tuple[int, int], bytes] = {}
    if recording.descriptors is None:
        return result
    slots = {register: word for word, register in enumerate(recording.image)}
    words = recording.records["words"][index]
    for port in recording.descriptors.text.ports:
        for channel in port.channels:
            size = max(channel.receive_size - 1, 0)
            if channel.registers and channel.registers[0] in slots:
                image = [int(words[slots[r]]) if r in slots else 0 for r in channel.registers]
                data = b"".join(word.to_bytes(4, "little") for word in image)
                result[port.port, channel.channel] = data[:size]
    return result
