"""What hangs on the channels of an emulated card's SSERIAL instance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from hostmot2._core import ffi, lib

if TYPE_CHECKING:
    from hostmot2.emulator.board import EmulatedBoard


class Remote(Protocol):
    """What can be attached to an SSERIAL channel: it has a `hm2_remote` handle of the C core."""

    @property
    def handle(self) -> Any:
        """The `hm2_remote *`, alive as long as this object."""

    def hangs_on(self, card: Any) -> None:
        """Told the `hm2_emulator *` it is attached to, and None when it is taken off."""


class LineByte(NamedTuple):
    """One byte on a serial line, as a line monitor sees it."""

    channel: int
    to_remote: bool
    value: int
    start_us: float
    bit_us: float
    framing_error: bool


class EmulatedSserialPort:
    """One SSERIAL instance: what hangs on its channels."""

    def __init__(self, board: EmulatedBoard, instance: int) -> None:
        self._board = board
        self._instance = instance
        self._remotes: dict[int, Remote] = {}
        self.channels: int = lib.hm2_emulator_sserial_channels(board.handle, instance)
        """The number of channels of the instance."""

    def attach(self, channel: int, remote: Remote, *, through_pins: bool = False) -> None:
        """Put `remote` on a channel, in place of what was there.

        It is wired to the SSERIAL instance itself and answers at once. With `through_pins` it hangs on
        the card's pins, as the remotes of a daughter card do: absent until the channel's pins are
        switched to their secondary function (fact sheet sserial.md 1.3). Raises IndexError for a channel
        the instance does not have.
        """
        self._set(channel, remote.handle, through_pins)
        self._taken_off(channel)
        self._remotes[channel] = remote
        remote.hangs_on(self._board.handle)

    def detach(self, channel: int) -> None:
        """Take the remote off: the channel is an idle line."""
        self._set(channel, ffi.NULL, False)
        self._taken_off(channel)

    def remote(self, channel: int) -> Remote | None:
        """What hangs on a channel, brought up to now."""
        lib.hm2_emulator_sync(self._board.handle)
        return self._remotes.get(channel)

    def take_line_bytes(self) -> list[LineByte]:
        """What went over the instance's lines since the last call, in the order it was heard.

        Only the last 4096 bytes are kept, so call it often enough. Empty with wire="off".
        """
        lib.hm2_emulator_sync(self._board.handle)
        capacity = lib.HM2_LINE_RECORDS_KEPT
        records = ffi.new("hm2_line_record[]", capacity)
        count = lib.hm2_emulator_line_records(self._board.handle, self._instance, records, capacity)
        return [
            LineByte(
                r.channel,
                bool(r.to_remote),
                r.byte.value,
                r.byte.start_ps / 1e6,
                r.byte.bit_ps / 1e6,
                bool(r.byte.framing_error),
            )
            for r in records[0:count]
        ]

    def _taken_off(self, channel: int) -> None:
        remote = self._remotes.pop(channel, None)
        if remote is not None and remote not in self._remotes.values():
            remote.hangs_on(None)

    def _set(self, channel: int, handle: Any, through_pins: bool) -> None:
        status = lib.hm2_emulator_attach(self._board.handle, self._instance, channel, handle, through_pins)
        if status != lib.HM2_OK:
            raise IndexError(
                f"SSERIAL instance {self._instance} has channels 0..{self.channels - 1}, no {channel}"
            )
