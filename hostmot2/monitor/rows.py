"""The rows of a snapshot, from a frame of the engine and what the board knows of its parts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from hostmot2.elements import Bits, Elements, Value
from hostmot2.engine import Frame
from hostmot2.monitor.snapshot import BitsRow, ChannelRow, EncoderRow, ValueRow
from hostmot2.monitor.watched import module_of
from hostmot2.registers import Gtag, RemoteFault
from hostmot2.registers import Watchdog as WatchdogRegisters
from hostmot2.sserial import Channel, ChannelCounters, ChannelStatus

if TYPE_CHECKING:
    from hostmot2.board import Board

_TIMER, _STATUS = WatchdogRegisters.timer, WatchdogRegisters.status


class Rows:
    """Makes the rows. driving: whether this program has the card, so that remotes are known."""

    def __init__(self, board: Board, driving: bool) -> None:
        self._board = board
        self._driving = driving
        self._pads = self._pad_names()

    @staticmethod
    def has_sserial(board: Board) -> bool:
        """Whether the card's firmware has smart serial."""
        return module_of(board, Gtag.SSERIAL, Gtag.SSERIAL_B) is not None

    def _pad_names(self) -> list[str]:
        """The connector of each I/O port."""
        names: dict[int, str] = {}
        for pin in self._board.pins:
            names.setdefault(pin.port, pin.connector or f"port {pin.port}")
        return [names[port] for port in sorted(names)]

    def _channels(self) -> Iterator[tuple[int, Channel]]:
        if self.has_sserial(self._board):
            for port in self._board.sserial:
                for channel in port.channels:
                    yield port.number, channel

    def _described(self) -> Iterator[tuple[int, Channel]]:
        """The channels whose process data this program moves."""
        for port, channel in self._channels():
            if self._driving and channel.started and channel.description is not None:
                yield port, channel

    def channels(
        self, frame: Frame, counters: Mapping[tuple[int, int], ChannelCounters]
    ) -> tuple[ChannelRow, ...]:
        """A row per channel of the card."""
        rows = []
        bitten = self._driving and self._is_bitten()
        failed: dict[int, list[int]] = {}
        for port, channel in self._channels():
            if port not in failed:
                failed[port] = self._board.sserial[port].transfers["failed"] if self._driving else []
            lost = failed[port]
            number = channel.number
            rows.append(
                ChannelRow(
                    port=port,
                    channel=number,
                    name=channel.name if self._driving else "",
                    unit_number=channel.unit_number if self._driving else 0,
                    mode=_mode(channel) if self._driving and channel.started else "",
                    status=ChannelStatus(int(frame.inputs[f"sserial{port}.{number}.CS"])),
                    started=self._driving and channel.started,
                    counters=counters.get((port, number)),
                    failed=lost[number] if number < len(lost) else 0,
                    cut_off=bitten and channel.started,
                )
            )
        return tuple(rows)

    @staticmethod
    def encoders(frame: Frame) -> tuple[EncoderRow, ...]:
        """A row per encoder."""
        names = [name.removesuffix(".raw_count") for name in frame.inputs if name.endswith(".raw_count")]
        return tuple(
            EncoderRow(
                name,
                int(frame.inputs[f"{name}.raw_count"]),
                frame.inputs[f"{name}.position"],
                frame.inputs[f"{name}.velocity"],
            )
            for name in names
        )

    def values(self, frame: Frame) -> tuple[ValueRow, ...]:
        """A row per number of a remote: analog inputs and outputs, voltages, counters."""
        rows = []
        for label, elements, is_output in self._elements():
            for name in elements:
                field, scaling = elements.field(name), elements.scaling(name)
                if _width(elements[name]):
                    continue
                signal = f"sserial{label}.{name}"
                value = frame.sent[signal] if is_output else frame.inputs[signal]
                low, high = (scaling.low, scaling.high) if is_output else (field.minimum, field.maximum)
                unit = "" if field.unit == "none" else field.unit
                rows.append(ValueRow(f"{label} {name}", value, unit, low, high, is_output, signal))
        return tuple(rows)

    def bits(self, frame: Frame) -> tuple[BitsRow, ...]:
        """A row per word of bits: field inputs and outputs, enables, then the FPGA's pads."""
        rows = []
        for label, elements, is_output in self._elements():
            for name in elements:
                if width := _width(elements[name]):
                    signal = f"sserial{label}.{name}"
                    word = int(frame.sent[signal] if is_output else frame.inputs[signal])
                    rows.append(BitsRow(f"{label} {name}", word, width, is_output, signal))
        width = self._board.idrom.port_width
        for port, connector in enumerate(self._pads):
            for kind in ("pads", "driven"):
                word = int(frame.inputs[f"ioport{port}.{kind}"])
                rows.append(BitsRow(f"{connector} {kind}", word, width, False))
        return tuple(rows)

    def _elements(self) -> Iterator[tuple[str, Elements, bool]]:
        for port, channel in self._described():
            yield f"{port}.{channel.number}", channel.inputs, False
            yield f"{port}.{channel.number}", channel.outputs, True

    def _is_bitten(self) -> bool:
        return module_of(self._board, Gtag.WATCHDOG) is not None and self._board.watchdog.has_bitten

    def watchdog(self, frame: Frame) -> str:
        """In a few words."""
        if "watchdog.timer" not in frame.inputs:
            return "none"
        bitten = int(frame.inputs["watchdog.status"]) & _STATUS.has_bitten.mask
        timer = int(frame.inputs["watchdog.timer"])
        if self._driving:
            watchdog = self._board.watchdog
            if watchdog.has_bitten:
                return "BITTEN"
            return f"armed, {watchdog.timeout * 1e3:g} ms" if watchdog.armed else "off"
        if timer & _TIMER.stopped.mask:
            return "bitten, or never armed" if bitten else "not armed"
        left = timer / self._board.module(Gtag.WATCHDOG).clock
        return f"armed, {left * 1e3:.0f} ms left"

    def hints(self, frame: Frame) -> tuple[str, ...]:
        """What this monitor would need to show or drive more."""
        if not self.has_sserial(self._board):
            return ()
        if not self._driving:
            return (
                "Remotes' process data is not shown: whoever shows it must have started them. `hm2 monitor "
                "--start all` starts every remote that answers, all outputs off (not while another program "
                "drives the card).",
            )
        if self._is_bitten():
            return ("The watchdog has bitten: quit and start the monitor anew.",)
        stopped = [(f"{port}.{c.number}", c) for port, c in self._channels() if not c.started]
        silent = [label for label, channel in stopped if not channel.name]
        others = [f"{label} {channel.name}" for label, channel in stopped if channel.name]
        return tuple(
            f"{what} {', '.join(which)}."
            for what, which in (
                ("Its own watchdog has bitten, start the monitor anew:", self._cut_off(frame)),
                ("No remote answers on", silent),
                ("Not started:", others),
            )
            if which
        )

    def _cut_off(self, frame: Frame) -> list[str]:
        """The remotes whose own watchdogs have bitten."""
        labels = [f"{port}.{c.number}" for port, c in self._channels() if c.started]
        words = {label: int(frame.inputs[f"sserial{label}.CS"]) for label in labels}
        return [n for n in labels if RemoteFault.WATCHDOG in ChannelStatus(words[n]).remote_fault]


def _width(value: Value) -> int:
    """How many bits an element has that is shown as bits, 0 for a number."""
    return value.width if isinstance(value, Bits) else int(isinstance(value, bool))


def _mode(channel: Channel) -> str:
    """The software mode by number and name."""
    modes = channel.description.modes if channel.description else ()
    names = {mode.index: mode.name for mode in modes if not mode.hardware}
    return f"{channel.mode} {names.get(channel.mode, '')}".strip()
