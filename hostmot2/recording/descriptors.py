"""The process data of a card's remotes as an attachment, so that raw words can be decoded later."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import msgspec
import numpy as np
import numpy.typing as npt

from hostmot2.bulk import Columns
from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.layout import Element, Layout
from hostmot2.process_data import ProcessData
from hostmot2.recording.errors import BrokenRecording
from hostmot2.recording.format import decoded
from hostmot2.registers import Gtag, Sserial

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.sserial import SserialPort

WORDS = 7  # interface registers of a channel, at most
CHANNELS = 8  # of a port, at most


class Words(Protocol):
    """Recorded registers."""

    count: int
    """Of records."""
    failed: npt.NDArray[np.bool_]
    """In which an exchange did not come back."""

    def word(self, address: int, written: bool) -> npt.NDArray[np.uint32] | None:
        """A register's words, None if it was not recorded."""

    def fresh(self, address: int, written: bool) -> npt.NDArray[np.bool_]:
        """In which records it was moved."""


class ElementText(msgspec.Struct):
    """A field of a channel's process data, with the scaling that was in use. Limits null: not limited."""

    name: str
    kind: int
    bits: int
    direction: int
    minimum: float | None
    maximum: float | None
    unit: str
    input_scale: float | None = None
    output_scale: float | None = None
    output_low: float | None = None
    output_high: float | None = None
    input_invert: int = 0
    output_invert: int = 0


class ChannelText(msgspec.Struct):
    """A channel: who is on it and where its registers are."""

    channel: int
    name: str
    unit_number: int
    mode: int
    receive_size: int  # bytes of an exchange, with the fault byte; 0: not known
    transmit_size: int
    status_register: int
    registers: list[int]
    fields: list[ElementText]


class PortText(msgspec.Struct):
    """A smart-serial port."""

    port: int
    command_register: int
    data_register: int
    started: int
    channels: list[ChannelText]


class DescriptorsText(msgspec.Struct):
    """The attachment."""

    board: str
    url: str
    ports: list[PortText]


def describe(board: Board) -> bytes:
    """The attachment for a board whose ports have been started. Reads nothing from the card."""
    ports = _ports(board) if any(m.gtag in _SSERIAL for m in board.modules) else []
    return msgspec.json.encode(DescriptorsText(board.idrom.board_name, board.url, ports))


_SSERIAL = (Gtag.SSERIAL, Gtag.SSERIAL_B)


def _ports(board: Board) -> list[PortText]:
    return [_port(board, port) for port in board.sserial]


def _port(board: Board, port: SserialPort) -> PortText:
    def address(register: int, channel: int = 0) -> int:
        return port.register_address(register, channel)

    data = port.process_data
    channels = []
    for number, layout in data.layouts.items():
        channel = port.channels[number]
        channels.append(
            ChannelText(
                channel=number,
                name=channel.name,
                unit_number=channel.unit_number,
                mode=channel.mode,
                receive_size=channel.description.receive_size if channel.description else 0,
                transmit_size=channel.description.transmit_size if channel.description else 0,
                status_register=address(Sserial.cs.number, number),
                registers=[address(Sserial.user0.number + k, number) for k in range(port.data_registers)],
                fields=[_field(field, data, number) for field in layout.fields],
            )
        )
    command, result = address(Sserial.command.number), address(Sserial.data.number)
    return PortText(port.number, command, result, port.started, channels)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _field(field: Field, data: ProcessData, channel: int) -> ElementText:
    text = ElementText(
        field.name,
        int(field.kind),
        field.bits,
        int(field.direction),
        _finite(field.minimum),
        _finite(field.maximum),
        field.unit,
    )
    if field.kind is FieldKind.PAD:
        return text
    if field.name in data.inputs[channel] and field.direction is not Direction.OUTPUT:
        scaling = data.inputs[channel].scaling(field.name)
        text.input_scale, text.input_invert = _finite(scaling.scale), scaling.invert
    if field.name in data.outputs[channel] and field.direction is not Direction.INPUT:
        scaling = data.outputs[channel].scaling(field.name)
        text.output_scale, text.output_invert = _finite(scaling.scale), scaling.invert
        text.output_low, text.output_high = _finite(scaling.low), _finite(scaling.high)
    return text


@dataclass(frozen=True)
class Descriptors:
    """The attachment, read back."""

    text: DescriptorsText

    @classmethod
    def parse(cls, data: bytes) -> Descriptors:
        """Raises BrokenRecording for what `describe` would not have written."""
        text = decoded(data, DescriptorsText, "the attached descriptors")
        try:
            for port in text.ports:
                for channel in port.channels:
                    _check(channel)
        except ValueError as problem:
            raise BrokenRecording(f"the attached descriptors cannot be read: {problem}") from problem
        return cls(text)

    def columns(self, source: Words, direction: Direction) -> Columns:
        """Every element of one direction whose registers were recorded; keys as `Recording` has them."""
        result: Columns = {}
        for port in self.text.ports:
            for channel in port.channels:
                found = _decode(port, channel, source, direction)
                result |= {f"{key_prefix(port, channel)}{name}": each for name, each in found.items()}
        return result

    def units(self, direction: Direction) -> Mapping[str, str]:
        """Key -> unit of every element."""
        return {
            f"{key_prefix(port, channel)}{field.name}": field.unit
            for port in self.text.ports
            for channel in port.channels
            for field in channel.fields
            if field.direction in (direction, Direction.BIDIRECTIONAL) and field.kind != FieldKind.PAD
        }


def key_prefix(port: PortText, channel: ChannelText) -> str:
    """What the key of a channel's element begins with."""
    return f"sserial{port.port}.{channel.channel}."


def fields_of(channel: ChannelText) -> list[Field]:
    """The fields, as discovery found them."""
    return [
        Field(f.name, FieldKind(f.kind), f.bits, Direction(f.direction), *_limits(f), f.unit)
        for f in channel.fields
    ]


def _limits(text: ElementText) -> tuple[float, float]:
    """JSON has no infinity."""
    return (
        -math.inf if text.minimum is None else text.minimum,
        math.inf if text.maximum is None else text.maximum,
    )


def _check(channel: ChannelText) -> None:
    layout = Layout(fields_of(channel))
    if layout.words > WORDS or not len(channel.registers) <= WORDS:
        raise ValueError(f"channel {channel.channel} has more than {WORDS} registers")
    addresses = (channel.status_register, *channel.registers)
    if channel.channel not in range(CHANNELS) or not all(0 <= at < 0x10000 for at in addresses):
        raise ValueError(f"channel {channel.channel} at registers {addresses}")
    widths: dict[str, int] = {}  # elements are found by their names, in any capitals
    for field in channel.fields:
        if not all(0 <= mask < 1 << field.bits for mask in (field.input_invert, field.output_invert)):
            raise ValueError(f"{field.name} has {field.bits} bits, its inversion does not fit")
        if widths.setdefault(field.name.casefold(), field.bits) != field.bits:
            raise ValueError(f"two elements are called {field.name}")


def _decode(port: PortText, channel: ChannelText, source: Words, direction: Direction) -> Columns:
    layout = Layout(fields_of(channel))
    written = direction is Direction.OUTPUT
    found = [source.word(address, written) for address in channel.registers]
    taken = None if written else _taken(port, channel, source)
    data = ProcessData({0: layout}, words=WORDS)
    elements: Any = data.inputs[0] if direction is Direction.INPUT else data.outputs[0]
    for text in channel.fields:
        _configure(text, elements, direction)
    words = np.zeros((source.count, 1, WORDS), np.uint32)
    for index, column in enumerate(found):
        if column is not None:
            words[:, 0, index] = column if taken is None else _held(column, taken)
    decoded = data.decode(words, direction)
    there = {index for index, column in enumerate(found) if column is not None}
    wanted = [e for e in layout.elements if e.direction is direction and e.name in decoded]
    return {element.name: decoded[element.name] for element in wanted if _registers(element) <= there}


def _taken(port: PortText, channel: ChannelText, source: Words) -> npt.NDArray[np.bool_]:
    """In which cycles the driver took the channel's inputs over: read, DOIT over, the transfer good."""
    taken = (
        source.fresh(channel.registers[0], False) if channel.registers else np.ones(source.count, np.bool_)
    )
    command, failed = source.word(port.command_register, False), source.word(port.data_register, False)
    if command is not None:
        taken = taken & (command == 0)
    if failed is not None:
        taken = taken & (failed >> np.uint32(channel.channel) & 1 == 0)
    return taken if command is None else taken & ~_doubtful(port, source, command)


def _doubtful(port: PortText, source: Words, command: npt.NDArray[np.uint32]) -> npt.NDArray[np.bool_]:
    """Results that the driver takes for none: the first behind a DOIT that got lost while no other was on its
    way. It may be the one before, taken already.
    """
    looked, launched = (source.fresh(port.command_register, written) for written in (False, True))
    ended = looked & (command == 0)
    found = np.zeros(source.count, np.bool_)
    last = np.maximum.accumulate(np.where(ended | (launched & ~looked), np.arange(source.count), -1))
    flying = (last >= 0) & launched[last]  # behind each record
    before = np.concatenate((np.zeros(1, np.bool_), flying[:-1]))
    lost = np.flatnonzero(source.failed & ~launched & (ended | ~before))
    order = np.flatnonzero(ended)
    at = np.searchsorted(order, lost, side="right")
    found[order[at[at < len(order)]]] = True
    return found


def _held(column: npt.NDArray[np.uint32], taken: npt.NDArray[np.bool_]) -> npt.NDArray[np.uint32]:
    """The last word taken over, 0 before the first."""
    last = np.maximum.accumulate(np.where(taken, np.arange(len(column)), -1))
    return np.where(last >= 0, column[last], np.uint32(0)).astype(np.uint32)


def _configure(text: ElementText, elements: Any, direction: Direction) -> None:
    if text.name not in elements:
        return
    scale = text.input_scale if direction is Direction.INPUT else text.output_scale
    invert = text.input_invert if direction is Direction.INPUT else text.output_invert
    if scale is not None:
        elements.configure(text.name, scale=scale, low=-math.inf, high=math.inf, invert=invert)


def _registers(element: Element) -> set[int]:
    return set(range(element.offset // 32, (element.offset + element.field.bits - 1) // 32 + 1))
