"""Machines coupled to an emulated card, so that a loop can be closed without hardware.

The motors run in the core (csrc/emulator/plant*.c) in steps of 50 us of the card's time; here they are
described and connected to remotes by element name.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.described import DescribedRemote
from hostmot2.errors import check, new_error
from hostmot2.fields import Field, FieldKind

TURN = 2 * math.pi


@dataclass(frozen=True, slots=True)
class Rotor:
    """What turns: SI units, angles in turns.

    inertia kg m^2; friction N m per rad/s; drag N m, opposes motion; load N m, from outside. limits: turns
    at which the low and the high limit switch close, None: no switches. index_counts: width of the index.
    """

    inertia: float = 2e-4
    friction: float = 1e-4
    drag: float = 0.01
    load: float = 0.0
    counts_per_turn: int = 4000
    index_counts: int = 4
    limits: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class DcMotorConstants:
    """A DC motor and its amplifier: gain V per command V, ohm, H, and N m/A (also V per rad/s)."""

    gain: float = 4.8
    resistance: float = 1.0
    inductance: float = 1e-3
    constant: float = 0.1
    rotor: Rotor = field(default_factory=Rotor)


@dataclass(frozen=True, slots=True)
class PmMotorConstants:
    """A permanent-magnet motor: pole pairs, N m per A at the best angle."""

    pole_pairs: int = 4
    constant: float = 0.3
    rotor: Rotor = field(default_factory=Rotor)


class Motor:
    """A running motor. Readings are those of the card's present time."""

    def __init__(self, board: EmulatedBoard, state: Any, keep: tuple[Any, ...]) -> None:
        self._board = board
        self._state = state
        self._keep = keep  # the core works on these as long as the board lives

    @property
    def turns(self) -> float:
        """Angle in turns since the beginning."""
        self._board.sync()
        return float(self._state.rotor.angle) / TURN

    @property
    def turns_per_second(self) -> float:
        """Speed."""
        self._board.sync()
        return float(self._state.rotor.speed) / TURN

    @property
    def torque(self) -> float:
        """N m that the motor makes."""
        self._board.sync()
        return float(self._state.rotor.torque)

    @property
    def load(self) -> float:
        """N m from outside; positive turns forward. May be changed while running."""
        return float(self._state.rotor.load)

    @load.setter
    def load(self, newton_metres: float) -> None:
        self._board.sync()
        self._state.rotor.load = newton_metres


def couple_dc_motor(
    board: EmulatedBoard,
    constants: DcMotorConstants | None = None,
    *,
    axis: int = 0,
    channels: tuple[int, int] = (0, 1),
    encoder: int | None = None,
    limit_inputs: tuple[int, int] = (0, 1),
) -> Motor:
    """Couple a DC motor to an analog axis of an emulated 7I77.

    axis 0 to 5: its analog output commands the motor, its enable (drive 5: the spindle's) switches the
    amplifier. channels: of the field I/O and of the analog remote. encoder: the card's encoder input, by
    default the axis number. limit_inputs: field inputs of the low and high limit switch.

    Raises TypeError if the channels carry no 7I77, ValueError for axis, inputs and inertia, IndexError for an
    encoder input that the card does not have.
    """
    constants = constants or DcMotorConstants()
    field_io, analog = (_described(board, channel) for channel in channels)
    if not 0 <= axis <= 5:
        raise ValueError(f"axis {axis} is outside 0..5")
    motor: Any = ffi.new("hm2_dc_motor *")
    _signal(motor.command, analog, f"analogout{axis}")
    _signal(motor.enable, analog, "spinena" if axis == 5 else "analogena")
    for name in ("gain", "resistance", "inductance", "constant"):
        setattr(motor, name, getattr(constants, name))
    _rotor(board, motor.rotor, constants.rotor, axis if encoder is None else encoder)
    for signal, bit in zip((motor.rotor.low_switch, motor.rotor.high_switch), limit_inputs, strict=True):
        _signal(signal, field_io, "input", bit)
    error = new_error()
    check(lib.hm2_emulator_add_dc_motor(board.handle, motor, error), error)
    return _keep(board, motor, field_io, analog)


def couple_pm_motor(
    board: EmulatedBoard,
    constants: PmMotorConstants | None = None,
    *,
    channel: int = 0,
    encoder: int = 0,
) -> Motor:
    """Couple a permanent-magnet motor to an emulated 8I20 on `channel`.

    Its torque follows the current and the cosine of the error between the commanded angle and the rotor's
    electrical angle, so commutation from the encoder can be tried. Raises as couple_dc_motor().
    """
    constants = constants or PmMotorConstants()
    drive = _described(board, channel)
    motor: Any = ffi.new("hm2_pm_motor *")
    _signal(motor.angle, drive, "angle")
    _signal(motor.current, drive, "qsetpoint")
    motor.angle.scale = 1.0 / 0xFFFF
    motor.current.scale = float(drive.get("maxcurrent")) / 0x7FFF
    _signal(motor.enable, drive, "pidon")
    motor.pole_pairs, motor.constant = constants.pole_pairs, constants.constant
    _rotor(board, motor.rotor, constants.rotor, encoder)
    error = new_error()
    check(lib.hm2_emulator_add_pm_motor(board.handle, motor, error), error)
    return _keep(board, motor, drive)


def _keep(board: EmulatedBoard, state: Any, *remotes: DescribedRemote) -> Motor:
    motor = Motor(board, state, remotes)
    board.keep(motor)
    return motor


def _described(board: EmulatedBoard, channel: int) -> DescribedRemote:
    remote = board.sserial[0].remote(channel)
    if not isinstance(remote, DescribedRemote):
        raise TypeError(f"channel {channel} carries no remote with described elements: {remote!r}")
    return remote


def _rotor(board: EmulatedBoard, state: Any, rotor: Rotor, encoder: int) -> None:
    if not rotor.inertia > 0:
        raise ValueError(f"inertia {rotor.inertia} kg m^2")
    for name in ("inertia", "friction", "drag", "load", "counts_per_turn"):
        setattr(state, name, getattr(rotor, name))
    state.low_limit, state.high_limit = rotor.limits or (1.0, 0.0)
    state.encoder = encoder
    wheel = board.encoder_input(encoder)
    wheel.set(0, 0, 0)
    wheel.index_every(counts=rotor.counts_per_turn, width=rotor.index_counts)
    wheel.position = 0


def _signal(signal: Any, remote: DescribedRemote, name: str, bit: int = -1) -> None:
    try:
        element: Field = remote.field(name)
    except KeyError as other:
        raise TypeError(f"a {remote.name} on this channel cannot be coupled: {other.args[0]}") from other
    if not -1 <= bit < element.bits:
        raise ValueError(f"{name} has bits 0..{element.bits - 1}, no {bit}")
    signal.remote, signal.address, signal.bits, signal.bit = remote.handle, element.address, element.bits, bit
    signal.is_signed = element.kind is FieldKind.SIGNED
    top = (1 << element.bits - signal.is_signed) - 1
    signal.scale = element.maximum / top if element.maximum else 1.0
