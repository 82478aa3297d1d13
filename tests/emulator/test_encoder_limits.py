"""How fast encoders may turn, and what happens beyond: the laws of fact sheet card observed 4 and 5."""

from __future__ import annotations

import pytest

from hostmot2.emulator import EmulatedBoard
from tests.emulator.test_encoder_reference import CARD as PLAIN
from tests.emulator.test_engine_skips import CARD as PROBE

FILTER_15, COUNTER_MODE = 0x800, 0x400
ERROR = 0x8000


def signed(value: int) -> int:
    return (value & 0xFFFF) - (0x10000 if value & 0x8000 else 0)


def muxed(control: int = 0, rate: int = 2, deskew: int = 0) -> EmulatedBoard:
    board = EmulatedBoard("5i25+7i77x2", clock="virtual")
    for number in range(12):
        board.encoder_input(number).set(a=0, b=0, z=0)
        board.write(0x3600 + 4 * number, control)
    for port in (0, 4):
        board.write(0x1200 + port, 0x80)
        board.write(0x1100 + port, 0x80)
    board.write(0x3900, deskew << 28 | rate)
    board.advance_clocks(1000)
    return board


def run(board: EmulatedBoard, number: int, period: float, counts: int) -> int:
    board.encoder_input(number).run(period, counts)
    board.advance(abs(counts) * period / 1000 + 100)
    return signed(board.read(0x3500 + 4 * number))


@pytest.mark.parametrize(("rate", "tick"), [(0, 60), (1, 90), (2, 120), (6, 240), (0xFFF, 30), (0x800, 30)])
@pytest.mark.parametrize(("control", "ticks"), [(0, 2), (FILTER_15, 8)])
def test_muxed_encoders_take_an_edge_every_2_or_8_ticks(
    rate: int, tick: int, control: int, ticks: int
) -> None:
    limit = tick * ticks
    assert run(muxed(control, rate), 5, limit, 400) == 400
    assert run(muxed(control, rate), 5, limit, -400) == -400
    beyond = run(muxed(control, rate), 5, limit * 0.98, 400)
    assert 0 < beyond < 400
    assert beyond % 4 == 0  # they go missing in whole cycles


def test_far_beyond_the_limit_it_counts_backwards_and_says_nothing() -> None:
    board = muxed()
    assert run(board, 0, 160, 1000) < 0
    assert board.read(0x3600) & ERROR == 0


@pytest.mark.parametrize(("control", "period"), [(0, 960), (FILTER_15, 3840)])
def test_counter_mode_takes_a_pulse_every_8_or_32_ticks(control: int, period: int) -> None:
    for time, complete in ((period, True), (period * 0.9, False)):
        board = muxed(control | COUNTER_MODE)
        board.encoder_input(2).pulses(time, -40)
        board.advance(time * 40 / 1000 + 20)
        assert (signed(board.read(0x3508)) == -40) == complete
        assert board.read(0x3608) & ERROR == 0


@pytest.mark.parametrize("delay", [5, 20, 35, 65, 95, 125])
@pytest.mark.parametrize("deskew", range(5))
def test_deskew_must_fit_the_delay_of_the_multiplexer(delay: int, deskew: int) -> None:
    board = muxed(deskew=deskew)
    board.mux_delay_ns = delay
    board.advance_clocks(1000)
    fits = delay - 120 <= deskew * 30 <= delay
    run(board, 0, 2000, 20)
    counts = [signed(board.read(0x3500 + 4 * number)) for number in (0, 1)]
    assert counts == ([20, 0] if fits else [0, 20])  # too large is as bad as too small


def test_undriven_select_pins_show_the_odd_encoder_twice() -> None:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    for number in (0, 1):
        board.encoder_input(number).set(a=0, b=0, z=0)
    board.advance_clocks(100)
    run(board, 0, 2000, 5)
    run(board, 1, 2000, 8)
    assert [signed(board.read(0x3500 + 4 * number)) for number in (0, 1)] == [8, 8]


def test_unconnected_inputs_power_up_with_a_quadrature_error() -> None:
    board = EmulatedBoard("5i25+7i77x2", clock="virtual")
    board.advance_clocks(200)
    assert [board.read(0x3600 + 4 * number) for number in range(12)] == [0x8003] * 12
    board.write(0x3600, 0)
    assert board.read(0x3600) == 0x0003


@pytest.mark.parametrize("card", [PLAIN, PROBE], ids=["plain", "probe"])
@pytest.mark.parametrize(
    ("rate", "control", "limit"), [(0, 0, 90), (0, FILTER_15, 450), (0xFFF, 0, 45), (0xFFF, FILTER_15, 225)]
)
def test_plain_encoders_take_an_edge_every_half_filter_time(
    card: object, rate: int, control: int, limit: int
) -> None:
    for period, complete in ((limit, True), (limit * 0.97, False)):
        board = EmulatedBoard(card, clock="virtual")  # type: ignore[arg-type]
        encoder = board.encoder_input(0)
        encoder.set(a=0, b=0, z=0)
        board.write(0x3400, rate)
        board.write(0x3100, control)
        board.advance_clocks(1000)
        encoder.run(period, 400)
        board.advance(100)
        board.advance(400 * period / 1000)
        assert (signed(board.read(0x3000)) == 400) == complete
        assert board.read(0x3100) & ERROR == 0


@pytest.mark.parametrize(("counts", "latched", "left"), [(45, 29, 15), (-45, 31, -15)])
def test_an_index_latches_the_count_before_the_edge_it_comes_with(
    counts: int, latched: int, left: int
) -> None:
    board = muxed()
    encoder = board.encoder_input(0)
    if counts < 0:  # come from above
        run(board, 0, 2000, 60)
    encoder.index_every(1000, 0)
    board.advance(10.0)
    board.write(0x3600, 0x08)
    board.advance(10.0)
    board.write(0x3600, 0x08 | 0x10 | 0x20 | 0x40)  # index high: latch and clear, just once
    encoder.run(3000, counts)
    board.advance(3.0 * 29 + 1.5)
    encoder.index_every(30, 1)  # Z with the edge to position 30
    board.advance(100.0)
    control = board.read(0x3600)
    assert control >> 16 == latched
    assert control & 0x70 == 0x40  # both enables went off together
    assert signed(board.read(0x3500)) == left


@pytest.mark.parametrize(("clocks", "taken"), [(4, False), (6, True)])
def test_the_probe_is_filtered(clocks: int, taken: bool) -> None:
    board = EmulatedBoard(PROBE, clock="virtual")
    encoder = board.encoder_input(0)
    encoder.set(a=0, b=0, z=0)
    board.pin(33).drive(0)
    board.advance_clocks(100)
    encoder.run(1000, 7)
    board.advance(20)
    board.write(0x3100, 0x3040)  # latch on the probe's rise, just once
    board.advance_clocks(10)
    board.pin(33).drive(1)
    board.advance_clocks(clocks)
    board.pin(33).drive(0)
    board.advance(5)
    assert board.read(0x3100) >> 16 == (7 if taken else 0)
    assert bool(board.read(0x3100) & 0x2000) is not taken
    assert board.read(0x3100) & 0x40
