"""The operations of a board: how to get to where each begins, what it does, and what may come of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from reference_packer import write as pack_value

from faults.world import ANALOG, FIELD, World

EXCHANGES = 6
ENGINE_CYCLES = 12
COUNTS_PER_SECOND = 2000.0
RAM_PARAMETER, RAM_ADDRESS = "gain", 0x320
EEPROM_PARAMETER, EEPROM_ADDRESS = "NVWatchDogTimeout", 0x20
READ_PARAMETER, READ_ADDRESS, READ_VALUE = "fieldvoltage", 0x310, 0xA4C0
EEPROM = 1

Values = list[tuple[str, Any]]


class Wrong(AssertionError):
    """Something that the plain model says cannot be."""


class Operation(ABC):
    """One operation. `prepare` may be called on any board in order, `run` is what meets the faults."""

    name = ""
    layers: tuple[str, ...] = ("words", "datagrams", "answers")

    def prepare(self, world: World) -> None:
        """Bring the board to where the operation begins, from nothing or from a board in order."""
        if world.board is None:
            world.open()
            world.port.scan()

    @abstractmethod
    def run(self, world: World) -> Values:
        """The operation; what it says that was."""

    def judge(self, world: World, values: Values) -> None:
        """Whether each value was true at some time since the operation began. Raises Wrong."""
        for name, value in values:
            if not any(value == truth for truth in world.truths[name]):
                raise Wrong(f"{name} {value!r:.300} was never so: {world.truths[name]!r:.300}")

    def after(self, world: World, done: bool) -> None:
        """What must be so behind the operation whether it was `done` or failed. Raises Wrong."""
        return

    def at_once(self, world: World) -> None:
        """What must be so when it was done and what went wrong is over. Raises Wrong."""
        return

    def left(self, world: World) -> None:
        """What must be so as soon as an exception of the user's own has left it. Raises Wrong."""
        return


class Open(Operation):
    """Opening reads the whole description of the card."""

    name = "open"
    layers = ("words", "datagrams")

    def prepare(self, world: World) -> None:
        world.close()
        with World(world.layer).open() as board:
            world.truths = {"inventory": [board.inventory], "name": [board.name]}

    def run(self, world: World) -> Values:
        board = world.open()
        return [("inventory", board.inventory), ("name", board.name)]


class Discover(Operation):
    """Looking for remotes and reading their tables."""

    name = "discover"

    def prepare(self, world: World) -> None:
        if world.board is None:
            world.open()
        else:
            world.port.stop()
        world.truths = {"channel": _TRUE_ROWS}

    def run(self, world: World) -> Values:
        rows = world.port.scan()
        # a channel that the scan itself calls unusable says why; what it could not find out it does not say
        return [("channel", _row(row)) for row in rows if row.reason == "ok"]


class Start(Operation):
    """Bringing the 7I77 up."""

    name = "start"

    def prepare(self, world: World) -> None:
        super().prepare(world)
        world.port.stop()
        _ = world.seven
        world.truths = {}

    def run(self, world: World) -> Values:
        world.seven.start()
        return []

    def after(self, world: World, done: bool) -> None:
        started = world.port.started if world.board is not None else 0
        if done and started & 0b11 != 0b11:
            raise Wrong(f"start() returned with channels {started:#x} started")


class Remote(Operation):
    """What reads or writes a remote's memory."""

    address, space, size = 0, 0, 2

    def connect(self, world: World) -> None:
        """The way to the remote's memory."""
        super().prepare(world)
        world.port.stop()

    def prepare(self, world: World) -> None:
        self.connect(world)
        world.remotes[FIELD].poke(READ_ADDRESS, READ_VALUE.to_bytes(2, "little"))
        world.remotes[FIELD].poke(self.address, self.old(), space=self.space)

    def old(self) -> bytes:
        """What the cell holds before."""
        return bytes(self.size)

    def parameters(self, world: World) -> Any:
        """The parameters of the field I/O."""
        return world.port.channels[FIELD].parameters


class ReadParameter(Remote):
    """A parameter of a remote, read."""

    name = "parameter read"
    address = READ_ADDRESS

    def old(self) -> bytes:
        return READ_VALUE.to_bytes(2, "little")

    def run(self, world: World) -> Values:
        world.truths = {"parameter": [READ_VALUE]}
        return [("parameter", self.parameters(world)[READ_PARAMETER])]


class WriteParameter(Remote):
    """A parameter in a remote's RAM, written and read back."""

    name = "parameter write"
    address, size, parameter = RAM_ADDRESS, 4, RAM_PARAMETER
    value: float = 1.5
    raw = b"\0\0\xc0\x3f"

    def run(self, world: World) -> Values:
        self.parameters(world)[self.parameter] = self.value
        return []

    def after(self, world: World, done: bool) -> None:
        there = world.remotes[FIELD].peek(self.address, self.size, space=self.space)
        may = {self.raw} if done else {self.raw, self.old()}
        if there not in may:
            raise Wrong(f"the cell holds {there.hex()}, not {' or '.join(m.hex() for m in may)}")


class SaveParameter(WriteParameter):
    """A parameter in a remote's EEPROM, compared, written and read back."""

    name = "EEPROM save"
    address, size, space, parameter = EEPROM_ADDRESS, 2, EEPROM, EEPROM_PARAMETER
    value = 77
    raw = b"\x4d\0"

    def old(self) -> bytes:
        return b"\x32\0"

    def after(self, world: World, done: bool) -> None:
        super().after(world, done)
        rest = world.remotes[FIELD].peek(0, 256, space=EEPROM)
        if any(rest[: self.address]) or any(rest[self.address + 2 :]):
            raise Wrong("another EEPROM cell was written")


class Running(Operation):
    """What needs the card at work."""

    def prepare(self, world: World) -> None:
        super().prepare(world)
        card = world.seven
        if not card.started or card.faults():
            world.port.stop()
            card.start()
        world.truths = {}
        self.show(world, 0)
        _ = card.encoders  # so that they take part in the exchange, from which they count
        card.exchange()
        self.zero = _counts(world) - card.encoders[0].count

    def show(self, world: World, number: int) -> int:
        """The field inputs of this moment."""
        pattern = (0x01010101 * (number + 1)) & 0xFFFFFFFF
        world.remotes[FIELD].inputs = pattern.to_bytes(4, "little")
        world.truths.setdefault("inputs", []).append(pattern)
        return pattern

    def command(self, world: World, number: int) -> None:
        """Outputs of this moment, and that they are asked for."""
        card = world.seven
        card.field_io_channel.outputs["output"] = number
        card.analog[0].volts = 0.5 * number
        if number == 1:
            card.analog_enable = True
        raw = pack_value("SIGNED", 13, 0.5 * number, 10.0, -10.0, 10.0)
        enabled = 1 << 78
        world.allowed_outputs[FIELD].add(number.to_bytes(2, "little"))
        for enable in (0, enabled):
            world.allowed_outputs[ANALOG].add((raw | enable).to_bytes(10, "little"))

    def seen(self, world: World, failed: int) -> Values:
        """What the card says of its inputs."""
        card = world.seven
        if failed >> FIELD & 1:
            return []
        return [("inputs", int(card.inputs)), ("count", (card.encoders[0].count, _counts(world)))]

    def judge(self, world: World, values: Values) -> None:
        counts = [value for name, value in values if name == "count"]
        super().judge(world, [value for value in values if value[0] != "count"])
        for count, true in counts:
            if not self.first - 1 <= count + self.zero <= true + 1:
                raise Wrong(f"encoder count {count + self.zero}, the shaft went from {self.first} to {true}")


class Cycle(Running):
    """Exchanges in a loop of the user's."""

    name = "cycle"
    layers = (*Operation.layers, "code")

    def run(self, world: World) -> Values:
        card = world.seven
        self.first = _counts(world)
        values: Values = []
        for number in range(1, EXCHANGES + 1):
            self.show(world, number)
            self.command(world, number)
            world.statements.reach()
            values += self.seen(world, card.exchange().failed)
            world.statements.reach()
            world.card.advance(200.0)
        return values


class EngineCycle(Running):
    """Cycles of the engine, from its start to its stop."""

    name = "engine"
    layers = (*Operation.layers, "code")

    def run(self, world: World) -> Values:
        assert world.board is not None
        self.first = _counts(world)
        values: Values = []
        with world.board.engine(1000.0) as engine:
            for number in range(1, ENGINE_CYCLES + 1):
                self.show(world, number)
                self.command(world, number)
                engine.write()
                world.statements.reach()
                frame = engine.step()
                world.statements.reach()
                if not frame.status.stale and not frame.status.off:
                    values += self.seen(world, 0)
        return values

    def left(self, world: World) -> None:
        _all_off(world)


class WithBlocks(Running):
    """A whole program: a board and an engine, each in its with block."""

    name = "with blocks"
    layers = ("code",)

    def prepare(self, world: World) -> None:
        world.close()
        world.truths = {}

    def run(self, world: World) -> Values:
        reach = world.statements.reach
        with world.open() as board:
            reach()
            card = world.seven
            reach()
            card.start()
            for number in range(1, EXCHANGES + 1):
                self.show(world, number)
                self.command(world, number)
                reach()
                card.exchange()
                reach()
            with board.engine(1000.0) as engine:
                for number in range(1, EXCHANGES + 1):
                    self.command(world, number)
                    engine.write()
                    reach()
                    engine.step()
            reach()
        return []

    def left(self, world: World) -> None:
        if world.board is not None and not world.board.closed:
            raise Wrong("the with block has been left, and the board is open")
        world.card.advance(1.0)  # the watchdog lets go of pins within a few clocks
        _all_off(world)
        if any(world.driven()):
            raise Wrong(f"the with block has been left, and pins are driven: {world.driven()}")


class Stop(Running):
    """Stopping the card while it drives something."""

    name = "stop"

    def prepare(self, world: World) -> None:
        super().prepare(world)
        card = world.seven
        for number in (1, 2):
            self.command(world, number)
            card.exchange()

    def run(self, world: World) -> Values:
        world.seven.stop()
        return []

    def at_once(self, world: World) -> None:
        _all_off(world)


class Close(Stop):
    """Closing the board while it drives something."""

    name = "close"

    def run(self, world: World) -> Values:
        world.close()
        return []


def _all_off(world: World) -> None:
    if any(any(outputs) for outputs in world.outputs()):
        raise Wrong(f"stopped, and outputs are {[outputs.hex() for outputs in world.outputs()]}")


def _counts(world: World) -> int:
    world.card.sync()
    return world.encoder.position


def _row(row: Any) -> tuple[Any, ...]:
    description = row.description
    assert description is not None
    return (
        row.channel,
        row.name,
        row.unit_number,
        tuple(description.fields),
        tuple(description.parameters),
        description.layout.fields,
    )


def _true_rows() -> list[tuple[Any, ...]]:
    world = World()
    world.open()
    rows = [_row(row) for row in world.port.scan() if row.reason == "ok"]
    world.drop()
    return rows


_TRUE_ROWS = _true_rows()

CARD_OPERATIONS: tuple[Operation, ...] = (
    Open(),
    Discover(),
    Start(),
    ReadParameter(),
    WriteParameter(),
    SaveParameter(),
    Cycle(),
    EngineCycle(),
    WithBlocks(),
    Stop(),
    Close(),
)
