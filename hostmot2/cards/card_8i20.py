"""8I20: a servo amplifier as a smart-serial remote. Source: fact sheet sserial 7.2 and the card's manual."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hostmot2.cards.remote_card import SingleRemoteCard
from hostmot2.drive_8i20 import FAULTS, STATUS

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.sserial import Fault, SserialPort


class Card8i20(SingleRemoteCard):
    """One 8I20. Current 0 after start(); every exchange must set the angle that fits the rotor.

    Starting enables the drive, at current 0. Values are those of the last exchange(). A fault of the drive
    takes the current back to 0, where it stays until it is set again.
    """

    name = remote_name = "8I20"

    def __init__(self, board: Board, port: SserialPort, channel: int) -> None:
        super().__init__(board, port, channel)
        port.on_faults.append(self._drop_current)

    def _drop_current(self, faults: tuple[Fault, ...]) -> None:
        """A new fault in its FAULT word, whoever moved the data."""
        if any(fault.word_rising for fault in faults if fault.channel in self.channel_numbers):
            self._drop(self.channel, "current")

    @property
    def angle(self) -> float:
        """Electrical angle in revolutions, 0 to 1; values outside are brought into it."""
        return float(self.channel.outputs["angle"])

    @angle.setter
    def angle(self, revolutions: float) -> None:
        if not math.isfinite(revolutions):
            raise ValueError(f"8I20: angle {revolutions}")
        self.channel.outputs["angle"] = revolutions % 1.0

    @property
    def current(self) -> float:
        """Commanded torque current in A.

        Limited to +-max_current when it is sent; reading gives what was set. Setting raises ValueError for
        what is no number, and for other than 0 CardFault while the drive has a fault or is not started.
        """
        return float(self.channel.outputs["current"])

    @current.setter
    def current(self, amperes: float) -> None:
        if not math.isfinite(amperes):
            raise ValueError(f"8I20: current {amperes}")
        if amperes:
            self.raise_for_faults()
        self.channel.outputs["current"] = amperes

    @property
    def max_current(self) -> float:
        """Full scale of `current` in A, as set in the drive."""
        return self.channel.outputs.field("current").maximum

    @property
    def bus_voltage(self) -> float:
        """Volts."""
        return float(self.channel.inputs["bus-voltage"])

    @property
    def card_temperature(self) -> float:
        """As the drive reports it; the manual gives 0.01 degC per count in one place and degC in another."""
        return float(self.channel.inputs["card-temp"])

    @property
    def status_word(self) -> int:
        """The drive's STATUS word."""
        return int(self.channel.inputs["status"])

    @property
    def fault_word(self) -> int:
        """The drive's FAULT word."""
        return int(self.channel.inputs["fault"])

    @property
    def status_bits(self) -> list[str]:
        """Names of the set STATUS bits."""
        return _names(self.status_word, STATUS)

    @property
    def fault_bits(self) -> list[str]:
        """Names of the set FAULT bits."""
        return _names(self.fault_word, FAULTS)

    def faults(self) -> list[str]:
        """Live faults in words: the drive's FAULT word, and the channel's if it does not run."""
        return self.fault_bits if self.started else super().faults()

    def clear_fault(self) -> None:
        """Stop and start the drive, which clears its faults if their cause is gone; the current is 0 after.

        Raises NoRemote and its like if a fault remains.
        """
        self.stop()
        self.start()

    def __repr__(self) -> str:
        if not self.started:
            return f"<8I20 channel {self.channel.number} stopped>"
        faults = ", ".join(self.fault_bits) or "no fault"
        volts = f"bus {self.bus_voltage:.1f} V"
        return f"<8I20 channel {self.channel.number} {self.current:+.2f} A, {volts}, {faults}>"


def _names(word: int, names: tuple[str, ...]) -> list[str]:
    return [
        (names[bit] if bit < len(names) and names[bit] else f"bit {bit}")
        for bit in range(16)
        if word >> bit & 1
    ]


find = Card8i20.find
