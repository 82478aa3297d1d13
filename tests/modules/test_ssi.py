"""SSI encoders: control words of fact sheet registers 2.14, formats, busy and new data, wrap-around."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

import hostmot2
from hostmot2._core import ffi, lib
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.modules.absolute_format import parse_format
from tests.modules.module_card import CLOCK_LOW, ModuleWords, module_card, pin
from tests.modules.waveform import edges

SSI, BASE, DPLL = 0x08, 0x6900, 0x1A
DATA0, DATA1, CONTROL, START = range(BASE, BASE + 0x400, 0x100)
CARD = module_card(
    ModuleWords(DPLL, 0x7000, 7),
    ModuleWords(SSI, BASE, 4, instances=3, multiple=0x03),
    pins=tuple(pin(SSI, number, unit) for unit in range(3) for number in (0x81, 0x82, 0x03)),
)


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard(CARD, clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


def gray(value: int) -> int:
    return value ^ value >> 1


def exchange(board: Board, emulated: EmulatedBoard, us: float = 1000.0) -> None:
    board.cycle.run()
    emulated.advance(us)


def test_the_control_word(board: Board, emulated: EmulatedBoard) -> None:
    encoder = board.ssis[2]
    encoder.start("%1pposition%24e", frequency=500e3)
    rate = round(500e3 * 65536 / CLOCK_LOW)
    assert emulated.read(CONTROL + 8) == rate << 16 | 1 << 8 | 25
    assert encoder.frequency == pytest.approx(500e3, rel=2e-3)
    encoder.start("position%25e", timer=2)
    assert emulated.read(CONTROL + 8) == rate << 16 | 2 << 12 | 1 << 9 | 25
    encoder.stop()
    assert emulated.read(CONTROL + 8) == 0


@pytest.mark.parametrize("frequency", [0.0, 700.0, 100e6, float("nan"), float("inf")])
def test_clocks_the_divider_cannot_make_are_refused(board: Board, frequency: float) -> None:
    with pytest.raises(ValueError, match="Hz"):
        board.ssis[0].start("a%10u", frequency=frequency)


def test_a_reading_is_that_of_the_exchange_before(board: Board, emulated: EmulatedBoard) -> None:
    emulated.ssi(0).value = 0b1_1010_1100_0000_1111
    encoder = board.ssis[0]
    encoder.start("error%1bstatus%4sposition%12e")
    exchange(board, emulated)
    assert encoder.data is None
    assert encoder.values == {}
    assert not encoder.fresh
    exchange(board, emulated)
    assert encoder.fresh
    assert encoder.values == {"error": True, "status": -6, "position": 0xC0F}
    assert encoder.count == 0xC0F


def test_a_transfer_under_way_gives_nothing_new(board: Board, emulated: EmulatedBoard) -> None:
    emulated.ssi(0).value = 100
    encoder = board.ssis[0]
    encoder.start("position%20e", frequency=100e3)  # 200 us
    exchange(board, emulated, 1000.0)
    exchange(board, emulated, 150.0)
    emulated.ssi(0).value = 200
    exchange(board, emulated, 100.0)
    assert (encoder.fresh, encoder.missed, encoder.count) == (False, 1, 100)
    exchange(board, emulated, 100.0)
    assert (encoder.fresh, encoder.missed, encoder.count) == (True, 0, 100)
    exchange(board, emulated, 1000.0)
    exchange(board, emulated, 1000.0)
    assert encoder.count == 200


def test_what_an_earlier_transfer_left_is_no_reading(board: Board, emulated: EmulatedBoard) -> None:
    encoder = board.ssis[0]
    emulated.ssi(0).value = 0x3FF
    encoder.start("position%10e")
    exchange(board, emulated)
    encoder.stop()
    encoder.start("speed%10u", timer=4)
    exchange(board, emulated)
    assert (encoder.fresh, encoder.values) == (False, {})


@pytest.mark.parametrize(
    ("busy", "control", "fresh"), [(0, 1, 1), (1, 1, 0), (2, 1, 1), (0, 3, 0), (0, 0, 0)]
)
def test_only_whole_and_new_data_is_taken(busy: int, control: int, fresh: int) -> None:
    channel = ffi.new("hm2_absolute *", {"bits": 64})
    words = ffi.new("uint32_t[]", [busy, control, 0x12345678, 0x9ABCDEF0, 0])
    group = ffi.new("hm2_absolutes *")
    group.channels, group.words, group.count = channel, words, 1
    group.control_available_mask, group.control_busy_mask = 1, 2
    part = ffi.new("hm2_cyclic *")
    lib.hm2_absolutes_part(group, part)
    part.process(part.self, 0)
    assert (channel.fresh, channel.missed) == (fresh, 1 - fresh)
    assert channel.data == (0x12345678_9ABCDEF0 if fresh else 0)


def test_reading_takes_the_data(board: Board, emulated: EmulatedBoard) -> None:
    board.ssis[0].start("position%20e", frequency=100e3)
    emulated.write(START, 0)
    assert emulated.read(START) == 1
    emulated.advance(250.0)
    assert emulated.read(START) == 0
    assert emulated.read(CONTROL) >> 15 & 1 == 1
    emulated.read(DATA1)
    assert emulated.read(CONTROL) >> 15 & 1 == 1
    emulated.read(DATA0)
    assert emulated.read(CONTROL) >> 15 & 1 == 0


def test_the_clock_pin_toggles_once_per_bit(board: Board, emulated: EmulatedBoard) -> None:
    emulated.ssi(0)
    board.ssis[0].start("position%13e", frequency=500e3)
    assert emulated.pin(0).level == "1"
    board.cycle.run()
    falls = [clock for clock, level in edges(emulated, 0, 3500) if level == "0"]
    assert len(falls) + 1 == 13  # the first with the start
    assert emulated.pin(0).level == "1"


def test_gray_code_multi_turn_and_split_positions(board: Board, emulated: EmulatedBoard) -> None:
    board.ssis[0].start("position%24egm%1p")
    board.ssis[1].start("turns%12h%3pfine%13lerror%1b")
    emulated.ssi(0).value = gray(0xABCDEF) << 1
    emulated.ssi(1).value = 0x123 << 17 | 0x1042 << 1 | 1
    for _ in range(2):
        exchange(board, emulated)
    assert board.ssis[0].count == 0xABCDEF
    assert board.ssis[0].values == {"position": 0xABCDEF}
    assert board.ssis[1].count == 0x123 << 13 | 0x1042
    board.ssis[1].scale = 8192.0
    assert board.ssis[1].position == 0x123 + 0x1042 / 8192


def test_an_unplugged_encoder_reads_all_ones(board: Board, emulated: EmulatedBoard) -> None:
    board.ssis[0].start("a%40u")
    emulated.ssi(0).unplug()
    for _ in range(2):
        exchange(board, emulated)
    assert board.ssis[0].data == (1 << 40) - 1


def test_a_dpll_timer_starts_transfers(board: Board, emulated: EmulatedBoard) -> None:
    board.dpll.frequency = 1000.0
    encoder = board.ssis[0]
    encoder.start("position%10e", timer=1)
    emulated.ssi(0).value = 77
    emulated.advance(5000.0)
    board.cycle.run()
    assert (encoder.fresh, encoder.count) == (True, 77)
    board.cycle.run()
    assert not encoder.fresh
    emulated.advance(1500.0)
    board.cycle.run()
    assert encoder.fresh


@given(st.integers(2, 63), st.data())
def test_positions_go_on_over_their_wrap(bits: int, data: st.DataObject) -> None:
    channel = ffi.new("hm2_absolute *")
    channel.bits = channel.low_bits = bits
    channel.gray = 1
    half = 1 << bits - 1
    total = data.draw(st.integers(0, (1 << bits) - 1))
    lib.hm2_absolute_update(channel, gray(total))
    for step in data.draw(st.lists(st.integers(1 - half, half - 1), max_size=20)):
        if abs(total + step) >= 1 << 62:
            break
        total += step
        lib.hm2_absolute_update(channel, gray(total & (1 << bits) - 1))
        assert channel.count == total


@pytest.mark.parametrize(
    "text",
    ["", "a", "a%", "a%0u", "%4u", "a%4x", "a%65u", "a%4ua%4u", "a%4eb%4e", "a%4h", "a%4hgb%4l", "a%4u?"],
)
def test_formats_that_mean_nothing_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"\S"):
        parse_format(text, 64)


def test_settings_are_back_after_a_bite_and_gone_after_close(emulated: EmulatedBoard) -> None:
    with hostmot2.open(emulated) as board:
        board.ssis[0].start("position%20e")
        word = emulated.read(CONTROL)
        board.watchdog.arm()
        emulated.advance(60_000.0)
        with pytest.raises(hostmot2.errors.WatchdogBite):
            board.cycle.run()
        emulated.write(CONTROL, 0)
        board.watchdog.acknowledge()
        assert emulated.read(CONTROL) & 0xFFFF77FF == word & 0xFFFF77FF
        assert emulated.pin(0).level in "01", "the encoder goes on being read"
    assert emulated.read(CONTROL) & 0xFFFF0300 == 0
    assert emulated.pin(0).level == "H"


@pytest.mark.parametrize("number", [-1, 5])
def test_a_timer_that_is_not_there_is_refused(board: Board, emulated: EmulatedBoard, number: int) -> None:
    encoder = board.ssis[1]
    with pytest.raises(ValueError, match=f"no DPLL timer {number}"):
        encoder.start("position%24u", timer=number)
    assert not encoder.is_running
    assert emulated.read(CONTROL + 4) == 0


@pytest.mark.parametrize("wrong", [0.0, float("nan"), float("inf")])
def test_a_scale_that_cannot_divide_is_refused(board: Board, wrong: float) -> None:
    encoder = board.ssis[2]
    encoder.scale = -4096.0
    with pytest.raises(ValueError, match=f"SSI 2: scale {wrong}"):
        encoder.scale = wrong
    assert encoder.scale == -4096.0


def test_it_prints_no_value_before_a_reading(board: Board, emulated: EmulatedBoard) -> None:
    encoder = board.ssis[0]
    encoder.start("position%24u")
    assert repr(encoder) == "<Ssi 0 no reading>"
    emulated.ssi(0).value = 77
    for _ in range(3):
        exchange(board, emulated)
    assert repr(encoder) == "<Ssi 0 {'position': 77}>"
