"""The emulated 8I20 supervises itself as its manual says: brake, faults, mask, limits, EEPROM at reset."""

from __future__ import annotations

import pytest
from lbp import ask, read, write

from hostmot2.emulator import DescribedRemote
from hostmot2.emulator.catalog import remote

STATUS, FAULT, CLEAR_FAULT, PIDENA, PIDON = 0x86E, 0x852, 0x854, 0x804, 0x8FE
CURRENT_LIMITED, BRAKE_ON, BRAKE_WAS_ON, BUS_LOW, SOFTWARE_RESET, NO_ENABLE, PID_ON = (
    1 << bit for bit in (0, 1, 2, 3, 5, 8, 9)
)


def word(drive: DescribedRemote, address: int) -> int:
    answer = read(drive, address, 2)
    assert answer is not None
    return int.from_bytes(answer, "little")


def put(drive: DescribedRemote, address: int, value: int) -> None:
    assert write(drive, address, value.to_bytes(2, "little")) == b""


@pytest.fixture
def drive() -> DescribedRemote:
    """Powered, faults cleared, running."""
    drive = remote("8i20")
    put(drive, CLEAR_FAULT, 0xFFFF)
    assert word(drive, CLEAR_FAULT) == 0
    put(drive, PIDENA, 0xFFFF)
    assert (word(drive, FAULT), word(drive, PIDON)) == (0, 0xFFFF)
    return drive


def test_the_brake_goes_on_at_360_v_and_off_at_340_v(drive: DescribedRemote) -> None:
    for volts, on in ((359.9, 0), (360.0, 1), (350.0, 1), (340.1, 1), (340.0, 0), (359.9, 0), (361.0, 1)):
        drive.set("BUSV", volts)
        assert word(drive, STATUS) & BRAKE_ON == on * BRAKE_ON, volts
    assert word(drive, STATUS) & BRAKE_WAS_ON
    drive.set("BUSV", 320.0)
    assert word(drive, STATUS) & (BRAKE_ON | BRAKE_WAS_ON) == BRAKE_WAS_ON
    put(drive, STATUS, 0)  # sticky until the register is cleared
    assert word(drive, STATUS) & BRAKE_WAS_ON == 0


def test_brake_thresholds_can_be_set_but_385_v_brakes_always(drive: DescribedRemote) -> None:
    drive.set("BRAKEONV", 190.0)
    drive.set("BRAKEOFFV", 170.0)
    drive.set("BUSV", 160.0)
    drive.set("BUSV", 189.0)
    assert not word(drive, STATUS) & BRAKE_ON
    drive.set("BUSV", 190.0)
    assert word(drive, STATUS) & BRAKE_ON
    drive.set("BRAKEONV", 500.0)
    drive.set("BRAKEOFFV", 500.0)
    drive.set("BUSV", 384.9)
    assert not word(drive, STATUS) & BRAKE_ON
    drive.set("BUSV", 385.0)
    assert word(drive, STATUS) & BRAKE_ON


@pytest.mark.parametrize(
    ("name", "value", "fault"),
    [
        ("BUSV", 385.0, 0),
        ("BUSV", 385.01, 1 << 9),
        ("BUSV", 400.01, 1 << 9 | 1 << 10),
        ("BUSV", 34.99, 1 << 8),
        ("TEMPERATURE", 85.0, 0),
        ("TEMPERATURE", 85.01, 1 << 2),
        ("IU", 937, 0),  # 125 % of 7.5 A is 9.375 A
        ("IU", 938, 1 << 5),
        ("IV", -938, 1 << 6),
        ("IW", 938, 1 << 7),
    ],
)
def test_fault_conditions_of_the_manual(drive: DescribedRemote, name: str, value: float, fault: int) -> None:
    drive.set(name, value)
    assert word(drive, FAULT) == fault
    assert (word(drive, PIDON) == 0) == bool(fault)
    assert drive.fault_output == (not fault)


def test_a_fault_stays_until_it_is_cleared_and_its_cause_is_gone(drive: DescribedRemote) -> None:
    drive.set("TEMPERATURE", 90.0)
    put(drive, FAULT, 0)
    assert word(drive, FAULT) == 1 << 2  # "Faults can not be cleared by writing the fault register"
    put(drive, CLEAR_FAULT, 0xFFFF)
    assert word(drive, FAULT) == 1 << 2
    drive.set("TEMPERATURE", 30.0)
    assert word(drive, FAULT) == 1 << 2
    drive.clear_flag_busy_reads = 3
    put(drive, CLEAR_FAULT, 0xFFFF)
    assert [word(drive, CLEAR_FAULT) for _ in range(4)] == [0xFFFF, 0xFFFF, 0xFFFF, 0]
    assert word(drive, FAULT) == 0
    assert word(drive, PIDON) == 0  # does not run again by itself
    put(drive, PIDENA, 0xFFFF)
    assert word(drive, PIDON) == 0xFFFF


def test_a_masked_bus_fault_does_not_stop_the_drive(drive: DescribedRemote) -> None:
    """8I20 manual, "FAULT MASK": only BUSLOVFAULT can be masked, a zero bit masks."""
    put(drive, 0x858, 0xFFFF & ~(1 << 8))
    drive.set("BUSV", 20.0)
    assert word(drive, FAULT) == 1 << 8
    assert word(drive, STATUS) & BUS_LOW
    assert (word(drive, PIDON), drive.fault_output) == (0xFFFF, True)
    put(drive, 0x858, 0)
    drive.set("TEMPERATURE", 90.0)
    assert (word(drive, PIDON), drive.fault_output) == (0, False)


def test_the_enable_input(drive: DescribedRemote) -> None:
    drive.enable_input = False
    assert word(drive, FAULT) == 1 << 1
    assert word(drive, STATUS) & (NO_ENABLE | PID_ON) == NO_ENABLE
    drive.enable_input = True
    put(drive, CLEAR_FAULT, 0xFFFF)
    assert (word(drive, FAULT), word(drive, STATUS) & NO_ENABLE) == (0, 0)


def test_current_is_scaled_by_maxcurrent(drive: DescribedRemote) -> None:
    """RMS motor current = QISETPOINT * MAXCURRENT / 3276700 A."""
    for maximum, setpoint in ((750, 0x7FFF), (2500, 0x4000), (3000, -0x4000), (750, 0)):
        put(drive, 0x8E8, maximum)
        put(drive, 0x860, setpoint & 0xFFFF)
        amperes = drive.get_raw("IQ")
        signed = amperes - 0x10000 if amperes & 0x8000 else amperes
        assert signed / 100 == pytest.approx(setpoint * maximum / 3_276_700, abs=0.01)


def test_heat_limits_the_current(drive: DescribedRemote) -> None:
    put(drive, 0x860, 0x7FFF)
    assert not word(drive, STATUS) & CURRENT_LIMITED
    drive.set("TEMPERATURE", 72.0)
    assert word(drive, STATUS) & CURRENT_LIMITED
    assert 0 < drive.get_raw("IQ") < 750
    drive.set("TEMPERATURE", 60.0)
    assert drive.get_raw("IQ") == 750


def test_working_parameters_come_from_eeprom_at_reset(drive: DescribedRemote) -> None:
    assert ask(drive, 0xEC, 1) == b""
    put(drive, 40, 19000)
    put(drive, 2, 2500)
    assert ask(drive, 0xEC, 0) == b""
    assert (word(drive, 0x86A), word(drive, 0x8E8)) == (36000, 750)
    assert ask(drive, 0xFE, 0x5A) is None  # a reset is not answered
    assert (word(drive, 0x86A), word(drive, 0x8E8)) == (19000, 2500)
    assert word(drive, STATUS) & SOFTWARE_RESET
    assert word(drive, FAULT) & 1  # watchdog
    drive.power_cycle()
    assert not word(drive, STATUS) & SOFTWARE_RESET


def test_nvcrcenable_counts_at_reset(drive: DescribedRemote) -> None:
    drive.set_raw("NVCRCENABLE", 0)
    assert drive.crc
    drive.power_cycle()
    assert not drive.crc
    assert drive.exchange(b"\xdf") == b"\x5a"


@pytest.mark.parametrize(("index", "baud"), [(0, 9600), (4, 115200), (8, 1_250_000), (9, 2_500_000)])
def test_the_baud_index_of_the_manual(index: int, baud: int) -> None:
    drive = remote("8i20")
    drive.set_raw("NVBAUDRATE", index)
    drive.power_cycle()
    assert drive.baud == baud
    drive.setup_jumper = True
    drive.power_cycle()
    assert drive.baud == 115200


def test_the_drive_is_off_in_set_up_mode() -> None:
    drive = remote("8i20", setup_jumper=True)
    put(drive, CLEAR_FAULT, 0xFFFF)
    put(drive, PIDENA, 0xFFFF)
    assert word(drive, PIDON) == 0
