"""Three-phase PWM: numbers of fact sheet registers 2.9, gates on the pins, faults."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.ethernet import EthernetCard, EthernetDescription
from tests.modules.module_card import CLOCK_HIGH, ModuleWords, module_card, pin, written
from tests.modules.waveform import high_time

TP_PWM, BASE = 0x13, 0x4600
VALUE, ENABLE, SETUP, RATE = range(BASE, BASE + 0x400, 0x100)
A_HIGH, A_LOW, NOT_ENABLED, FAULT = 0, 3, 6, 7
NUMBERS = (*range(0x81, 0x88), 0x08)
CARD = module_card(
    ModuleWords(TP_PWM, BASE, 4, instances=2, clock=2, multiple=3),
    pins=tuple(pin(TP_PWM, number, unit) for unit in (0, 1) for number in NUMBERS),
)


@pytest.fixture
def emulated() -> EmulatedBoard:
    board = EmulatedBoard(CARD, clock="virtual")
    board.pin(FAULT).drive(1)
    board.pin(FAULT + 8).drive(1)
    return board


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


@pytest.fixture
def words(board: Board, monkeypatch: pytest.MonkeyPatch) -> dict[int, int]:
    return written(board, monkeypatch)


def test_the_rate(board: Board, words: dict[int, int]) -> None:
    pwms = board.tp_pwms
    rate = round(20000 * 65536 * 2048 / CLOCK_HIGH)
    assert words[RATE] == rate == 13422
    assert pwms.frequency == pytest.approx(20000, rel=1e-4)
    with pytest.raises(ValueError, match="PWM frequency"):
        pwms.frequency = CLOCK_HIGH / 2048 + 10
    with pytest.raises(ValueError, match="PWM frequency"):
        pwms.frequency = 0


def test_a_phase_that_is_no_number_is_refused_at_once(board: Board) -> None:
    bridge: Any = board.tp_pwms[0]
    for wrong in ("0.5", None):
        with pytest.raises(TypeError):
            bridge.b = wrong
    bridge.enable = True
    assert (bridge.b, bridge.enable) == (0.0, True)


def test_the_text_off_does_not_switch_on(board: Board) -> None:
    bridge: Any = board.tp_pwms[0]
    with pytest.raises(TypeError, match="True or False"):
        bridge.enable = "off"
    assert bridge.enable is False


def test_a_bridge_that_could_not_be_turned_off_gets_no_more_voltage(
    board: Board, emulated: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    bridge = board.tp_pwms[0]
    bridge.enable = True
    bridge.a, bridge.b = 0.5, -0.5
    board.cycle.run()
    with monkeypatch.context() as patched:

        def lost(address: int, words: object) -> None:
            raise errors.TransportTimeout("lost")

        patched.setattr(board, "write", lost)
        with pytest.raises(errors.TransportTimeout):
            bridge.enable = False
    board.cycle.run()
    assert board.tp_pwms._words[0] == 512 | 512 << 10 | 512 << 20


def test_enabling_behind_a_bite_does_not_resume(board: Board, emulated: EmulatedBoard) -> None:
    bridge = board.tp_pwms[0]
    bridge.enable = True
    bridge.a, bridge.b, bridge.c = 0.5, -0.5, 0.25
    board.cycle.run()
    emulated.advance(100_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()
    board.watchdog.acknowledge()
    bridge.enable = True
    assert (bridge.a, bridge.b, bridge.c) == (0.0, 0.0, 0.0)
    assert bridge.word() == 512 | 512 << 10 | 512 << 20


def test_the_dead_time_in_both_instances(board: Board, words: dict[int, int]) -> None:
    board.tp_pwms[1].dead_time = 1e-6
    # ns * clock * rate / (2 * 65536 * 1e9), never less
    assert words[SETUP + 4] & 0x1FF == math.ceil(1000 * CLOCK_HIGH * 13422 / (2 * 65536 * 1e9)) == 21
    assert words[SETUP] & 0x1FF == 103  # 5 us
    assert words[SETUP] >> 16 & 0x7FF == 1024, "sampled in mid-cycle"
    for seconds in (math.inf, 1e308):
        with pytest.raises(ValueError, match="dead time"):
            board.tp_pwms[1].dead_time = seconds
    with pytest.raises(ValueError, match="dead time"):
        board.tp_pwms[0].dead_time = 26e-6
    with pytest.raises(ValueError, match="dead time"):
        board.tp_pwms[0].dead_time = -1e-9


@pytest.mark.parametrize(
    ("value", "fields"),
    [(0.0, 512), (1.0, 1023), (-1.0, 1), (5.0, 1023), (-5.0, 1), (0.5, 768), (float("nan"), 512)],
)
def test_no_phase_overflows_into_its_neighbour(board: Board, value: float, fields: int) -> None:
    pwm = board.tp_pwms[0]
    pwm.enable = True
    for phase, shift in (("a", 0), ("b", 10), ("c", 20)):
        pwm.a = pwm.b = pwm.c = 0.0
        setattr(pwm, phase, value * 1.0)
        others = sum(512 << other for other in (0, 10, 20) if other != shift)
        assert pwm.word() == others | fields << shift


def test_gates_share_a_cycle_with_dead_time_between(board: Board, emulated: EmulatedBoard) -> None:
    pwm = board.tp_pwms[0]
    board.tp_pwms.frequency = CLOCK_HIGH / 2048 / 2  # a PWM clock is a ClockLow period, a cycle 2048 of them
    pwm.dead_time = 200e-9  # ten pairs of PWM clocks
    pwm.enable = True
    emulated.advance_clocks(2048)
    assert high_time(emulated, A_HIGH, 2048) == 2 * 512 - 20
    assert high_time(emulated, A_LOW, 2048) == 2 * 512 - 20
    pwm.a = 0.5
    board.cycle.run()
    emulated.advance_clocks(2048)
    assert high_time(emulated, A_HIGH, 2048) == 2 * 768 - 20
    assert high_time(emulated, A_LOW, 2048) == 2 * 256 - 20
    both = 0
    for _ in range(2048):
        both += emulated.pin(A_HIGH).level == "1" == emulated.pin(A_LOW).level
        emulated.advance_clocks(1)
    assert both == 0


def test_nothing_is_driven_until_enabled(board: Board, emulated: EmulatedBoard) -> None:
    assert board.tp_pwms[0].enable is False
    board.cycle.run()
    assert {emulated.pin(n).level for n in range(7)} == {"H"}
    board.tp_pwms[0].enable = True
    assert emulated.pin(NOT_ENABLED).level == "0"
    assert {emulated.pin(8 + n).level for n in range(7)} == {"H"}
    board.tp_pwms[0].enable = False
    assert emulated.pin(NOT_ENABLED).level == "1"
    assert {emulated.pin(n).level for n in range(6)} == {"0"}


def test_a_fault_turns_off_and_is_kept(board: Board, emulated: EmulatedBoard) -> None:
    pwm = board.tp_pwms[0]
    pwm.enable = True
    emulated.pin(FAULT).drive(0)
    emulated.advance_clocks(3)
    emulated.pin(FAULT).drive(1)
    emulated.advance(1.0)
    board.cycle.run()
    assert pwm.enable, "shorter than the filter"
    emulated.pin(FAULT).drive(0)
    emulated.advance(1.0)
    assert emulated.pin(NOT_ENABLED).level == "1"
    emulated.pin(FAULT).drive(1)
    for _ in range(3):
        board.cycle.run()
        assert pwm.fault
        assert not pwm.enable
    assert emulated.read(ENABLE) == 2, "nothing enables it behind the user's back"
    pwm.enable = True
    board.cycle.run()
    assert pwm.enable
    assert not pwm.fault


def test_enabling_with_a_fault_present_refuses(board: Board, emulated: EmulatedBoard) -> None:
    emulated.pin(FAULT).drive(0)
    emulated.advance(1.0)
    with pytest.raises(errors.FaultPresent) as caught:
        board.tp_pwms[0].enable = True
    assert caught.value.index == 0
    assert emulated.read(ENABLE) & 1 == 0
    assert not board.tp_pwms[0].enable
    board.tp_pwms[0].fault_is_high = True
    board.tp_pwms[0].enable = True


def test_an_active_fault_sets_the_flag_of_a_bridge_that_is_off_too() -> None:
    emulated = EmulatedBoard(CARD, clock="virtual")
    emulated.pin(FAULT).drive(0)
    emulated.advance_clocks(6)
    assert emulated.read(ENABLE) == 0, "filtered for seven clocks"
    emulated.advance_clocks(2)
    assert [emulated.read(ENABLE), emulated.read(ENABLE + 4)] == [2, 0]
    emulated.write(ENABLE, 0)
    assert emulated.read(ENABLE) == 2, "the fault is still there"
    emulated.pin(FAULT).drive(1)
    emulated.advance_clocks(100)
    assert emulated.read(ENABLE) == 2, "kept"
    emulated.write(ENABLE, 0)
    assert emulated.read(ENABLE) == 0


def test_a_fault_outlasts_a_reload_of_the_fpga() -> None:
    emulated = EmulatedBoard(CARD, clock="virtual")
    emulated.pin(FAULT).drive(0)
    emulated.advance_clocks(100)
    EthernetCard(EthernetDescription("7I92"), emulated).power_up()
    assert emulated.read(ENABLE) == 0
    emulated.advance_clocks(8)
    assert (emulated.read(ENABLE), emulated.clocks) == (2, 108)


def test_the_frequency_is_not_changed_under_way(board: Board) -> None:
    board.tp_pwms[0].enable = True
    with pytest.raises(ValueError, match="off"):
        board.tp_pwms.frequency = 10000


def test_off_at_close(emulated: EmulatedBoard) -> None:
    with hostmot2.open(emulated) as board:
        board.tp_pwms[1].enable = True
    assert emulated.read(ENABLE + 4) == 0
    assert {emulated.pin(n).level for n in range(7)} == {"H"}


def test_off_behind_a_bite(board: Board, emulated: EmulatedBoard) -> None:
    board.tp_pwms[1].enable = True
    emulated.advance(60_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()
    board.watchdog.acknowledge()
    assert emulated.read(ENABLE + 4) == 0
    assert {emulated.pin(8 + n).level for n in range(7)} == {"H"}
    assert not board.tp_pwms[1].enable


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("scale", 0.0),
        ("scale", math.nan),
        ("scale", -math.inf),
        ("sample_time", -0.01),
        ("sample_time", 1.01),
        ("sample_time", math.nan),
    ],
)
def test_a_wrong_setting_is_refused_and_changes_nothing(
    board: Board, words: dict[int, int], name: str, wrong: float
) -> None:
    pwm = board.tp_pwms[1]
    before = getattr(pwm, name)
    words.clear()
    with pytest.raises(ValueError, match=f"three-phase PWM 1: .*{wrong}"):
        setattr(pwm, name, wrong)
    assert getattr(pwm, name) == before
    assert words == {}


def test_the_sample_point_and_the_scale(board: Board, words: dict[int, int]) -> None:
    pwm = board.tp_pwms[0]
    pwm.sample_time = 0.25
    assert words[SETUP] >> 16 & 0x7FF == 512
    pwm.enable = True
    pwm.a = 1.0
    pwm.scale = 2.0
    assert pwm.word() & 0x3FF == 768, "half of what it was"


def test_it_prints_its_state(board: Board, emulated: EmulatedBoard) -> None:
    pwm = board.tp_pwms[1]
    assert repr(pwm).startswith("<TpPwm 1 off")
    pwm.enable = True
    assert repr(pwm).startswith("<TpPwm 1 on")
    emulated.pin(FAULT + 8).drive(0)
    emulated.advance(10.0)
    board.cycle.run()
    assert repr(pwm).startswith("<TpPwm 1 FAULT")
