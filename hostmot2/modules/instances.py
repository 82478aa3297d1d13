"""What the drivers of a module's instances share: addresses, pins, and words of the board's cycle."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar, overload

from hostmot2._core import ffi, lib
from hostmot2.cycle import Order
from hostmot2.idrom import ModuleDescriptor, PinDescriptor
from hostmot2.register_map import Register

if TYPE_CHECKING:
    from hostmot2.board import Board

Instance = TypeVar("Instance")


def whole(value: float) -> int:
    """The nearest int; -1, which no register takes, for what is below 0, infinite or no number."""
    return round(value) if 0 <= value < math.inf else -1


def number(value: float) -> float:
    """`value` as a float. TypeError for what is none: refused here, it cannot stop words of others later."""
    if isinstance(value, str | bytes):  # which float() would read
        raise TypeError(f"a value is a number, not {type(value).__name__}")
    return float(value)


def switched(on: object) -> bool:
    """`on` as True or False. TypeError for text: "off" would be true."""
    if isinstance(on, str | bytes):
        raise TypeError(f"a switch takes True or False, not {type(on).__name__}")
    return bool(on)


class HasWord(Protocol):
    """An instance that is commanded by one register."""

    index: int

    def word(self) -> int:
        """What the register is to hold."""

    def forget(self) -> None:
        """What it was told to put out is not wanted any more."""


Commanded = TypeVar("Commanded", bound=HasWord)


class ModuleAccess:
    """One module of a card: its registers, and who drives its pins."""

    def __init__(self, board: Board, gtag: int) -> None:
        self.board = board
        self.descriptor: ModuleDescriptor = board.module(gtag)
        self.clock = self.descriptor.clock
        """Hz, of the clock the module runs on."""

    def address(self, register: int, instance: int = 0, channel: int = 0) -> int:
        """The byte address of a register."""
        return self.descriptor.register_address(register, instance, channel)

    def read(self, register: int, instance: int = 0, channel: int = 0) -> int:
        """One word, now."""
        return self.board.read_words(self.address(register, instance, channel), 1)[0]

    def write(self, register: int, word: int, instance: int = 0, channel: int = 0) -> None:
        """Write one word, now."""
        self.board.write(self.address(register, instance, channel), word)

    def pins(self, instance: int) -> list[PinDescriptor]:
        """The pins of one instance, those it shares with others included."""
        gtag = self.descriptor.gtag
        pins = [p for p in self.board.pins if p.secondary_gtag == gtag]
        return [p for p in pins if p.shared or p.secondary_unit == instance]

    def drive(self, instance: int, owner: str, pins: list[PinDescriptor] | None = None) -> None:
        """Switch an instance's pins to it, the watchdog armed first; off behind a bite until driven anew."""
        self.board.cycle.arm_watchdog()
        self.board.ioport.claim(self.pins(instance) if pins is None else pins, owner)

    def let_go(self, instance: int) -> None:
        """Drive an instance's own outputs no more; they stay its pins."""
        for pin in self.pins(instance):
            if pin.is_output and not pin.shared:
                self.board.ioport.configure(pin, output=False)

    def cyclic(self, register: int, words: Any, *, write: bool, order: Order) -> Any:
        """Take part in each exchange with one register of all instances; `enabled` = 0 leaves it out."""
        block: Any = ffi.new("hm2_cyclic_words *")
        block.transfer.address, block.transfer.count = self.address(register), len(words)
        block.transfer.flags = lib.HM2_TRANSFER_WRITE if write else lib.HM2_TRANSFER_READ
        block.transfer.words, block.enabled = words, 1
        part = ffi.new("hm2_cyclic *")
        lib.hm2_cyclic_words_part(block, part)
        self.board.cycle.add(part, (block, part, words), order)
        return block


class Instances(ModuleAccess, Sequence[Instance], Generic[Instance]):
    """A module's instances as a sequence."""

    def __init__(self, board: Board, gtag: int) -> None:
        super().__init__(board, gtag)
        self._instances: list[Instance] = []

    def __len__(self) -> int:
        return len(self._instances)

    @overload
    def __getitem__(self, index: int) -> Instance: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Instance]: ...
    def __getitem__(self, index: int | slice) -> Instance | Sequence[Instance]:
        return self._instances[index]

    def __repr__(self) -> str:
        return "\n".join(map(repr, self._instances))


class CommandedInstances(Instances[Commanded]):
    """Instances with one register each that every exchange writes.

    The subclass makes `_instances` and, when the hardware is in a known state, joins the cycle.
    """

    def __init__(self, board: Board, gtag: int, register: Register) -> None:
        super().__init__(board, gtag)
        self._register = register.number
        self._words: Any = ffi.new("uint32_t[]", self.descriptor.instances)
        self._instances: list[Commanded] = []

    def join_cycle(self, order: Order) -> None:
        """Let each exchange write the words from now on."""
        self.cyclic(self._register, self._words, write=True, order=order)

    def update(self) -> None:
        """Bring all commands into the words that the next exchange writes."""
        for instance in self._instances:
            self._words[instance.index] = instance.word()

    def write_now(self) -> None:
        """Write all words without waiting for the next exchange."""
        self.board.write(self.address(self._register), list(self._words))

    def _restore(self) -> None:
        """What was wanted before a bite is not wanted by itself after it."""
        for instance in self._instances:
            instance.forget()
        self._off()

    @abstractmethod
    def _off(self) -> None:
        """The hardware as when the board was opened: nothing put out, everything configured."""
