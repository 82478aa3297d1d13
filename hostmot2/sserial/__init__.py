"""Smart serial: ports of the card, channels of a port, remotes at their ends."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, overload

from hostmot2.errors import ModuleMissing
from hostmot2.registers import Gtag
from hostmot2.remotes.discovery import Mode, RemoteDescription
from hostmot2.remotes.parameters import Parameter, Parameters
from hostmot2.sserial.channel import Channel
from hostmot2.sserial.counters import ChannelCounters
from hostmot2.sserial.errors import (
    BrokenTable,
    CommandHung,
    NoFirmware,
    NoRemote,
    NotDiscovered,
    NotStarted,
    PortRunning,
    RemoteSilent,
    SetupJumper,
    UnsupportedRemote,
    VerifyFailed,
)
from hostmot2.sserial.evidence import ChannelEvidence
from hostmot2.sserial.port import SserialPort
from hostmot2.sserial.results import DoitResult, Scan, StartResult
from hostmot2.sserial.status import ChannelStatus, Fault, FaultWatcher

if TYPE_CHECKING:
    from hostmot2.board import Board

__all__ = [
    "BrokenTable",
    "Channel",
    "ChannelCounters",
    "ChannelEvidence",
    "ChannelStatus",
    "CommandHung",
    "DoitResult",
    "Fault",
    "FaultWatcher",
    "Mode",
    "NoFirmware",
    "NoRemote",
    "NotDiscovered",
    "NotStarted",
    "Parameter",
    "Parameters",
    "PortRunning",
    "RemoteDescription",
    "RemoteSilent",
    "Scan",
    "SetupJumper",
    "SserialPort",
    "SserialPorts",
    "StartResult",
    "UnsupportedRemote",
    "VerifyFailed",
]


class SserialPorts(SserialPort):
    """Port 0, and at the same time the sequence of all ports: `sserial.start(1)` is `sserial[0].start(1)`.

    Raises ModuleMissing if the card's firmware has no smart serial.
    """

    def __init__(self, board: Board) -> None:
        modules = [m for m in board.modules if m.gtag in (Gtag.SSERIAL, Gtag.SSERIAL_B)]
        places = [(module, instance) for module in modules for instance in range(module.instances)]
        if not places:
            raise ModuleMissing(f"{board.name}: the firmware has no smart serial")
        super().__init__(board, *places[0], 0)
        others = (SserialPort(board, *place, n) for n, place in enumerate(places[1:], 1))
        self._ports: tuple[SserialPort, ...] = (self, *others)

    def __len__(self) -> int:
        return len(self._ports)

    def __bool__(self) -> bool:
        return True

    @overload
    def __getitem__(self, index: int) -> SserialPort: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[SserialPort, ...]: ...

    def __getitem__(self, index: int | slice) -> SserialPort | tuple[SserialPort, ...]:
        return self._ports[index]

    def __iter__(self) -> Iterator[SserialPort]:
        return iter(self._ports)

    def __repr__(self) -> str:
        first = super().__repr__()
        return "\n".join([first, *(repr(port) for port in self._ports[1:])])
