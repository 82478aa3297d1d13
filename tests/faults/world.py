"""A card with a 7I77's remotes on it, in virtual time, and a driver that reaches it through what can fail."""

from __future__ import annotations

import gc
from typing import Any

from sserial.remotes import analog, field_io, give_watchdog

import hostmot2
from hostmot2._core import ffi, lib
from hostmot2.board import Board
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.ethernet import DESCRIPTIONS, EthernetCard
from hostmot2.handles import own
from hostmot2.registers import Gtag, Ioport, Sserial, SslbpCommand
from hostmot2.registers import Watchdog as WatchdogRegisters
from hostmot2.transports.base import Transport
from hostmot2.transports.udp import UdpLink, transport_over

LATENCY_NS = 40_000
FIELD, ANALOG = 0, 1
CHANNELS = 0b11
REMOTE_WATCHDOG_MS = 50
SILENCE_US = 150_000.0
"""Longer than the watchdogs of card and remotes: whatever is driven without being asked for ends."""

SPEC = {"words": "5i25+7i77", "datagrams": "7i92+7i77"}


class Faults:
    """Faults for one C object that counts steps: what is planned stays alive as long as it may happen."""

    def __init__(self, setter: Any, counter: Any) -> None:
        self._set, self._counter = setter, counter
        self._keep: tuple[Any, ...] = ()

    def plan(self, faults: list[dict[str, Any]], limit: int = 0) -> None:
        """Faults from now on, steps counted from 1."""
        array = ffi.new("hm2_fault[]", max(1, len(faults)))
        callbacks = []
        for i, fault in enumerate(faults):
            act = fault.get("act")
            callback = ffi.callback("void(void *)", lambda _self, act=act: act()) if act else ffi.NULL
            callbacks.append(callback)
            array[i] = {**fault, "act": callback}
        self._set(array, len(faults), limit)
        self._keep = (array, *callbacks)

    @property
    def steps(self) -> int:
        """Steps since the plan was made."""
        return int(self._counter(ffi.NULL))

    @property
    def fired(self) -> int:
        """At how many of them a fault was due."""
        fired = ffi.new("uint64_t *")
        self._counter(fired)
        return int(fired[0])


class UserError(Exception):
    """What the user's own code raises."""


class Statements:
    """The user's own statements, counted as they are reached. Faults: where UserError is raised."""

    def __init__(self) -> None:
        self.steps = self.fired = 0
        self._due: set[int] = set()

    def plan(self, faults: list[dict[str, Any]], limit: int = 0) -> None:
        """Faults from now on, steps counted from 1."""
        self.steps = self.fired = 0
        self._due = {fault["step"] for fault in faults}

    def reach(self) -> None:
        """One more statement."""
        self.steps += 1
        if self.steps in self._due:
            self.fired += 1
            raise UserError("the user's code failed")


class World:
    """The card and whoever drives it. `layer`: what the driver reaches it through, "words" or "datagrams"."""

    def __init__(self, layer: str = "words") -> None:
        self.layer = layer
        self.card = EmulatedBoard(SPEC[layer], clock="virtual")
        self.remotes = (self._remote(field_io), self._remote(analog))
        for channel, remote in enumerate(self.remotes):
            self.card.sserial[0].attach(channel, remote, through_pins=True)
        self.card.sserial[0].detach(2)
        self.encoder = self.card.encoder_input(0)
        self.encoder.set_rate(2000.0)
        self.board: Board | None = None
        self.link: UdpLink | None = None
        self.answers = [
            Faults(
                lambda faults, count, _limit, r=remote: lib.hm2_remote_set_faults(r.handle, faults, count),
                lambda fired, r=remote: lib.hm2_remote_answers(r.handle, fired),
            )
            for remote in self.remotes
        ]
        self._addresses()
        self.faults = self._words() if layer == "words" else self._datagrams()
        self.allowed_outputs: list[set[bytes]] = [{bytes(2)}, {bytes(10)}]
        self.truths: dict[str, list[Any]] = {}
        self.statements = Statements()

    @staticmethod
    def _remote(make: Any) -> Any:
        remote = make()
        give_watchdog(remote, REMOTE_WATCHDOG_MS)
        lib.hm2_remote_set(remote.handle, lib.HM2_REMOTE_FAULT_GATES, 1)
        return remote

    def _addresses(self) -> None:
        with hostmot2.open(self.card) as board:
            modules = {module.gtag: module for module in board.modules}
            outputs = [p for p in board.pins if p.is_output and p.secondary_gtag in _MOVE_NOTHING]
        self.command = modules[Gtag.SSERIAL].register_address(Sserial.command.number)
        self.ddr = [
            modules[Gtag.IOPORT].register_address(Ioport.ddr.number, i)
            for i in range(modules[Gtag.IOPORT].instances)
        ]
        self.timer = modules[Gtag.WATCHDOG].register_address(WatchdogRegisters.timer.number)
        self.lines = [sum(1 << p.bit for p in outputs if p.port == port) for port in range(len(self.ddr))]
        """Pins that the driver may drive without being asked: serial lines and encoder selects."""

    # -- what is between driver and card

    def _words(self) -> Faults:
        mailbox = ffi.new(
            "hm2_mailbox *",
            {
                "command": self.command,
                "unjam": SslbpCommand.UNJAM,
                "reset_mask": SslbpCommand.RESET,
                "ignore_mask": 1 << 31,
            },
        )
        self._bus: Any = ffi.new("hm2_bus *")
        self._tap, self._kept = own(
            lib.hm2_fault_bus_new(self.card.bus, mailbox, self._bus), lib.hm2_fault_bus_free
        )
        tap = self._tap
        return Faults(
            lambda faults, count, limit: lib.hm2_fault_bus_set(tap, faults, count, limit),
            lambda fired: lib.hm2_fault_bus_steps(tap, fired),
        )

    def _datagrams(self) -> Faults:
        self._engine = EthernetCard(DESCRIPTIONS["7i92"], self.card)
        self._carrier: Any = ffi.new("hm2_carrier *")
        link = lib.hm2_fault_link_new(self._engine.handle, self.card.bus, LATENCY_NS, self._carrier)
        self._net, self._kept = own(link, lib.hm2_fault_link_free)
        net = self._net
        return Faults(
            lambda faults, count, limit: lib.hm2_fault_link_set(net, faults, count, limit),
            lambda fired: lib.hm2_fault_link_steps(net, fired),
        )

    def _transport(self) -> Transport:
        if self.layer == "words":
            return Transport(bus=self._bus, url="emu://faulty", keep=(self,), virtual_time=True)
        self.link = VirtualLink(self._carrier)
        transport = transport_over(self.link, "udp://virtual")
        transport.virtual_time = True
        transport.keep = (*transport.keep, self)
        return transport

    # -- the driver

    def open(self) -> Board:
        """The board, opened through the fallible layer."""
        self.board = Board(self._transport())
        return self.board

    @property
    def port(self) -> Any:
        """The board's smart-serial port."""
        assert self.board is not None
        return self.board.sserial[0]

    @property
    def seven(self) -> Any:
        """The board's 7I77."""
        assert self.board is not None
        return self.board.card("7i77")

    def close(self) -> None:
        """Close the board if it is open."""
        board, self.board = self.board, None
        if board is not None:
            board.close()

    def settle(self) -> None:
        """No more faults, remotes in good health, as after somebody has repaired what was broken."""
        self.faults.plan([])
        self.statements.plan([])
        for faults in self.answers:
            faults.plan([])
        for remote in self.remotes:
            heal(remote)
            remote.fault_clears = True
            remote.clear_flag_busy_reads = 0

    def recover(self) -> None:
        """What the documentation tells a user to do when the cause is gone: acknowledge, reset, go on."""
        board = self.board
        if board is None or board.closed:
            self.board = None
            return
        if self.link is not None and self.link.counters.failed:
            self.link.clear()
        board.watchdog.acknowledge()
        self.port.reset()

    # -- what can be done to it from outside

    def bite(self) -> None:
        """The card's watchdog bites: it runs out if it runs, else it is made to by somebody else."""
        left = self.card.read(self.timer)
        if left < SOON:
            self.card.advance_clocks(left + 10)
            return
        self.card.write(self.timer, 0)
        self.card.advance(1.0)
        if left & STOPPED:
            self.card.write(self.timer, STOPPED)

    def unplug(self) -> None:
        """The field I/O goes without power."""
        self.remotes[FIELD].alive = False

    def fail(self) -> None:
        """The field I/O has a fault."""
        self.remotes[FIELD].fault = REMOTE_FAULT

    def hang(self) -> None:
        """The field I/O stays busy clearing its faults: its start never ends."""
        self.remotes[FIELD].fault = REMOTE_FAULT
        self.remotes[FIELD].clear_flag_busy_reads = 1 << 40

    # -- looking at the machine

    def outputs(self) -> list[bytes]:
        """What the remotes' outputs are now."""
        self.card.sync()
        return [remote.outputs for remote in self.remotes]

    def driven(self) -> list[int]:
        """Masks of pins that the card drives, by port."""
        levels = [pin.level for pin in self.card.pins]
        width = len(levels) // len(self.ddr)
        return [
            self.card.read(address) & sum(1 << i for i in range(width) if levels[port * width + i] != "H")
            for port, address in enumerate(self.ddr)
        ]

    @property
    def now_us(self) -> float:
        """The card's time."""
        return self.card.now_us

    def drop(self) -> None:
        """Let go of everything."""
        try:
            self.close()
        finally:
            self.card.close()
            gc.collect(0)


STOPPED = 1 << 31
SOON = 1 << 26
"""Clocks that one may wait for a watchdog to run out; relaxed it takes 2^31."""

REMOTE_FAULT = 0x04


def heal(remote: Any) -> None:
    """A remote that answers again, undisturbed and without the fault it was given."""
    remote.inject(bad_crc=0, truncate=0, extra=0, framing_break=0, skip=0)
    if not remote.alive:
        remote.alive = True
        remote.power_cycle()
    if remote.fault == REMOTE_FAULT:
        remote.fault = 0


"""Over temperature: nothing that the driver or the remote would set by itself."""

_MOVE_NOTHING = (Gtag.SSERIAL, Gtag.MUXED_ENCODER_SELECT)


class VirtualLink(UdpLink):
    """The link of udp:// on a carrier with virtual time."""

    def __init__(self, carrier: Any) -> None:
        self._carrier = carrier
        super().__init__("virtual", spin_us=0)

    def _open(self, config: Any, out: Any) -> int:
        return int(lib.hm2_udp_carrier_bus(self._carrier, config, self.bus, out, self._error))
