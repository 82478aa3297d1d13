"""What daughter cards with smart-serial remotes have in common."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Self

from hostmot2.cards.errors import CardFault

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.sserial import Channel, SserialPort


class RemoteCard:
    """A card made of one or more remotes of one port.

    start() brings its channels up with all outputs zero and arms the watchdog; exchange() moves all data of
    the board once; stop() and closing the board turn its outputs off.
    """

    name = ""

    def __init__(self, board: Board, port: SserialPort, channels: Sequence[int]) -> None:
        self.board = board
        self.port = port
        self.channel_numbers = tuple(channels)
        self.mask = sum(1 << number for number in channels)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The smart-serial channels of this card."""
        return tuple(self.port.channels[number] for number in self.channel_numbers)

    @property
    def started(self) -> bool:
        """Whether all channels of the card move process data."""
        return self.port.mode == "normal" and self.port.started & self.mask == self.mask

    def start(self) -> None:
        """Start the card's channels, outputs zero, and arm the watchdog. Raises NoRemote and its like.

        Channels that run already are left running, with their outputs zero from the next exchange on.
        """
        self.port.start(self.mask).raise_for_failed()
        for channel in self.channels:
            if channel.description is not None:
                channel.outputs.off()
        self.board.cycle.arm_watchdog()

    def stop(self) -> None:
        """Outputs zero, channels stopped."""
        self.port.stop(self.mask)

    def exchange(self) -> Any:
        """One exchange of everything on the board: encoders, I/O, watchdog, then all started remotes.

        Returns the DoitResult: `failed` is the mask of channels whose inputs are those of before. Raises
        WatchdogBite, TransportError, NotStarted.
        """
        self.board.cycle.run()
        return self.port.doit()

    def faults(self) -> list[str]:
        """The live faults of the card's channels in words, empty if none."""
        return [f"channel {c.number}: {text}" for c in self.channels for text in c.status.live]

    def _drop(self, channel: Channel, *elements: str) -> None:
        """Outputs to 0, as far as the remote that is there has them: it may have been exchanged."""
        if channel.description is None:
            return
        outputs = channel.outputs
        for element in elements:
            if element in outputs:
                outputs[element] = 0

    def raise_for_faults(self) -> None:
        """Raise CardFault if the card is not started or one of its channels reports a fault."""
        if not self.started:
            raise CardFault(f"{self.name}: not started, nothing can be switched on; call start() first")
        faults = self.faults()
        if faults:
            raise CardFault(f"{self.name}: not switched on: {'; '.join(faults)}")


class SingleRemoteCard(RemoteCard):
    """A card that is one remote."""

    remote_name = ""
    """What the remote calls itself."""

    def __init__(self, board: Board, port: SserialPort, channel: int) -> None:
        super().__init__(board, port, (channel,))

    @property
    def channel(self) -> Channel:
        """The smart-serial channel of the card."""
        return self.channels[0]

    @classmethod
    def find(cls, board: Board) -> list[Self]:
        """All cards of this kind on a board."""
        return [
            cls(board, port, channel.number)
            for port in board.sserial
            for channel in identified(port)
            if channel.name == cls.remote_name
        ]


def identified(port: SserialPort) -> Iterator[Channel]:
    """The channels on which a remote has answered; looks for remotes first if that disturbs nothing."""
    for channel in port.channels:
        port.look_if_stopped(channel.number)
        if channel.name:
            yield channel
