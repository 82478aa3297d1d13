"""Motors on the emulated card: what physics says of them, and what the card sees."""

from __future__ import annotations

import math

import pytest
from lbp import write

from hostmot2.emulator import catalog
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.described import DescribedRemote
from hostmot2.emulator.plant import (
    DcMotorConstants,
    Motor,
    PmMotorConstants,
    Rotor,
    couple_dc_motor,
    couple_pm_motor,
)

TURN = 2 * math.pi


def poke(remote: DescribedRemote, name: str, raw: int) -> None:
    element = remote.field(name)
    remote.poke(element.address, (raw & 0xFFFF).to_bytes(2, "little")[: -(-element.bits // 8)])


class Bench:
    def __init__(self, constants: DcMotorConstants | None = None, axis: int = 0) -> None:
        self.board = EmulatedBoard("5i25+7i77", clock="virtual")
        self.io, self.analog = catalog.remote("7i77-io"), catalog.remote("7i77-analog")
        for channel, remote in enumerate((self.io, self.analog)):
            self.board.sserial[0].attach(channel, remote)
        self.motor: Motor = couple_dc_motor(self.board, constants, axis=axis)
        self.axis = axis

    def command(self, volts: float, enable: bool = True) -> None:
        poke(self.analog, f"analogout{self.axis}", round(volts / 10 * 4095))
        poke(self.analog, "spinena" if self.axis == 5 else "analogena", int(enable))


def test_a_disabled_amplifier_moves_nothing() -> None:
    bench = Bench()
    bench.command(5.0, enable=False)
    bench.board.advance(100_000.0)
    assert bench.motor.turns == 0.0


def test_the_final_speed_is_where_back_emf_friction_and_drag_balance() -> None:
    rotor = Rotor(inertia=1e-4, friction=2e-4, drag=0.005)
    constants = DcMotorConstants(gain=2.0, resistance=0.5, inductance=1e-4, constant=0.08, rotor=rotor)
    bench = Bench(constants)
    bench.command(5.0)
    bench.board.advance(2_000_000.0)
    volts = round(5.0 / 10 * 4095) / 4095 * 10 * constants.gain
    # k (V - k w) / R = b w + drag
    k, r = constants.constant, constants.resistance
    speed = (k * volts / r - rotor.drag) / (k * k / r + rotor.friction)
    assert bench.motor.turns_per_second * TURN == pytest.approx(speed, rel=1e-3)


def test_without_drive_drag_brings_it_to_rest_and_not_beyond() -> None:
    bench = Bench()
    bench.command(5.0)
    bench.board.advance(500_000.0)
    bench.command(5.0, enable=False)
    bench.board.advance(20_000_000.0)
    rest = bench.motor.turns
    assert bench.motor.turns_per_second == 0.0
    bench.board.advance(1_000_000.0)
    assert bench.motor.turns == rest


@pytest.mark.parametrize("axis", [0, 3, 5])
def test_the_encoder_follows_the_rotor_without_drift(axis: int) -> None:
    bench = Bench(axis=axis)
    for volts in (5.0, -7.0, 2.0, 0.0):
        bench.command(volts)
        bench.board.advance(300_000.0)
    bench.board.advance(3_000_000.0)
    assert bench.motor.turns_per_second == 0.0
    assert bench.board.encoder_input(axis).position == pytest.approx(bench.motor.turns * 4000, abs=1.0)


def test_limit_switches_close_at_their_places() -> None:
    bench = Bench(DcMotorConstants(rotor=Rotor(limits=(-0.5, 1.5))))
    assert bench.io.get("input") == 0
    bench.command(3.0)
    while bench.motor.turns < 1.49:
        assert int(bench.io.get("input")) & 3 == 0
        bench.board.advance(500.0)
    bench.board.advance(30_000.0)
    assert int(bench.io.get("input")) & 3 == 2
    bench.command(-3.0)
    bench.board.advance(1_000_000.0)
    assert int(bench.io.get("input")) & 3 == 1


def test_a_load_turns_a_motor_that_is_off() -> None:
    bench = Bench()
    bench.motor.load = 0.009  # less than the drag
    bench.board.advance(200_000.0)
    assert bench.motor.turns == 0.0
    bench.motor.load = 0.05
    bench.board.advance(200_000.0)
    assert bench.motor.turns > 0.1


def run(drive: DescribedRemote) -> None:
    """Faults cleared, watchdog off, PID on."""
    poke(drive, "watchdogtime", 0)
    for address in (0x0854, 0x0804):
        assert write(drive, address, b"\xff\xff") == b""


@pytest.mark.parametrize(("error", "direction"), [(0.0, 1), (0.5, -1), (0.2, 1), (-0.2, 1), (0.3, -1)])
def test_pm_torque_follows_the_cosine_of_the_angle_error(error: float, direction: int) -> None:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    drive = catalog.remote("8i20")
    board.sserial[0].attach(0, drive)
    constants = PmMotorConstants(rotor=Rotor(drag=0.0))
    motor = couple_pm_motor(board, constants)
    poke(drive, "angle", round(error % 1.0 * 65535))
    poke(drive, "qsetpoint", 0x7FFF)
    run(drive)
    board.advance(60.0)
    assert motor.torque == pytest.approx(constants.constant * 7.5 * math.cos(TURN * error), abs=0.01)
    assert motor.turns_per_second * direction > 0


def test_commutation_from_the_encoder_keeps_it_turning() -> None:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    drive = catalog.remote("8i20")
    board.sserial[0].attach(0, drive)
    motor = couple_pm_motor(board, PmMotorConstants(rotor=Rotor(friction=1e-3)))
    run(drive)
    poke(drive, "qsetpoint", 0x1000)
    for _ in range(2000):
        turns = board.encoder_input(0).position / 4000
        poke(drive, "angle", round(turns * 4 % 1.0 * 65535))
        board.advance(250.0)
    assert motor.turns > 5.0


def test_what_is_no_7i77_is_refused() -> None:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    board.sserial[0].attach(0, catalog.remote("7i64"))
    board.sserial[0].attach(1, catalog.remote("7i77-analog"))
    with pytest.raises(TypeError, match="analogout0"):
        couple_dc_motor(board, channels=(0, 0))
    with pytest.raises(ValueError, match="axis"):
        couple_dc_motor(board, axis=6)


def test_a_motor_on_a_remote_of_another_kind_is_a_type_error() -> None:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    with pytest.raises(TypeError, match="7I77 on this channel cannot be coupled"):
        couple_pm_motor(board, channel=0)
    with pytest.raises(TypeError, match="analogout0"):
        couple_dc_motor(board, channels=(1, 0))
    with pytest.raises(IndexError, match="no encoder input 9"):
        couple_dc_motor(board, encoder=9)
