"""The I/O ports: who drives each pin and with what. Every other module switches its pins through here.

AltSource, OpenDrain and OutputInvert can only be written, so this object holds what was written; nothing else
on the driver's side writes these registers. Source: fact sheets registers 2.1 and card_observed 2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.board import SafeOff
from hostmot2.cycle import Order
from hostmot2.idrom import PinDescriptor
from hostmot2.modules.instances import switched
from hostmot2.registers import Gtag
from hostmot2.registers import Ioport as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

_DDR, _ALT = Registers.ddr.number, Registers.alt_source.number
_OPEN_DRAIN, _INVERT = Registers.open_drain.number, Registers.output_invert.number
_WRITE_ORDER = (_INVERT, _OPEN_DRAIN, _ALT, _DDR)
"""DDR last, so that no pin is driven before it is known with what."""


class Ioport:
    """The output state of all pins.

    `owner` tells which module has a pin; a pin without owner and without secondary function is free for GPIO.
    All pins let go when the board closes. After a watchdog bite the outputs stay off until switched on again.
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._module = board.module(Gtag.IOPORT)
        self.ports = self._module.instances
        self._words = {register: [0] * self.ports for register in _WRITE_ORDER}
        self._driven = {register: [0] * self.ports for register in (_DDR, _OPEN_DRAIN)}
        self._owners: dict[int, str] = {}
        self._returning: set[int] = set()
        self._pads: Any = ffi.new("uint32_t[]", self.ports)
        self._latches: Any = ffi.new("uint32_t[]", self.ports)
        self._read = self._part(self._pads, lib.HM2_TRANSFER_READ)
        self._write = self._part(self._latches, lib.HM2_TRANSFER_WRITE)
        self._write.enabled = 0
        self.off()  # direction first: what another program left driven must not change its level
        board.on_restore(self._restore, SafeOff.IOPORT)
        board.on_close(self.off, SafeOff.IOPORT)

    def _part(self, words: Any, flags: int) -> Any:
        block: Any = ffi.new("hm2_cyclic_words *")
        part = ffi.new("hm2_cyclic *")
        block.transfer.address = self._address(Registers.data.number)
        block.transfer.count, block.transfer.flags, block.transfer.words = self.ports, flags, words
        block.enabled = 1
        lib.hm2_cyclic_words_part(block, part)
        self._board.cycle.add(part, (block, part), Order.IOPORT)
        return block

    def _address(self, register: int) -> int:
        return self._module.register_address(register)

    def claim(self, pins: Iterable[PinDescriptor], owner: str, *, after_bite: bool = False) -> None:
        """Switch pins to their secondary function; outputs are driven by it from now on.

        after_bite: after an acknowledged bite they are driven again at once, for lines that move nothing by
        themselves (smart serial, encoder selects); other outputs wait until they are claimed anew.
        Idempotent for the same owner. Raises PinInUse if another owner has one of them, WatchdogBite.
        """
        pins = list(pins)
        self._own(pins, owner, self._switch)
        if after_bite:
            self._returning.update(pin.index for pin in pins)

    def take(self, pins: Iterable[PinDescriptor], owner: str) -> None:
        """Reserve pins without switching them: they stay as they are. Raises PinInUse."""
        self._own(pins, owner, lambda pin: None)

    def _own(
        self, pins: Iterable[PinDescriptor], owner: str, action: Callable[[PinDescriptor], None]
    ) -> None:
        pins = list(pins)
        with self._board.lock:
            for pin in pins:
                holder = self._owners.get(pin.index, owner)
                if holder != owner:
                    raise errors.PinInUse(
                        f"IO{pin.index} belongs to {holder}, {owner} cannot have it", index=pin.index
                    )
            for pin in pins:
                self._owners[pin.index] = owner
                action(pin)
            self._flush()

    def _switch(self, pin: PinDescriptor) -> None:
        self._put(_ALT, pin, True)
        self._put(_DDR, pin, pin.is_output)

    def release(self, pins: Iterable[PinDescriptor]) -> None:
        """Let go of pins: inputs without owner, GPIO may have them."""
        with self._board.lock:
            for pin in pins:
                self._owners.pop(pin.index, None)
                self._returning.discard(pin.index)
                for register in _WRITE_ORDER:
                    self._put(register, pin, False)
            self._flush()

    def owner(self, pin: PinDescriptor) -> str | None:
        """Who has the pin: a module in use, the module it is wired for, or None: it is free for GPIO."""
        return self._owners.get(pin.index) or pin.module or None

    def configure(
        self,
        pin: PinDescriptor,
        *,
        output: bool | None = None,
        open_drain: bool | None = None,
        invert: bool | None = None,
    ) -> None:
        """Change what is given of a pin's direction, open drain and inversion.

        An open-drain pin ignores its direction in hardware, so open drain is only set while it is an output.
        """
        with self._board.lock:
            for register, wanted in ((_INVERT, invert), (_OPEN_DRAIN, open_drain), (_DDR, output)):
                if wanted is not None:
                    self._put(register, pin, wanted)
            if not self._get(_DDR, pin):
                self._put(_OPEN_DRAIN, pin, False)
            self._flush()

    def is_output(self, pin: PinDescriptor) -> bool:
        """Whether the card drives the pin."""
        return self._get(_DDR, pin)

    def is_inverted(self, pin: PinDescriptor) -> bool:
        """Whether the pin's output is inverted."""
        return self._get(_INVERT, pin)

    def is_open_drain(self, pin: PinDescriptor) -> bool:
        """Whether the pin is pulled low or let go, never driven high."""
        return self._get(_OPEN_DRAIN, pin)

    def level(self, pin: PinDescriptor) -> bool:
        """The pad's level at the last exchange, whoever drives it."""
        return bool(self._pads[pin.port] >> pin.bit & 1)

    def latch(self, pin: PinDescriptor) -> bool:
        """The GPIO output latch."""
        return bool(self._latches[pin.port] >> pin.bit & 1)

    def set_latch(self, pin: PinDescriptor, level: bool) -> None:
        """Set the GPIO output latch; the next exchange writes it."""
        mask = 1 << pin.bit
        word = self._latches[pin.port]
        self._latches[pin.port] = word | mask if switched(level) else word & ~mask
        self._write.enabled = 1

    def read_pads(self) -> None:
        """Read all pads now."""
        words = self._board.read_words(self._address(Registers.data.number), self.ports)
        self._pads[0 : self.ports] = words

    def write_latches(self) -> None:
        """Write all latches now."""
        self._board.write(self._address(Registers.data.number), list(self._latches))

    def off(self) -> None:
        """Let go of every pin; owners keep their pins and must claim them anew to drive them."""
        with self._board.lock:
            for port in range(self.ports):
                self._latches[port] = 0
                for register in _WRITE_ORDER:
                    self._words[register][port] = 0
            self._board.write(self._address(_DDR), self._words[_DDR])
            self._board.write(self._address(_OPEN_DRAIN), self._words[_OPEN_DRAIN])
            self._flush()

    def _get(self, register: int, pin: PinDescriptor) -> bool:
        return bool(self._words[register][pin.port] >> pin.bit & 1)

    def _put(self, register: int, pin: PinDescriptor, on: bool) -> None:
        word, mask = self._words[register][pin.port], 1 << pin.bit
        self._words[register][pin.port] = word | mask if on else word & ~mask

    def _flush(self) -> None:
        if any(self._words[_DDR]) or any(self._words[_OPEN_DRAIN]):
            # the card takes directions after a bite, too, and nobody would watch what it drives then
            self._board.cycle.raise_for_bite()
        for register, old in self._driven.items():
            kept = [word & new for word, new in zip(old, self._words[register], strict=True)]
            if kept != old:  # lets go before level or source change
                self._board.write(self._address(register), kept)
        for register in _WRITE_ORDER:
            self._board.write(self._address(register), self._words[register])
        self._driven = {register: list(self._words[register]) for register in self._driven}

    def _restore(self) -> None:
        """Outputs stay off after a bite but for the lines that move nothing by themselves."""
        for pin in self._board.pins:
            if pin.index not in self._returning:
                self._put(_DDR, pin, False)
                self._put(_OPEN_DRAIN, pin, False)
        self._flush()


class GpioPin:
    """One general-purpose pin. Inputs until `drive` or `output = True`."""

    def __init__(self, board: Board, pin: PinDescriptor) -> None:
        self._board, self.descriptor = board, pin

    @property
    def index(self) -> int:
        """The I/O number on the card."""
        return self.descriptor.index

    @property
    def level(self) -> bool:
        """The pad now, whoever drives it; open inputs read True (pull-up)."""
        self._board.ioport.read_pads()
        return bool(self._board.ioport.level(self.descriptor))

    def drive(self, level: bool, *, open_drain: bool = False, invert: bool = False) -> None:
        """Make the pin an output at `level`. Arms the watchdog, so exchanges must go on to keep it driven."""
        level = switched(level)
        ports = self._own()
        self._board.cycle.arm_watchdog()
        if ports.is_output(self.descriptor) and invert != ports.is_inverted(self.descriptor):
            ports.configure(self.descriptor, output=False)  # latch and inversion cannot change together
        ports.set_latch(self.descriptor, level)
        ports.write_latches()
        ports.configure(self.descriptor, output=True, open_drain=open_drain, invert=invert)

    def set(self, level: bool) -> None:
        """Set the output latch; the next exchange brings it to the pin."""
        self._own().set_latch(self.descriptor, level)

    def let_go(self) -> None:
        """Make the pin an input again."""
        self._own().configure(self.descriptor, output=False)

    @property
    def is_output(self) -> bool:
        """Whether the card drives the pin."""
        return bool(self._board.ioport.is_output(self.descriptor))

    def _own(self) -> Ioport:
        ports: Ioport = self._board.ioport
        owner = ports.owner(self.descriptor)
        if owner not in (None, "gpio"):
            raise errors.PinInUse(
                f"IO{self.index} belongs to {owner}: it is no GPIO. Only if nothing else is wired to it, "
                "call ioport.release first",
                index=self.index,
            )
        ports.take([self.descriptor], "gpio")
        return ports

    def __repr__(self) -> str:
        pin = self.descriptor
        where = f" {pin.connector}-{pin.connector_pin}" if pin.connector else ""
        direction = "output" if self.is_output else "input"
        return f"<GpioPin IO{pin.index}{where} {direction}>"


class Gpio:
    """All pins by I/O number: `hm2.gpio[17].drive(True)`. Only pins without another owner can be driven."""

    def __init__(self, board: Board) -> None:
        self._pins = [GpioPin(board, pin) for pin in board.pins]
        self._ports: Ioport = board.ioport

    def __len__(self) -> int:
        return len(self._pins)

    def __getitem__(self, index: int) -> GpioPin:
        return self._pins[index]

    @property
    def free(self) -> list[GpioPin]:
        """The pins that nobody owns or that are GPIO already."""
        return [pin for pin in self._pins if self._ports.owner(pin.descriptor) in (None, "gpio")]
