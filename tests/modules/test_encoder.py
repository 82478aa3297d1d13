"""The driver's encoders on the emulated 7I77 multiplexer."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.cards import card
from hostmot2.idrom import HostMot2Warning
from hostmot2.registers import Encoder, Gtag
from tests.emulator.test_engine_skips import CARD as PROBE
from tests.modules.module_card import ModuleWords, module_card, pin, written


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


def cycles(board: Board, emulated: EmulatedBoard, milliseconds: int) -> None:
    for _ in range(milliseconds):
        emulated.advance(1000.0)
        board.cycle.run()


def test_each_encoder_counts_its_own_lines_of_the_multiplexer(board: Board, emulated: EmulatedBoard) -> None:
    assert len(board.encoders) == 6
    for encoder in board.encoders:
        encoder.filter = False
    cycles(board, emulated, 2)
    start = [encoder.count for encoder in board.encoders]
    for number in range(6):
        emulated.encoder_input(number).run(edge_period_ns=2000.0, counts=(-1) ** number * (number + 1) * 100)
    cycles(board, emulated, 5)
    moved = [encoder.count - old for encoder, old in zip(board.encoders, start, strict=True)]
    assert moved == [100, -200, 300, -400, 500, -600]


def test_without_the_drivers_select_pin_both_of_a_pair_follow_the_odd_one(emulated: EmulatedBoard) -> None:
    with hostmot2.open(emulated) as board:
        emulated.encoder_input(1).run(edge_period_ns=10_000.0, counts=40)
        emulated.advance(1000.0)
        assert [word & 0xFFFF for word in board.read(0x3500, 2)] == [40, 40]


@pytest.mark.parametrize("rate", [1e6, 4e6])
def test_velocity_ends_behind_a_change_of_the_timestamp_rate(
    board: Board, emulated: EmulatedBoard, rate: float
) -> None:
    encoder = board.encoders[0]
    encoder.filter = False
    cycles(board, emulated, 2)
    emulated.encoder_input(0).run(edge_period_ns=500_000.0, counts=400)
    cycles(board, emulated, 202)
    at = encoder.position
    assert encoder.velocity > 100
    board.encoders.modules[0].timestamp_rate = rate
    cycles(board, emulated, 1)
    assert encoder.position_interpolated == pytest.approx(at, abs=2)
    cycles(board, emulated, 600)  # more than velocity_timeout
    assert (encoder.velocity, encoder.position_interpolated) == (0.0, at)
    emulated.encoder_input(0).run(edge_period_ns=500_000.0, counts=-40)
    cycles(board, emulated, 10)
    assert encoder.velocity == pytest.approx(-2000.0, rel=0.01)


def test_a_timestamp_rate_that_was_refused_is_not_written_later(
    board: Board, emulated: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = board.encoders.modules[0]
    before = module.timestamp_rate
    board.cycle.run()
    emulated.advance(100_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()
    with pytest.raises(errors.WatchdogBite):
        module.timestamp_rate = 1e6
    seen = written(board, monkeypatch)
    board.watchdog.acknowledge()
    divider = seen[module._address(Encoder.timestamp_divider.number)]
    assert module.timestamp_rate == before == pytest.approx(board.idrom.clock_low / (divider + 2))


def test_counts_pass_the_sixteen_bits_of_the_register(board: Board, emulated: EmulatedBoard) -> None:
    encoder = board.encoders[2]
    cycles(board, emulated, 2)
    start = encoder.count
    emulated.encoder_input(2).run(edge_period_ns=1000.0, counts=200_000)
    cycles(board, emulated, 205)
    assert encoder.count - start == 200_000


@pytest.mark.parametrize("rate", [-0.5, 12.0, 1234.5, 100_000.0, 900_000.0])
def test_velocity_in_units_per_second(board: Board, emulated: EmulatedBoard, rate: float) -> None:
    encoder = board.encoders[5]
    encoder.scale = 1000.0
    encoder.velocity_timeout = 5.0
    emulated.encoder_input(5).set_rate(rate)
    cycles(board, emulated, 50 if abs(rate) > 100 else int(3200 / abs(rate)) + 100)
    assert encoder.velocity * 1000.0 == pytest.approx(rate, rel=0.005)
    assert not encoder.quad_error


def test_index_latches_where_it_is_and_makes_it_zero(board: Board, emulated: EmulatedBoard) -> None:
    encoder, wheel = board.encoders[0], emulated.encoder_input(0)
    encoder.index_active_high = True
    wheel.set(0, 0, 0)
    wheel.index_every(counts=400, width=4)
    wheel.position = 100
    cycles(board, emulated, 5)
    encoder.latch_index()
    cycles(board, emulated, 3)
    assert encoder.latching, "the index has not come yet"
    wheel.run(edge_period_ns=10_000.0, counts=450)
    cycles(board, emulated, 10)
    assert not encoder.latching
    assert encoder.events == 1
    assert encoder.count == pytest.approx(550 - 400, abs=1)


def test_open_inputs_are_no_quadrature_error(board: Board, emulated: EmulatedBoard) -> None:
    cycles(board, emulated, 5)
    assert not any(encoder.quad_error for encoder in board.encoders)


def test_a_and_b_together_are_one_and_it_stays_until_cleared(board: Board, emulated: EmulatedBoard) -> None:
    encoder, wheel = board.encoders[3], emulated.encoder_input(3)
    wheel.set(0, 0, 0)
    cycles(board, emulated, 5)
    encoder.clear_quad_error()
    wheel.set(1, 1, 0)
    cycles(board, emulated, 2)
    assert encoder.quad_error
    encoder.clear_quad_error()
    cycles(board, emulated, 3)
    assert not encoder.quad_error


def test_the_count_rate_limit_is_the_sheets(board: Board) -> None:
    encoder = board.encoders[0]
    assert encoder.max_count_rate == pytest.approx(1.0417e6, rel=1e-3)
    encoder.filter = False
    assert encoder.max_count_rate == pytest.approx(4.1667e6, rel=1e-3)
    encoder.scale = 10_000.0
    with pytest.warns(HostMot2Warning, match="lost in silence"):
        assert not encoder.check_speed(500.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert encoder.check_speed(400.0)


def test_looking_for_a_timer_selection_touches_no_neighbour_of_generation_a(emulated: EmulatedBoard) -> None:
    """0x3500 + 0x500 is the resolver's command there; without DPLL nothing may be written."""
    seen: list[int] = []
    with hostmot2.open(emulated) as board:
        write = board.write

        def watched(address: int, words: object) -> None:
            seen.append(address)
            write(address, words)  # type: ignore[arg-type]

        board.write = watched  # type: ignore[method-assign]
        assert len(board.encoders) == 6
        assert 0x3A00 not in seen
        with pytest.raises(errors.UnsupportedFirmware):
            board.encoders.modules[0].timer = 1


def test_skew_is_refused_by_firmware_without_it(board: Board) -> None:
    with pytest.raises(errors.UnsupportedFirmware, match="version 3"):
        board.encoders.modules[0].skew = 100e-9


def test_settings_reach_the_registers(board: Board, emulated: EmulatedBoard) -> None:
    module = board.encoders.modules[0]
    assert module.filter_rate == pytest.approx(33333333 / 4)
    assert module.timestamp_rate == pytest.approx(33333333 / 16)
    assert board.read(0x3700) & 0xFFFF == 14
    encoder = board.encoders[4]
    encoder.counter_mode = True
    encoder.index_gate = "high"
    encoder.index_mask = "low"
    cycles(board, emulated, 3)
    assert board.read(0x3610) & 0x7FF8 & ~0x3000 == 1 << 14 | 1 << 11 | 1 << 10 | 1 << 9 | 1 << 7
    with pytest.raises(ValueError, match="filter rate"):
        board.encoders.modules[0].filter_rate = 5e-324
    with pytest.raises(ValueError, match="filter rate"):
        module.filter_rate = 1.0
    for no_scale in (0.0, float("inf"), float("nan")):
        with pytest.raises(ValueError, match="scale"):
            encoder.scale = no_scale


@pytest.mark.parametrize("gate", ["none", "low", "high"])
def test_settings_of_the_index_read_back_and_others_are_refused(board: Board, gate: str) -> None:
    encoder = board.encoders[0]
    encoder.index_gate = encoder.index_mask = gate
    assert (encoder.index_gate, encoder.index_mask) == (gate, gate)
    with pytest.raises(ValueError, match="index gate 'both'"):
        encoder.index_gate = "both"
    with pytest.raises(ValueError, match="index mask ''"):
        encoder.index_mask = ""
    assert (encoder.index_gate, encoder.index_mask) == (gate, gate)


def test_an_index_outside_its_gate_is_not_taken(board: Board, emulated: EmulatedBoard) -> None:
    """The gate opens while A and B are both high, and the index comes while both are low."""
    encoder = board.encoders[0]
    encoder.filter, encoder.index_active_high, encoder.index_gate = False, True, "high"
    cycles(board, emulated, 3)
    encoder.latch_index()
    cycles(board, emulated, 3)
    wheel = emulated.encoder_input(0)
    wheel.set(0, 0, 0)
    cycles(board, emulated, 1)
    wheel.set(0, 0, 1)
    cycles(board, emulated, 1)
    assert encoder.latching
    wheel.set(0, 0, 0)
    cycles(board, emulated, 1)
    wheel.set(1, 1, 0)
    cycles(board, emulated, 1)
    wheel.set(1, 1, 1)
    cycles(board, emulated, 2)
    assert not encoder.latching


def test_a_latch_can_be_withdrawn(board: Board, emulated: EmulatedBoard) -> None:
    encoder = board.encoders[0]
    encoder.filter, encoder.index_active_high = False, True
    cycles(board, emulated, 3)
    encoder.latch_index()
    cycles(board, emulated, 2)
    encoder.cancel_latch()
    cycles(board, emulated, 3)
    emulated.encoder_input(0).set(0, 0, 1)
    cycles(board, emulated, 3)
    assert not encoder.latching
    assert encoder.events == 0


def test_what_an_encoder_cannot_be_told(board: Board) -> None:
    encoder, module = board.encoders[0], board.encoders.modules[0]
    for seconds in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="velocity timeout"):
            encoder.velocity_timeout = seconds
    assert encoder.velocity_timeout == 0.5
    for rate in (0.0, -1.0, 1e9, 1.0, 5e-324):
        with pytest.raises(ValueError, match="timestamp rate"):
            module.timestamp_rate = rate
    with pytest.raises(errors.UnsupportedFirmware, match="no probe input"):
        encoder.latch_probe()
    assert not encoder.latching


def test_zero_is_where_it_stands(board: Board, emulated: EmulatedBoard) -> None:
    encoder = board.encoders[0]
    encoder.filter = False
    cycles(board, emulated, 2)
    emulated.encoder_input(0).run(edge_period_ns=2000.0, counts=100)
    cycles(board, emulated, 3)
    assert encoder.count
    encoder.zero()
    assert (encoder.count, encoder.position) == (0, 0.0)
    emulated.encoder_input(0).run(edge_period_ns=2000.0, counts=7)
    cycles(board, emulated, 3)
    assert encoder.count == 7


def test_a_probe_latches_at_the_edge_that_was_asked() -> None:
    emulated = EmulatedBoard(PROBE, clock="virtual")
    emulated.encoder_input(0).set(a=0, b=0, z=0)
    emulated.pin(33).drive(1)
    with hostmot2.open(emulated) as board:
        encoder = board.encoders[0]
        encoder.probe_rising = False
        assert encoder.probe_rising is False
        cycles(board, emulated, 2)
        emulated.encoder_input(0).run(edge_period_ns=2000.0, counts=50)
        cycles(board, emulated, 2)
        encoder.latch_probe()
        cycles(board, emulated, 2)
        assert encoder.latching
        emulated.pin(33).drive(0)
        cycles(board, emulated, 2)
        assert not encoder.latching
        assert (encoder.events, encoder.latched_count) == (1, 50)


def test_a_neighbours_register_is_not_taken_for_a_timer_selection() -> None:
    emulated = EmulatedBoard(PROBE, clock="virtual")  # where plain encoders would have it, others count
    with hostmot2.open(emulated) as board:
        plain = board.encoders.modules[0]
        assert not plain.multiplexed
        with pytest.raises(errors.UnsupportedFirmware, match="cannot be sampled"):
            plain.timer = 1
        assert plain.timer is None
        assert repr(board.encoders).splitlines()[7].startswith("<Encoder 7 count 0 position 0 ")


SAMPLED = module_card(
    ModuleWords(Gtag.DPLL, 0x7000, 7),
    ModuleWords(Gtag.MUXED_ENCODER, 0x3600, 5, instances=2, version=4, multiple=3),
    ModuleWords(Gtag.MUXED_ENCODER_SELECT, 0, 0),
    pins=(
        *(pin(Gtag.MUXED_ENCODER, number) for number in (1, 2, 3)),
        pin(Gtag.MUXED_ENCODER_SELECT, 0x81),
    ),
)
FILTER, SELECT = 0x3A00, 0x3B00


def test_sampling_by_a_timer_and_after_a_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    with hostmot2.open(EmulatedBoard(SAMPLED, clock="virtual")) as board:
        (module,) = board.encoders.modules
        words = written(board, monkeypatch)
        module.timer = 3
        assert words[SELECT] == 3 << 12 | 1 << 15
        module.timer = None
        assert words[SELECT] == 0
        module.skew = 70e-9
        assert words[FILTER] >> 28 == 7
        words.clear()
        for number in (-1, 5):
            with pytest.raises(ValueError, match=f"DPLL timer {number} "):
                module.timer = number
        for seconds in (-10e-9, 160e-9):
            with pytest.raises(ValueError, match=f"skew {seconds} s is outside"):
                module.skew = seconds
        assert (module.timer, module.skew, words) == (None, pytest.approx(70e-9), {})


@pytest.mark.parametrize(("rate", "divider"), [(100e6, 0xFFF), (50e6, 0), (100e6 / 2049, 0x7FF)])
def test_filter_rates_up_to_the_clock(monkeypatch: pytest.MonkeyPatch, rate: float, divider: int) -> None:
    with hostmot2.open(EmulatedBoard(SAMPLED, clock="virtual")) as board:
        (module,) = board.encoders.modules
        words = written(board, monkeypatch)
        module.filter_rate = rate
        assert words[FILTER] & 0xFFF == divider
        assert module.filter_rate == pytest.approx(rate)


@pytest.mark.parametrize("setting", ["filter", "counter_mode", "index_active_high"])
def test_text_is_no_setting(board: Board, setting: str) -> None:
    encoder = board.encoders[0]
    before = getattr(encoder, setting)
    with pytest.raises(TypeError, match="True or False"):
        setattr(encoder, setting, "off")
    assert getattr(encoder, setting) is before


def test_a_refused_timestamp_rate_names_the_range(board: Board) -> None:
    for rate in (100.0, 20e6):
        with pytest.raises(ValueError, match=r"Hz is outside 1017\.\.16666666 Hz"):
            board.encoders.modules[0].timestamp_rate = rate


def test_a_skew_of_just_the_delay_does_not_swap_the_encoders_of_a_pair() -> None:
    """card_observed 4: no more than the delay; 80 ns are 2.7 clocks of a 5I25, and 3 would be too many."""
    known = card("5i25+7i77")
    with_skew = tuple(replace(m, version=4) if m.gtag == Gtag.MUXED_ENCODER else m for m in known.modules)
    emulated = EmulatedBoard(replace(known, modules=with_skew), clock="virtual")
    emulated.mux_delay_ns = 80.0
    with hostmot2.open(emulated) as board:
        board.encoders.modules[0].skew = 80e-9
        assert board.encoders.modules[0].skew == pytest.approx(60e-9, rel=1e-3)
        board.cycle.run()
        emulated.encoder_input(0).set_rate(10_000)
        emulated.encoder_input(1)
        for _ in range(10):
            emulated.advance(1000.0)
            board.cycle.run()
        assert (board.encoders[0].count, board.encoders[1].count) == (pytest.approx(100, abs=2), 0)
