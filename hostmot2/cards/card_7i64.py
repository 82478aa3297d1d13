"""7I64: 24 inputs, 24 outputs, two analog inputs. Source: fact sheet sserial 7.3."""

from __future__ import annotations

from typing import cast

from hostmot2.cards.remote_card import SingleRemoteCard
from hostmot2.elements import Bits


class Card7i64(SingleRemoteCard):
    """One 7I64. Outputs off after start(). Values are those of the last exchange()."""

    name = remote_name = "7I64"

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


find = Card7i64.find
