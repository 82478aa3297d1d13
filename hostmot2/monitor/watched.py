"""Registers that are read along in every cycle. Nothing here writes: it works on a read-only board, too."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hostmot2._core import ffi, lib
from hostmot2.cycle import Order
from hostmot2.engine.signals import Signal
from hostmot2.idrom import ModuleDescriptor
from hostmot2.registers import Encoder, Gtag, Ioport, Sserial
from hostmot2.registers import Watchdog as WatchdogRegisters

if TYPE_CHECKING:
    from hostmot2.board import Board

ENCODERS = (Gtag.ENCODER, Gtag.MUXED_ENCODER)
VELOCITY_TIMEOUT = 0.5


def module_of(board: Board, *gtags: int) -> ModuleDescriptor | None:
    """The first module of one of these kinds, None if the firmware has none."""
    return next((module for module in board.modules if module.gtag in gtags), None)


class Watched:
    """`signals` are the inputs that an engine gets of them; make it before the engine."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self.signals: list[Signal] = []
        self._encoder_count = 0

    def watchdog(self) -> None:
        """The watchdog's counter and whether it has bitten."""
        module = module_of(self._board, Gtag.WATCHDOG)
        if module is not None:
            timer, status = WatchdogRegisters.timer.number, WatchdogRegisters.status.number
            self._words(module.register_address(timer), ["watchdog.timer"], Order.WATCHDOG)
            self._words(module.register_address(status), ["watchdog.status"], Order.WATCHDOG)

    def directions(self) -> None:
        """Which pads are driven."""
        self._ports(Ioport.ddr.number, "driven")

    def levels(self) -> None:
        """The levels of all pads."""
        self._ports(Ioport.data.number, "pads")

    def _ports(self, register: int, name: str) -> None:
        module = self._board.module(Gtag.IOPORT)
        names = [f"ioport{port}.{name}" for port in range(module.instances)]
        self._words(module.register_address(register), names, Order.IOPORT)

    def channel_status(self) -> None:
        """CS of every smart-serial channel, started by whomever."""
        if module_of(self._board, Gtag.SSERIAL, Gtag.SSERIAL_B) is None:
            return
        for port in self._board.sserial:
            names = [f"sserial{port.number}.{channel.number}.CS" for channel in port.channels]
            self._words(port.register_address(Sserial.cs.number), names, Order.OTHERS)

    def encoders(self) -> None:
        """Encoders as somebody else has set them up: counts, positions in counts, velocities in counts/s."""
        for module in self._board.modules:
            if module.gtag in ENCODERS:
                self._encoders(module)

    def _words(self, address: int, names: list[str], order: Order) -> None:
        words: Any = ffi.new("uint32_t[]", len(names))
        block: Any = ffi.new("hm2_cyclic_words *")
        part: Any = ffi.new("hm2_cyclic *")
        block.transfer.address, block.transfer.count = address, len(names)
        block.transfer.flags, block.transfer.words = lib.HM2_TRANSFER_READ, words
        block.enabled = 1
        lib.hm2_cyclic_words_part(block, part)
        self._board.cycle.add(part, (words, block, part), order)
        self.signals += [Signal(name, words + n, lib.HM2_SIGNAL_U32) for n, name in enumerate(names)]

    def _encoders(self, module: ModuleDescriptor) -> None:
        states: Any = ffi.new("hm2_encoder[]", module.instances)
        words: Any = ffi.new("uint32_t[]", 1 + 2 * module.instances)
        group: Any = ffi.new("hm2_encoders *")
        part: Any = ffi.new("hm2_cyclic *")
        group.encoders, group.words, group.count = states, words, module.instances
        group.count_address = module.register_address(Encoder.count.number)
        group.control_address = module.register_address(Encoder.control.number)
        group.timestamp_address = module.register_address(Encoder.timestamp_count.number)
        group.instance_stride = module.instance_stride
        divider = self._board.read(module.register_address(Encoder.timestamp_divider.number)) & 0xFFFF
        group.timebase.seconds_per_tick = (1 if divider & 0x8000 else divider + 2) / module.clock
        lib.hm2_encoders_part(group, part)
        part.writes = ffi.NULL
        self._board.cycle.add(part, (states, words, group, part), Order.ENCODERS)
        for state in (states + n for n in range(module.instances)):
            state.scale, state.velocity_timeout = 1.0, VELOCITY_TIMEOUT
            self._name_encoder(state)

    def _name_encoder(self, state: Any) -> None:
        name = f"encoder{self._encoder_count}"
        self._encoder_count += 1
        for member, kind in (
            ("position", lib.HM2_SIGNAL_F64),
            ("velocity", lib.HM2_SIGNAL_F64),
            ("raw_count", lib.HM2_SIGNAL_I64),
        ):
            self.signals.append(Signal(f"{name}.{member}", ffi.addressof(state[0], member), kind))
