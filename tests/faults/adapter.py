"""A remote behind a serial adapter, in virtual time, and the LBP client that asks it; what is asked of it."""

from __future__ import annotations

import gc
from typing import Any

from sserial.remotes import field_io, give_watchdog
from wire.lines import NoisyStream

from faults.operations import (
    Operation,
    ReadParameter,
    SaveParameter,
    Values,
    WriteParameter,
)
from faults.world import REMOTE_FAULT, Faults, heal
from hostmot2._core import lib
from hostmot2.lbp import LbpRemote, WireLink, parameters
from hostmot2.registers import LbpLocal, LbpSpace

REMOTE_WATCHDOG_MS = 50


class _Card:
    """What checks ask of the card: that time passes on the line."""

    def __init__(self, line: NoisyStream) -> None:
        self._line = line

    def advance(self, us: float) -> None:
        self._line.pause(us / 1e6)


class AdapterWorld:
    """A remote with its set-up jumper in place, on a line without noise. What faults.world.World has."""

    layer = "adapter"
    link = None
    lines: tuple[int, ...] = ()

    def __init__(self) -> None:
        remote = field_io()
        give_watchdog(remote, REMOTE_WATCHDOG_MS)
        assert lib.hm2_remote_set(remote.handle, lib.HM2_REMOTE_SETUP_MODE, 1) == lib.HM2_OK
        remote.power_cycle()
        self.remotes = (remote,)
        self.line = NoisyStream(remote, 0.0, seed=0)
        self.card = _Card(self.line)
        self.faults = Faults(
            lambda faults, count, _limit: lib.hm2_remote_set_faults(remote.handle, faults, count),
            lambda fired: lib.hm2_remote_answers(remote.handle, fired),
        )
        self.board: LbpRemote | None = None
        """The client: what is opened, used and closed."""
        self.allowed_outputs: list[set[bytes]] = [{bytes(2)}]
        self.truths: dict[str, list[Any]] = {}

    def open(self) -> LbpRemote:
        """The client, once it has found the remote."""
        self.board = LbpRemote(WireLink(self.line))
        return self.board

    def close(self) -> None:
        """Close the client if it is there."""
        client, self.board = self.board, None
        if client is not None:
            client.close()

    def settle(self) -> None:
        """No more faults, and the remote in good health."""
        self.faults.plan([])
        heal(self.remotes[0])

    def recover(self) -> None:
        """There is nothing to do: the client finds its remote again by itself."""

    def unplug(self) -> None:
        """The remote goes without power."""
        self.remotes[0].alive = False

    def fail(self) -> None:
        """The remote has a fault."""
        self.remotes[0].fault = REMOTE_FAULT

    def outputs(self) -> list[bytes]:
        """What the remote's outputs are now."""
        return [self.remotes[0].outputs]

    def driven(self) -> list[int]:
        """There are no pins."""
        return []

    @property
    def now_us(self) -> float:
        """The line's time."""
        return self.line.now_ns / 1e3

    def drop(self) -> None:
        """Let go of everything."""
        self.close()
        gc.collect(0)


class _Adapter(Operation):
    layers = ("adapter",)

    def connect(self, world: Any) -> None:
        """The client, and the parameters as their tables say."""
        if world.board is None:
            world.open()
        world.parameters = parameters(world.board)

    def parameters(self, world: Any) -> Any:
        """The parameters of the remote."""
        return world.parameters


class AdapterOpen(_Adapter):
    """Finding the remote on the line."""

    name = "adapter: open"

    def prepare(self, world: Any) -> None:
        world.close()
        world.truths = {"CRC": [True]}

    def run(self, world: Any) -> Values:
        return [("CRC", world.open().link.crc)]


class AdapterList(_Adapter):
    """Reading the tables: which parameters there are."""

    name = "adapter: parameter list"

    def prepare(self, world: Any) -> None:
        if world.board is None:
            world.open()
        world.truths = {"list": [_true_list()]}

    def run(self, world: Any) -> Values:
        return [("list", _fields(world))]


class AdapterRead(_Adapter, ReadParameter):
    """A parameter, read."""

    name = "adapter: parameter read"


class AdapterWrite(_Adapter, WriteParameter):
    """A parameter in the remote's RAM, written and read back."""

    name = "adapter: parameter write"


class AdapterSave(_Adapter, SaveParameter):
    """A parameter in the remote's EEPROM, compared, written and read back."""

    name = "adapter: EEPROM save"


class AdapterClose(_Adapter):
    """Closing while another memory space than RAM is selected."""

    name = "adapter: close"

    def prepare(self, world: Any) -> None:
        if world.board is None:
            world.open()
        world.board.write_local(LbpLocal.memory_space, LbpSpace.EEPROM)

    def run(self, world: Any) -> Values:
        world.close()
        return []


_known: list[Any] = []


def _fields(world: Any) -> list[Any]:
    found = parameters(world.board)
    return [found.parameter(name).field for name in found]


def _true_list() -> Any:
    if not _known:
        world = AdapterWorld()
        world.open()
        _known.append(_fields(world))
        world.drop()
    return _known[0]


ADAPTER_OPERATIONS: tuple[Operation, ...] = (
    AdapterOpen(),
    AdapterList(),
    AdapterRead(),
    AdapterWrite(),
    AdapterSave(),
    AdapterClose(),
)
