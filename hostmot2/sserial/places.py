"""Which daughter card a channel's pins are laid out for, so that messages can name its terminals."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hostmot2.idrom import PinDescriptor
from hostmot2.registers import EncoderPin, Gtag, SserialPin
from hostmot2.wiring import WIRING, CardFacts, RemoteFacts

_SMART_SERIAL = re.compile(r"SS(\d)(RX|TX|TXEN)")
_MUX_INPUTS = {"A": EncoderPin.A, "B": EncoderPin.B, "I": EncoderPin.INDEX}
_SSERIAL = (Gtag.SSERIAL, Gtag.SSERIAL_B)
_MUX = (Gtag.MUXED_ENCODER, Gtag.MUXED_ENCODER_MIM)
_SELECT = (Gtag.MUXED_ENCODER_SELECT, Gtag.MUXED_ENCODER_MIM_SELECT)


@dataclass(frozen=True, slots=True)
class Place:
    """Where a channel's pins lead.

    connector: the FPGA card's, "" if that has no name. card, remote: what the bitfile is laid out for there,
    None if that is no card whose wiring is known.
    """

    connector: str
    card: CardFacts | None = None
    remote: RemoteFacts | None = None

    def __str__(self) -> str:
        if self.card is None or self.remote is None:
            return self.connector
        at = f" at {self.connector}" if self.connector else ""
        return f"{self.card.name.upper()} {self.remote.what}{at}"


def places(board_pins: Sequence[PinDescriptor], port_pins: Iterable[PinDescriptor]) -> dict[int, Place]:
    """The place of every channel that has a receiving pin."""
    found = {}
    for pin in port_pins:
        if not SserialPin.RX_0 <= pin.secondary_pin <= 0x0F:
            continue
        beside = [other for other in board_pins if other.port == pin.port]
        card, remote = _card_at(beside, pin)
        found[pin.secondary_pin - SserialPin.RX_0] = Place(pin.connector, card, remote)
    return found


def _card_at(beside: list[PinDescriptor], pin: PinDescriptor) -> tuple[CardFacts | None, RemoteFacts | None]:
    """The card whose host connector has the signals that these pins have, and its remote on `pin`."""
    for card in WIRING.values():
        signals = _host_signals(card)
        if not signals or not _is_laid_out_for(beside, signals):
            continue
        own = _SMART_SERIAL.fullmatch(signals[pin.bit]) if pin.bit < len(signals) else None
        for remote in card.remotes:
            if own and remote.host_channel == int(own[1]):
                return card, remote
    return None, None


def _host_signals(card: CardFacts) -> list[str]:
    """The signals of the connector to the FPGA card by I/O number; none if the card has another link."""
    for connector in card.connectors:
        numbered = {
            int(terminal.note.removeprefix("I/O ")): terminal.signal
            for terminal in connector.terminals
            if terminal.note.startswith("I/O ")
        }
        if numbered:
            return [numbered[number] for number in sorted(numbered)]
    return []


def _is_laid_out_for(pins: list[PinDescriptor], signals: list[str]) -> bool:
    by_bit = {pin.bit: pin for pin in pins}
    return len(by_bit) >= len(signals) and all(_fits(by_bit[bit], name) for bit, name in enumerate(signals))


def _fits(pin: PinDescriptor, signal: str) -> bool:
    """Whether a pin has the function that a signal needs; the channel's number is the bitfile's own."""
    serial = _SMART_SERIAL.fullmatch(signal)
    if serial and serial[2] == "TXEN":
        return True  # some bitfiles leave the enable of the third channel out
    if serial:
        return pin.secondary_gtag in _SSERIAL and pin.is_output == (serial[2] == "TX")
    if signal == "ENCMUX":
        return pin.secondary_gtag in _SELECT
    return pin.secondary_gtag in _MUX and pin.secondary_pin == _MUX_INPUTS[signal[len("QCMUX")]]
