"""Step, PWM and DPLL of the emulated card: the figures of fact sheet card observed 6 to 8."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import pytest

from hostmot2.emulator import EmulatedBoard
from hostmot2.registers import Gtag
from tests.emulator.test_engine_skips import CARD

STEP, DIRECTION, STEP1 = 17, 18, 19
PWM_A, PWM_B, PWM_ENABLE = 21, 22, 23
SYNC, REFERENCE, TIMER1 = 27, 28, 29
RATE, ACCUMULATOR, MODE, SETUP, HOLD, PULSE, IDLE, TABLE, LENGTH, MASTER = range(0x2000, 0x2A00, 0x100)
ONE_PER_CLOCK = 0x10000  # rate that moves the accumulator register by 1 with each addition
TICK_US = 0.005  # ClockHigh


def card(master: int = 0xFFFFFFFF) -> EmulatedBoard:
    board = EmulatedBoard(CARD, clock="virtual", strict=True)
    for port in (0, 4):
        board.write(0x1200 + port, 0x1FFFF)
    board.write(0x1104, 0x1FFFF & ~(1 << SYNC - 17 | 0xF << 30 - 17))
    if master:
        board.write(MASTER, master)
    board.advance_clocks(8)
    return board


def edges(board: EmulatedBoard, pin: int, clocks: int) -> list[tuple[int, str]]:
    """The changes of a pin over so many clocks: (clock, new level)."""
    found, level = [], board.pin(pin).level
    for _ in range(clocks):
        board.advance_clocks(1)
        if (now := board.pin(pin).level) != level:
            found.append((board.clocks, now))
            level = now
    return found


def lengths(changes: list[tuple[int, str]]) -> Iterator[tuple[str, int]]:
    for (start, level), (end, _) in pairwise(changes):
        yield level, end - start


# ---- step generators


def test_nothing_steps_until_the_master_rate_is_written() -> None:
    board = card(master=0)
    board.write(RATE, 0x10000000)
    board.advance_clocks(1000)
    assert board.read(ACCUMULATOR) == 0
    assert board.read(MASTER) == 0
    board.write(MASTER, 0x80000000)
    board.advance_clocks(1000)
    assert 0x1000 * (500 - 4) <= board.read(ACCUMULATOR) <= 0x1000 * 500
    board.write(MASTER, 0)
    board.advance_clocks(4)
    stopped = board.read(ACCUMULATOR)
    board.advance_clocks(1000)
    assert board.read(ACCUMULATOR) == stopped


@pytest.mark.parametrize("clocks", [1, 2, 3, 50])
def test_a_rate_acts_with_the_next_clock(clocks: int) -> None:
    board = card()
    board.write(RATE, ONE_PER_CLOCK)
    board.advance_clocks(clocks)
    assert board.read(ACCUMULATOR) == clocks


@pytest.mark.parametrize(("pulse", "idle"), [(1, 1), (2, 1), (10, 2), (1, 4), (40, 7), (3, 0)])
def test_pulse_and_idle_times_at_the_highest_rate(pulse: int, idle: int) -> None:
    board = card()
    board.write(PULSE, pulse)
    board.write(IDLE, idle)
    board.write(RATE, 0x40000000)  # a step every four clocks: more than fits
    high, low = pulse + 1, idle + 3 if idle else 2
    changes = edges(board, STEP, 12 * (high + low))[1:]
    assert {length for level, length in lengths(changes) if level == "1"} == {high}
    assert {length for level, length in lengths(changes) if level == "0"} == {low}


def test_no_step_is_lost_when_the_generator_holds() -> None:
    board = card()
    board.write(PULSE, 20)
    board.write(IDLE, 20)
    board.write(RATE, 0x20000000)
    pulses = [change for change in edges(board, STEP, 2000) if change[1] == "1"]
    assert board.read(ACCUMULATOR) >> 16 == len(pulses)


def test_a_pulse_of_length_0_never_ends() -> None:
    board = card()
    board.write(IDLE, 5)
    board.write(RATE, 0x10000000)
    assert [level for _, level in edges(board, STEP, 500)] == ["1"]


def test_direction_waits_for_hold_and_the_step_for_setup() -> None:
    board = card()
    for register, value in ((PULSE, 3), (IDLE, 3), (HOLD, 30), (SETUP, 50), (RATE, 0x08000000)):
        board.write(register, value)
    rise = edges(board, STEP, 40)[0][0]
    board.write(RATE, (1 << 32) - 0x08000000)
    step: list[int] = []
    turn = 0
    levels = (board.pin(STEP).level, board.pin(DIRECTION).level)
    for _ in range(300):
        board.advance_clocks(1)
        now = (board.pin(STEP).level, board.pin(DIRECTION).level)
        if now[0] == "1" and levels[0] == "0":
            step.append(board.clocks)
        if now[1] != levels[1]:
            turn = board.clocks
        levels = now
    assert turn == rise + 30 + 1
    assert step[0] == turn + 50 + 2
    board.write(RATE, 0)  # counts as up
    board.advance_clocks(100)
    assert board.pin(DIRECTION).level == "0"


@pytest.mark.parametrize(("before", "after", "pulses"), [(0x8000, 0, 1), (0, 0x8000, 0), (0x8000, 0x8001, 0)])
def test_writing_the_accumulator_can_make_a_step(before: int, after: int, pulses: int) -> None:
    board = card()
    board.write(PULSE, 3)
    board.write(IDLE, 3)
    board.write(ACCUMULATOR, before)
    board.advance_clocks(50)
    board.write(ACCUMULATOR, after)
    written = board.clocks
    changes = edges(board, STEP, 50)
    assert changes[:1] == [(written + 1, "1")][:pulses]
    assert board.read(ACCUMULATOR) == after


def test_up_down_and_quadrature_and_table_outputs() -> None:
    board = card()
    board.write(PULSE, 3)
    board.write(IDLE, 3)
    board.write(MODE, 1)
    board.write(RATE, 0x02000000)
    assert edges(board, STEP, 600)
    assert not edges(board, DIRECTION, 600)
    board.write(RATE, (1 << 32) - 0x02000000)
    board.advance_clocks(300)
    assert edges(board, DIRECTION, 600)
    assert not edges(board, STEP, 600)
    board.write(MODE, 2)
    shown = []
    for quarter in range(4):
        board.write(ACCUMULATOR, quarter << 14)
        board.write(RATE, 0)
        shown.append((board.pin(STEP).level, board.pin(DIRECTION).level))
    assert shown == [("0", "0"), ("1", "0"), ("1", "1"), ("0", "1")]
    board.write(MODE, 3)
    for word in (1, 2, 3):  # last first
        board.write(TABLE, word)
    board.write(LENGTH, 2)
    assert (board.pin(STEP).level, board.pin(DIRECTION).level) == ("1", "1")


# ---- PWM


def samples(board: EmulatedBoard, pin: int, count: int) -> str:
    levels = []
    for _ in range(count):
        board.advance(TICK_US)
        levels.append(board.pin(pin).level)
    return "".join(levels)


@pytest.mark.parametrize("bits", [9, 10])
@pytest.mark.parametrize("share", [0.0, 0.25, 0.9])
def test_pwm_is_high_for_value_out_of_its_cycle(bits: int, share: float) -> None:
    board = card()
    value = int(share * 2**bits)
    board.write(0x4100, bits - 9)
    board.write(0x4200, 0x8000)  # a count every second edge
    board.write(0x4000, value << 16)
    board.advance(20.0)
    assert samples(board, PWM_A, 2 << bits).count("1") == 2 * value


def test_pwm_extremes() -> None:
    board = card()
    board.write(0x4200, 0x8000)
    for value, high in ((511, 1022), (512, 1024), (4095, 1024)):
        board.write(0x4000, value << 16)
        board.advance(20.0)
        assert samples(board, PWM_A, 1024).count("1") == high


def test_symmetric_pwm_has_one_pulse_in_twice_the_time() -> None:
    board = card()
    board.write(0x4100, 4)
    board.write(0x4200, 0x8000)
    board.write(0x4000, 100 << 16)
    board.advance(30.0)
    levels = samples(board, PWM_A, 2048)
    assert levels.count("1") == 2 * 2 * 100
    assert (levels + levels[0]).count("01") == 1


@pytest.mark.parametrize(
    ("mode", "value", "busy", "other"),
    [
        (0, 0x00800000, PWM_A, (PWM_B, "0")),
        (0, 0x80800000, PWM_A, (PWM_B, "1")),
        (0x08, 0x80800000, PWM_B, (PWM_A, "1")),
        (0x10, 0x00800000, PWM_B, (PWM_A, "0")),
        (0x10, 0x80800000, PWM_A, (PWM_B, "0")),
    ],
)
def test_output_modes(mode: int, value: int, busy: int, other: tuple[int, str]) -> None:
    board = card()
    board.write(0x4100, mode)
    board.write(0x4200, 0xFFFF)
    board.write(0x4000, value)
    board.advance(20.0)
    assert set(samples(board, busy, 600)) == {"0", "1"}
    assert set(samples(board, other[0], 600)) == {other[1]}


def test_pdm_has_the_density_of_its_value() -> None:
    board = card()
    board.write(0x4100, 0x18)
    board.write(0x4300, 0x8000)
    board.write(0x4000, 1000 << 16)
    board.advance(1.0)
    assert samples(board, PWM_A, 2 * 4096).count("1") == 2 * 1000


def test_buffered_value_waits_for_the_cycle() -> None:
    board = card()
    board.write(0x4100, 0x20)
    board.write(0x4200, 0x8000)
    board.write(0x4000, 100 << 16)
    board.advance(20.0)
    levels = ""
    while not levels.endswith("01"):
        levels += samples(board, PWM_A, 1)
        assert len(levels) < 4096
    cycle = samples(board, PWM_A, 60)
    board.write(0x4000, 300 << 16)
    cycle += samples(board, PWM_A, 1023 - 60)
    assert cycle.count("1") == 2 * 100 - 1  # one sample is behind us
    assert samples(board, PWM_A, 1024).count("1") == 2 * 300


def test_enable_register_reads_back_and_gates_nothing() -> None:
    board = card()
    assert board.pin(PWM_ENABLE).level == "1"
    board.write(0x4400, 0xFFFFFFFF)
    assert board.read(0x4400) == 3
    assert board.pin(PWM_ENABLE).level == "0"


# ---- DPLL and interrupt


def dpll(board: EmulatedBoard, base: int = 0, limit: int = 0x400000) -> None:
    board.write(0x7200, 0x01000000 | limit)
    board.write(0x7300, 0x00010000)
    board.advance_clocks(66_000)  # the countdowns from power-up
    board.write(0x7300, 0xFFFF0000)
    board.write(0x7000, base)
    board.write(0x7200, 0x01000000 | limit)


@pytest.mark.parametrize(
    ("phase", "limit", "correction"),
    [(0x1EA4A8C1, 0x400000, 0x01EA4A), (0xE652BD3B, 0x400000, 0xFE652B), (0x1EA4A8C1, 0x100, 0x10)],
)
def test_a_sync_read_gives_the_phase_and_a_sixteenth_of_it_as_correction(
    phase: int, limit: int, correction: int
) -> None:
    board = card()
    dpll(board, limit=limit)
    board.write(0x7100, phase)
    assert board.read(0x7600) == phase
    board.advance_clocks(4)
    assert board.read(0x7200) == 0x01000000 | correction
    assert board.read(0x7300) == 0xFFFF002A
    board.write(0x7200, 0x01000000 | limit)
    board.advance_clocks(4)
    assert board.read(0x7200) == 0x01000000


def test_base_rate_is_unsigned_and_a_prescale_of_0_is_256() -> None:
    board = card()
    dpll(board)
    board.write(0x7100, 0)
    board.write(0x7000, 0xFFFFFFFF)
    board.advance_clocks(1024)
    assert board.read(0x7100) == 0xFFFFFFFF * 1024 >> 10
    board.write(0x7200, 0x00400000)
    board.advance_clocks(2)
    before = board.read(0x7100)
    board.advance_clocks(256 * 8)
    assert board.read(0x7100) - before & 0xFFFFFFFF in (0xFFFFFFFF * 8 >> 10, (0xFFFFFFFF * 8 >> 10) + 1)


def test_a_timer_rises_a_clock_behind_its_phase_and_the_reference_at_0() -> None:
    board = card()
    dpll(board)
    board.write(0x7400, 0x10000 - 0x0100)  # at phase 0x0100
    board.write(0x7100, 0xFFF00000)
    board.write(0x7000, 0x04000000)  # 0x10000 of the phase register a clock
    start = board.clocks
    assert edges(board, REFERENCE, 0x20) == [(start + 0x10, "1")]
    assert edges(board, TIMER1, 0x200) == [(start + 0x10 + 0x100 + 1, "1")]


def test_the_sync_pin_is_filtered() -> None:
    board = card()
    board.pin(SYNC).drive(0)
    board.advance_clocks(100)
    dpll(board)
    board.write(0x7100, 0x10000000)
    for clocks, correction in ((14, 0), (16, 0x010000)):
        board.pin(SYNC).drive(1)
        board.advance_clocks(clocks)
        board.pin(SYNC).drive(0)
        board.advance_clocks(100)
        assert board.read(0x7200) & 0xFFFFFF == correction


def test_interrupt_comes_as_the_chosen_source_falls() -> None:
    board = card()
    dpll(board)
    assert not board.interrupt
    board.write(0x0A00, 3)
    assert board.interrupt  # flag and mask loaded together
    board.write(0x0B00, 0)
    assert not board.interrupt
    board.write(0x7100, 0x7FF00000)
    board.write(0x7000, 0x04000000)  # the reference falls in sixteen clocks
    board.advance_clocks(16 + 1)
    assert not board.interrupt
    board.advance_clocks(1)
    assert board.interrupt
    assert board.read(0x0A00) == 3
    board.advance_clocks(1)
    board.write(0x0A00, 2)
    assert not board.interrupt


def test_encoder_counts_are_those_of_the_chosen_timers_event() -> None:
    moved = {Gtag.MUXED_ENCODER: 0x3600, Gtag.PWMGEN: 0x4100}  # in the generation that can
    modules = tuple(replace(m, base=moved.get(Gtag(m.gtag), m.base)) for m in CARD.modules)
    board = EmulatedBoard(replace(CARD, modules=modules), clock="virtual", strict=True)
    dpll(board)
    board.write(0x3400, 0xFFF)
    board.encoder_input(0).set_rate(1_000_000)  # a count every 33 clocks
    board.write(0x7400, 0)  # timer 1 at phase 0
    board.write(0x7100, 0)
    board.write(0x7000, 0x00400000)  # a turn takes 2^20 clocks
    board.advance_clocks(1 << 20)
    board.advance_clocks(100)
    live = board.read(0x3000) & 0xFFFF
    board.write(0x3500, 0x9000)
    assert board.read(0x3500) == 0x9000
    board.advance_clocks((1 << 20) - 200)
    assert abs((board.read(0x3000) & 0xFFFF) - live) <= 1  # the last event is long ago
    board.advance_clocks(200)
    now = board.read(0x3000) & 0xFFFF
    assert abs((now - live) % 65536 - (1 << 20) * 30 // 1000 % 65536) < 20
    board.write(0x3500, 0)
    board.advance_clocks(33 * 50)
    assert ((board.read(0x3000) & 0xFFFF) - now) % 65536 > 40
