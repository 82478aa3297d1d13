"""7I77: six analog axes, 48 field I/O, six encoders.

Source: fact sheet sserial 8.1, 8.2 and 9, and the card's manual.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

from hostmot2 import errors
from hostmot2.cards.remote_card import RemoteCard, identified
from hostmot2.elements import Bits
from hostmot2.registers import Gtag

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.sserial import Channel, Fault, SserialPort

FIELD_IO, ANALOG = 0x12, 0x11
"""Device codes: the top byte of the unit number tells the two remotes of a 7I77 apart."""

REMOTE_NAME = "7I77"
AXES = 6
FULL_SCALE_VOLTS = 10.0
ANALOG_INPUTS = 4
MODES = range(4)
"""0: I/O; 1: and analog inputs; 2: and field voltage; 3: and two MPG counters on inputs 16 to 19."""


class AnalogOutput:
    """One axis' analog output."""

    def __init__(self, card: Card7i77, index: int) -> None:
        self._card, self.index = card, index

    @property
    def volts(self) -> float:
        """The commanded output, -10 to 10 V. Drives only while enabled.

        Values outside are limited when they are sent; reading gives what was set.
        """
        return float(self._card.analog_channel.outputs[f"analogout{self.index}"])

    @volts.setter
    def volts(self, volts: float) -> None:
        self._card.analog_channel.outputs[f"analogout{self.index}"] = volts

    def __repr__(self) -> str:
        return f"<analog output {self.index} {self.volts:+.3f} V>"


class Card7i77(RemoteCard):
    """One 7I77. Everything is off after start(): volts 0, enables off, outputs off.

    `mode` is the software mode of the field I/O for the next start, 0 to 3. Values are those of the last
    exchange(); what is set is sent by the next one. Enables go off with every fault of the card and must be
    set again.
    """

    name = "7I77"
    output_type = "sourcing"
    """Whether field outputs supply field power or switch to field ground."""

    def __init__(self, board: Board, port: SserialPort, field_io: int, analog: int) -> None:
        super().__init__(board, port, (field_io, analog))
        self._field_io, self._analog = field_io, analog
        self.analog = tuple(AnalogOutput(self, n) for n in range(AXES))
        port.on_faults.append(self._drop_enables)

    @property
    def field_io_channel(self) -> Channel:
        """The smart-serial channel of the field I/O."""
        return self.port.channels[self._field_io]

    @property
    def analog_channel(self) -> Channel:
        """The smart-serial channel of the analog outputs."""
        return self.port.channels[self._analog]

    @property
    def outputs(self) -> Bits:
        """The 16 field outputs, `outputs[3] = True`; 0 to 7 are TB8, 8 to 15 TB7."""
        return cast(Bits, self.field_io_channel.outputs["output"])

    @property
    def inputs(self) -> Bits:
        """The 32 field inputs, `inputs[31]`; 0 to 15 are TB8, 16 to 31 TB7."""
        return cast(Bits, self.field_io_channel.inputs["input"])

    @property
    def mode(self) -> int:
        """Software mode of the field I/O for the next start: 0 to 3, see MODES."""
        return self.field_io_channel.mode

    @mode.setter
    def mode(self, mode: int) -> None:
        if mode not in MODES:
            raise ValueError(f"7I77 software mode {mode} is outside 0..{MODES[-1]}")
        self.field_io_channel.mode = mode

    @property
    def analog_enable(self) -> bool:
        """Drives 0 to 4 enabled. Setting it raises CardFault while the card has a fault or is not started."""
        return bool(self.analog_channel.outputs["analogena"])

    @analog_enable.setter
    def analog_enable(self, on: bool) -> None:
        self._enable("analogena", on)

    @property
    def spindle_enable(self) -> bool:
        """Drive 5 enabled. Setting it raises CardFault while the card has a fault or is not started."""
        return bool(self.analog_channel.outputs["spinena"])

    @spindle_enable.setter
    def spindle_enable(self, on: bool) -> None:
        self._enable("spinena", on)

    def _enable(self, element: str, on: bool) -> None:
        if on:
            self.raise_for_faults()
            self.board.cycle.arm_watchdog()
        self.analog_channel.outputs[element] = on

    def _drop_enables(self, faults: tuple[Fault, ...]) -> None:
        """A new fault of this card drops both enables, whoever moved the data; they stay off."""
        if any(fault.channel in self.channel_numbers for fault in faults):
            self._drop(self.analog_channel, "analogena", "spinena")

    def _field(self, element: str, needed: str) -> Any:
        inputs = self.field_io_channel.inputs
        if element not in inputs:
            raise errors.ModuleMissing(
                f"7I77 in software mode {self.mode} reports no {element}; {needed} does"
            )
        return inputs[element]

    @property
    def analog_inputs(self) -> tuple[float, ...]:
        """Volts on the four analog inputs, modes 1 to 3. Raises ModuleMissing in mode 0."""
        return tuple(float(self._field(f"analogin{n}", "mode 1")) for n in range(ANALOG_INPUTS))

    @property
    def field_voltage(self) -> float:
        """Volts of the field supply, modes 2 and 3. Raises ModuleMissing in modes 0 and 1."""
        return float(self._field("fieldvoltage", "mode 2"))

    @property
    def mpg(self) -> tuple[int, int]:
        """Counts of the two MPG counters on inputs 16 to 19, mode 3. Raises ModuleMissing in other modes."""
        self._field("enc1", "mode 3")
        inputs = self.field_io_channel.inputs
        return inputs.raw("enc0"), inputs.raw("enc1")

    @property
    def encoders(self) -> Sequence[Any]:
        """The card's six encoders (TB3: 0 to 2, TB4: 3 to 5)."""
        first = _first_encoder(self.board, self.analog_channel.number, self.port)
        encoders: Sequence[Any] = self.board.encoders[first : first + AXES]
        return encoders

    def __repr__(self) -> str:
        volts = " ".join(f"{output.volts:+.2f}" for output in self.analog) if self.started else "-"
        state = "running" if self.started else "stopped"
        return f"<7I77 channels {self._field_io}, {self._analog} {state}, volts {volts}>"


def _connector(board: Board, port: SserialPort, channel: int) -> int:
    """The IOPort whose pins lead to a channel."""
    for pin in port.pins:
        if (pin.secondary_pin & 0x0F) - 1 == channel:
            return pin.port
    raise errors.ModuleMissing(f"{board.name}: no pin leads to smart serial channel {channel}")


def _first_encoder(board: Board, channel: int, port: SserialPort) -> int:
    """The first encoder on the same connector as a channel: a multiplexed unit carries two."""
    connector = _connector(board, port, channel)
    units = [
        pin.secondary_unit
        for pin in board.pins
        if pin.port == connector and pin.secondary_gtag == Gtag.MUXED_ENCODER
    ]
    if not units:
        raise errors.ModuleMissing(
            f"{board.name}: this firmware has no encoders for the 7I77 of channel {channel}"
        )
    return 2 * min(units)


class Card7i77d(Card7i77):
    """One 7I77D: its field outputs switch to field ground. Over the wire it is a 7I77."""

    name = "7I77D"
    output_type = "sinking"


def find(board: Board, cls: type[Card7i77] = Card7i77) -> list[Card7i77]:
    """All 7I77 of a board: pairs of remotes on one connector, told apart by unit number, not by position."""
    cards = []
    for port in board.sserial:
        codes = {c.number: c.unit_number >> 24 for c in identified(port) if c.name == REMOTE_NAME}
        for number, code in sorted(codes.items()):
            if code != FIELD_IO:
                continue
            connector = _connector(board, port, number)
            partners = [
                n for n, c in sorted(codes.items()) if c == ANALOG and _connector(board, port, n) == connector
            ]
            if partners:
                cards.append(cls(board, port, number, partners[0]))
    return cards


def find_7i77d(board: Board) -> list[Card7i77]:
    """All cards of a board, taken for 7I77D because you say so."""
    return find(board, Card7i77d)
