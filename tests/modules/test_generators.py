"""Step and PWM generators, DPLL: what settings put into the registers (fact sheet registers 2.7 to 2.9)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.registers import Pwmgen, PwmgenOutput, StepgenMode
from tests.modules.module_card import ModuleWords, module_card, pin, written

STEPGEN, PWMGEN, DPLL = 0x05, 0x06, 0x1A
STEP, PWM, SYNC = 0x2000, 0x4100, 0x7000
CARD = module_card(
    ModuleWords(STEPGEN, STEP, 10, instances=2, version=2, multiple=0x1FF),
    ModuleWords(PWMGEN, PWM, 5, instances=2, multiple=3, clock=2),
    ModuleWords(DPLL, SYNC, 7),
    pins=(
        *(pin(STEPGEN, 0x81 + n, unit) for unit in range(2) for n in range(2)),
        *(pin(PWMGEN, 0x81 + n, unit) for unit in range(2) for n in range(3)),
    ),
)


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard(CARD, clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


# ---- step generators


def test_pulse_times_are_rounded_up_to_clocks(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    stepgen = board.stepgens[1]
    seen = written(board, monkeypatch)
    stepgen.set_times(step_length=1e-6, step_space=2.001e-6, direction_setup=5e-9, direction_hold=0)
    registers = {
        name: seen[STEP + 0x100 * n + 4]
        for name, n in (("setup", 3), ("hold", 4), ("length", 5), ("space", 6))
    }
    assert registers == {"setup": 1, "hold": 0, "length": 99, "space": 198}  # N + 1 and N + 3 clocks of 10 ns
    assert stepgen.max_step_rate == pytest.approx(1e8 / 301)


@pytest.mark.parametrize("wrong", [-1e-9, math.nan, 1.0, math.inf, 1e308])
def test_pulse_times_that_cannot_be(board: Board, wrong: float) -> None:
    with pytest.raises(ValueError, match="step_space"):
        board.stepgens[0].set_times(step_space=wrong)
    with pytest.raises(TypeError, match="step_length"):
        board.stepgens[0].set_times(pulse=1e-6)


def test_modes_and_tables(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    stepgen = board.stepgens[0]
    seen = written(board, monkeypatch)
    stepgen.mode = StepgenMode.QUADRATURE
    assert seen[STEP + 0x200] == 2
    with pytest.raises(ValueError, match="set_table"):
        stepgen.mode = StepgenMode.TABLE
    with pytest.raises(ValueError, match="1 to 16"):
        stepgen.set_table([])
    stepgen.set_table([1, 3, 2])
    assert (seen[STEP + 0x200], seen[STEP + 0x700], seen[STEP + 0x800]) == (3, 1, 2)
    assert stepgen.mode is StepgenMode.TABLE


@pytest.mark.parametrize("wrong", [-1, 1 << 32, "3", 2.5])
def test_a_table_that_cannot_be_is_not_written_in_part(
    board: Board, monkeypatch: pytest.MonkeyPatch, wrong: Any
) -> None:
    stepgen = board.stepgens[0]
    stepgen.set_table([1, 3, 2])
    seen = written(board, monkeypatch)
    with pytest.raises((TypeError, ValueError)):
        stepgen.set_table([wrong, 5, 6])
    assert seen == {}, "a running generator would step through a mixture of both"


def test_what_the_hardware_cannot_do_is_refused(board: Board) -> None:
    with pytest.raises(errors.UnsupportedFirmware, match="swap"):
        board.stepgens[0].swap_outputs()
    with pytest.raises(errors.UnsupportedFirmware, match="index"):
        board.stepgens[0].latch_index()


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("scale", 0),
        ("scale", math.inf),
        ("max_velocity", 0),
        ("max_velocity", math.nan),
        ("max_acceleration", -1),
    ],
)
def test_settings_that_cannot_be(board: Board, name: str, wrong: float) -> None:
    with pytest.raises(ValueError, match="stepgen 0"):
        setattr(board.stepgens[0], name, wrong)


def run(board: Board, emulated: EmulatedBoard, cycles: int) -> None:
    for _ in range(cycles):
        emulated.advance(1000.0)
        board.cycle.run()


def test_a_generator_runs_only_while_enabled(board: Board, emulated: EmulatedBoard) -> None:
    stepgen = board.stepgens[0]
    stepgen.scale, stepgen.max_acceleration = 100.0, 0.0
    stepgen.set_times(step_length=1e-6, step_space=1e-6)
    stepgen.velocity_command = 50.0  # 5 kHz
    run(board, emulated, 10)
    assert (stepgen.position, stepgen.velocity, stepgen.count) == (0.0, 0.0, 0)
    stepgen.enable = True
    run(board, emulated, 100)
    assert stepgen.velocity == 50.0
    assert stepgen.position == pytest.approx(5.0, abs=0.2)
    assert "on" in repr(stepgen)
    stepgen.enable = False
    at = stepgen.position
    run(board, emulated, 20)
    assert stepgen.position == pytest.approx(at, abs=0.001)  # at once, not with the next exchange
    board.cycle.run()
    here = stepgen.position
    run(board, emulated, 20)
    assert stepgen.position == here


def test_a_position_is_followed_within_the_limits(board: Board, emulated: EmulatedBoard) -> None:
    stepgen = board.stepgens[1]
    stepgen.scale, stepgen.max_velocity, stepgen.max_acceleration = -200.0, 40.0, 400.0
    stepgen.set_times(step_length=1e-6, step_space=1e-6)
    assert (stepgen.scale, stepgen.max_velocity, stepgen.max_acceleration) == (-200.0, 40.0, 400.0)
    stepgen.enable = True
    stepgen.position_command = 1.0
    fastest = 0.0
    for _ in range(300):
        run(board, emulated, 1)
        fastest = max(fastest, abs(stepgen.velocity))
    assert 10.0 < fastest <= 40.0
    assert stepgen.position == pytest.approx(1.0, abs=0.01)
    assert stepgen.count == pytest.approx(-200, abs=2)


# ---- PWM generators


def values(board: Board) -> list[int]:
    return [generator.word() for generator in board.pwmgens]


def test_magnitude_and_direction(board: Board) -> None:
    generator = board.pwmgens[0]
    generator.scale = 10.0
    generator.value = 5.0
    assert generator.word() == 0  # off
    generator.enable = True
    full = (1 << generator.bits) - 1
    assert generator.duty == 0.5
    assert generator.word() == full // 2 << 16
    generator.value = -5.0
    assert generator.word() == full // 2 << 16 | 1 << 31
    generator.value = 25.0
    assert (generator.duty, generator.word()) == (1.0, full << 16)
    generator.value = math.nan
    assert (generator.duty, generator.word()) == (0.0, 0)
    generator.enable = False
    generator.value = 5.0
    assert (generator.word(), values(board)) == (0, [0, 0])


def test_offset_mode_has_half_duty_at_0(board: Board) -> None:
    generator = board.pwmgens[1]
    generator.offset_mode = True
    assert generator.word() == 0  # off is no duty at all
    generator.enable = True
    half = 1 << generator.bits - 1
    assert generator.word() == half << 16
    generator.value = -1.0
    assert generator.word() == 1 << 16
    generator.value = 1.0
    assert generator.word() == 2 * half - 1 << 16


@pytest.mark.parametrize("wrong", ["0.5", b"1", None])
def test_a_value_that_is_no_number_leaves_the_others_to_be_switched_off(board: Board, wrong: Any) -> None:
    first, second = board.pwmgens
    first.enable = second.enable = True
    second.value = 1.0
    with pytest.raises(TypeError):
        first.value = wrong
    assert first.value == 0.0
    second.value = 0.0
    assert values(board) == [0, 0]
    first.enable = False
    with pytest.raises(TypeError):
        first.value = wrong  # a generator that is off refuses it at once, not when it is switched on
    first.enable = True


def test_mode_and_enable_registers(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = board.pwmgens
    seen = written(board, monkeypatch)
    second.output = PwmgenOutput.UP_DOWN
    assert seen[PWM + 0x104] >> 3 & 3 == 2
    assert seen[PWM + 0x104] >> 5 & 1 == 1
    first.output = PwmgenOutput.PDM_DIRECTION
    assert first.bits == 12
    assert seen[PWM + 0x100] >> 3 & 7 == 3  # not buffered
    second.enable = True
    assert seen[PWM + 0x400] == 2
    second.enable = False
    assert seen[PWM + 0x400] == 0
    with pytest.raises(ValueError, match="scale 0"):
        first.scale = 0
    assert "off" in repr(first)


def test_frequencies_choose_the_resolution(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    generators = board.pwmgens
    seen = written(board, monkeypatch)
    generators.frequency = 20_000.0
    assert generators.frequency == pytest.approx(20_000.0, rel=1e-3)
    wide = generators[0].bits
    generators.frequency = 150_000.0
    assert generators[0].bits < wide
    rate, clock = seen[PWM + 0x200], 200_000_000
    assert rate * clock / 65536 / 2 ** generators[0].bits == pytest.approx(150_000.0, rel=1e-3)
    generators.pdm_frequency = 1_000_000.0
    assert seen[PWM + 0x300] == round(1e6 * 65536 / clock)
    for wrong in (0.0, 1e9):
        with pytest.raises(ValueError, match="PWM frequency"):
            generators.frequency = wrong
        with pytest.raises(ValueError, match="PDM frequency"):
            generators.pdm_frequency = wrong


@pytest.mark.parametrize("name", ["pwmgens", "stepgens"])
def test_the_text_off_does_not_switch_on(board: Board, name: str) -> None:
    generator: Any = getattr(board, name)[0]
    for text in ("off", b"0"):
        with pytest.raises(TypeError, match="True or False"):
            generator.enable = text
    assert generator.enable is False
    assert not any(board.ioport.is_output(pin) for pin in board.pins)


def bits_of(mode: int) -> int:
    return 12 if Pwmgen.mode.output.get(mode) == PwmgenOutput.PDM_DIRECTION else 9 + (mode & 3)


def duties(board: Board, monkeypatch: pytest.MonkeyPatch, instance: int) -> list[float]:
    """The duty of one generator as its registers stand behind each write from now on."""
    seen: dict[int, int] = {}
    found: list[float] = []
    real = board.write

    def write(address: int, words: int | list[int]) -> None:
        for n, word in enumerate([words] if isinstance(words, int) else words):
            seen[address + 4 * n] = word
        real(address, words)
        value, mode = seen.get(PWM + 4 * instance), seen.get(PWM + 0x100 + 4 * instance)
        if value is not None and mode is not None:
            found.append((value >> 16 & 0x7FFF) / 2 ** bits_of(mode))

    monkeypatch.setattr(board, "write", write)
    return found


def test_a_duty_stays_what_it_is_at_another_frequency_or_output(
    board: Board, monkeypatch: pytest.MonkeyPatch
) -> None:
    generators = board.pwmgens
    generator = generators[1]
    found = duties(board, monkeypatch, 1)
    generator.enable = True
    generator.value = 0.5
    generators.write_now()
    changes: list[tuple[Any, str, Any]] = [
        (generators, "frequency", 150_000.0),
        (generator, "output", PwmgenOutput.PDM_DIRECTION),
        (generator, "output", PwmgenOutput.UP_DOWN),
        (generators, "frequency", 20_000.0),
    ]
    for on, name, value in changes:
        setattr(on, name, value)
        assert found[-1] == pytest.approx(0.5, abs=1 / 512), (name, value)
    assert max(found) <= 0.5


# ---- DPLL


def test_timers_before_the_exchange_are_positive_in_hardware(
    board: Board, monkeypatch: pytest.MonkeyPatch
) -> None:
    """registers.md: the hardware's value is -time / period * 65536."""
    dpll = board.dpll
    dpll.frequency = 1000.0
    seen = written(board, monkeypatch)
    dpll.set_timer(1, -100e-6)
    dpll.set_timer(4, 250e-6)
    assert seen[SYNC + 0x400] == int(0.1 * 65536)
    assert seen[SYNC + 0x500] == (-int(0.25 * 65536) & 0xFFFF) << 16
    assert (dpll.timer(1), dpll.timer(2), dpll.timer(4)) == (-100e-6, 0.0, 250e-6)
    for number, seconds in ((0, 0.0), (5, 0.0), (1, 1e-3), (1, -2e-3)):
        with pytest.raises(ValueError, match="DPLL timer"):
            dpll.set_timer(number, seconds)


def test_a_frequency_that_cannot_be(board: Board) -> None:
    for hertz in (0.0, -1.0, 1e9, math.inf, 1e308, 5e-324, math.nan):
        with pytest.raises(ValueError, match="DPLL frequency"):
            board.dpll.frequency = hertz
    assert board.dpll.frequency == 1000.0


def test_the_loop_settles_on_the_exchanges(board: Board, emulated: EmulatedBoard) -> None:
    dpll = board.dpll
    dpll.frequency = 1000.0
    run(board, emulated, 400)
    assert abs(dpll.phase_error) < 20e-6
    assert "1000 Hz" in repr(dpll)


@pytest.mark.parametrize("style", ["pipelined", "read-modify-write"])
def test_in_an_engine_the_phase_is_set_a_hundred_times_and_then_followed(board: Board, style: Any) -> None:
    """Set for ever, the card's clock would have every lateness of the exchanges."""
    board.dpll.frequency = 1000.0
    engine = board.engine(1000, dead_man=0, style=style)
    ring = engine.record()
    with engine:
        for _ in range(300):
            engine.step()
        places = {address: n for n, (address, is_write) in enumerate(engine.layout()) if is_write}
    records = ring.pop()

    def written_in(address: int) -> list[int]:
        word, bit = divmod(places[address], 32)
        return [n for n, fresh in enumerate(records["fresh"][:, word]) if fresh >> bit & 1]

    phase, control0 = written_in(SYNC + 0x100), written_in(SYNC + 0x200)
    assert phase == list(range(len(phase)))
    assert len(phase) in (99, 100)
    assert control0 == [len(phase)]  # clears the error that was filtered meanwhile


def test_firmware_that_can_swaps_step_and_direction(monkeypatch: pytest.MonkeyPatch) -> None:
    modules = tuple(replace(m, version=0x42) if m.gtag == STEPGEN else m for m in CARD.modules)
    with hostmot2.open(EmulatedBoard(replace(CARD, modules=modules), clock="virtual")) as board:
        stepgen = board.stepgens[1]
        seen = written(board, monkeypatch)
        stepgen.swap_outputs()
        swapped = seen[STEP + 0x204]
        stepgen.swap_outputs(False)
        assert swapped ^ seen[STEP + 0x204] == 1 << 2


@pytest.mark.parametrize("number", [-1, 0, 5])
def test_there_are_timers_1_to_4(board: Board, number: int) -> None:
    with pytest.raises(ValueError, match=f"timer {number} is outside"):
        board.dpll.timer(number)


def test_a_refused_frequency_names_a_range_that_it_is_outside_of(board: Board) -> None:
    for group, attribute, wrong in (
        (board.pwmgens, "frequency", 0.1),
        (board.pwmgens, "pdm_frequency", 2.0),
        (board.pwmgens, "frequency", 1e9),
    ):
        with pytest.raises(ValueError, match="Hz is") as refused:
            setattr(group, attribute, wrong)
        low, high = re.findall(r"([\d.]+)\.\.(\d+) Hz", str(refused.value))[0]
        assert not float(low) <= wrong <= float(high), refused.value
