"""7I64: 24 inputs, 24 outputs, two analog inputs. Source: fact sheet sserial 7.3."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from hostmot2.cards.remote_card import RemoteCard, identified
from hostmot2.elements import Bits

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.sserial import Channel, SserialPort

REMOTE_NAME = "7I64"


class Card7i64(RemoteCard):
    """One 7I64. Outputs off after start(). Values are those of the last exchange()."""

    name = "7I64"

    def __init__(self, board: Board, port: SserialPort, channel: int) -> None:
        super().__init__(board, port, (channel,))

    @property
    def channel(self) -> Channel:
        """The smart-serial channel of the card."""
        return self.channels[0]

    @property
    def outputs(self) -> Bits:
        """The 24 outputs, `outputs[3] = True`."""
        return cast(Bits, self.channel.outputs["output"])

    @property
    def inputs(self) -> Bits:
        """The 24 inputs, `inputs[3]`."""
        return cast(Bits, self.channel.inputs["input"])

    @property
    def analog_inputs(self) -> tuple[float, float]:
        """Volts on the two analog inputs, 0 to 3.3."""
        inputs = self.channel.inputs
        return float(inputs["analog0"]), float(inputs["analog1"])

    def __repr__(self) -> str:
        return f"<7I64 channel {self.channel.number} {'running' if self.started else 'stopped'}>"


def find(board: Board) -> list[Card7i64]:
    """All 7I64 of a board."""
    return [
        Card7i64(board, port, channel.number)
        for port in board.sserial
        for channel in identified(port)
        if channel.name == REMOTE_NAME
    ]
