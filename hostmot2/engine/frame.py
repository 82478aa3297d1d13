"""The readings of one cycle."""

from __future__ import annotations

from hostmot2.engine.facts import EngineStatus, Off
from hostmot2.engine.signals import Commands, Readings


class Frame:
    """The readings of one cycle, all of the same moment.

    `frame["encoder0.position"]`, or `frame.inputs.array`; the end of a name will do where it is unique.
    `outputs` is the engine's: what is set there goes out with the next write.
    """

    __slots__ = ("inputs", "outputs", "sent", "status")

    def __init__(self, status: EngineStatus, inputs: Readings, sent: Readings, outputs: Commands) -> None:
        self.status = status
        self.inputs = inputs
        self.sent = sent
        """What that cycle left to be sent, controllers included; zero while outputs are off.

        It goes out in the same cycle in read-modify-write style, pipelined with the next cycle's request.
        """
        self.outputs = outputs

    @property
    def cycle(self) -> int:
        """Number of the cycle, from 0."""
        return self.status.cycles - 1

    @property
    def off(self) -> Off:
        """Why outputs are off; 0: they are on."""
        return self.status.off

    def __getitem__(self, name: str) -> float:
        return self.inputs[name]

    def __repr__(self) -> str:
        return f"<Frame of cycle {self.cycle}, outputs {self.off.name or 'on' if self.off else 'on'}>"
