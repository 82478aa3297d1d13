"""Buffered SPI: descriptors of fact sheet registers 2.11, words and answers, FIFOs, frames of the cycle."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.stimulus import SpiWord
from tests.modules.module_card import CLOCK_LOW, ModuleWords, module_card, pin, written
from tests.modules.waveform import edges

BSPI, DBSPI, BASE = 0x0E, 0x0F, 0x5500
DESCRIPTOR, COUNT = BASE + 0x100, BASE + 0x200
NOT_FRAME, OUT, CLOCK, SELECT_0, SELECT_1 = 0, 1, 2, 4, 5
NUMBERS = (0x81, 0x82, 0x83, 0x04, 0x85, 0x86)
CARD = module_card(
    ModuleWords(BSPI, BASE, 3, instances=2, strides=0x10, multiple=7),
    pins=tuple(pin(BSPI, number, unit) for unit in (0, 1) for number in NUMBERS),
)


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard(CARD, clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


def test_descriptors_are_pushed_from_15_down(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    pushed: list[int] = []
    real = board.write
    monkeypatch.setattr(
        board,
        "write",
        lambda address, word: (
            pushed.append(word) if address == DESCRIPTOR + 4 else None,
            real(address, word),
        ),
    )
    spi = board.bspis[1]
    spi.setup(
        2,
        bits=24,
        frequency=2.5e6,
        chip_select=5,
        cpol=True,
        cpha=True,
        select_delay=4,
        keep_frame=True,
        echo=False,
    )
    assert len(pushed) == 16
    assert pushed[13] == 1 << 31 | 1 << 30 | 3 << 24 | 5 << 16 | 19 << 8 | 1 << 7 | 1 << 6 | 23
    spi.setup(0, bits=8, frequency=1e6, chip_select=0)
    assert pushed[-1] == 0x10 << 24 | 49 << 8 | 7, "0x10 stands for no delay"


@pytest.mark.parametrize(
    ("wanted", "made"), [(50e6, 50e6), (1e9, 50e6), (3e6, CLOCK_LOW / 34), (195313, CLOCK_LOW / 512)]
)
def test_the_clock_is_never_faster_than_asked(board: Board, wanted: float, made: float) -> None:
    board.bspis[0].setup(0, bits=8, frequency=wanted, chip_select=0)
    assert board.bspis[0].frequency(0) == pytest.approx(made)
    assert board.bspis[0].frequency(0) <= wanted


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"bits": 0}, "1 to 32 bits, not 0"),
        ({"bits": 33}, "1 to 32 bits, not 33"),
        ({"frequency": 0.0}, r"an SPI clock of 0.0 Hz is below \d+ Hz"),
        ({"frequency": 1e5}, r"an SPI clock of 100000.0 Hz is below \d+ Hz"),
        ({"chip_select": 16}, "16"),
        ({"select_delay": 0}, "1 to 16 clocks, not 0"),
        ({"select_delay": 17}, "1 to 16 clocks, not 17"),
        ({"channel": 16}, "channels 0 to 15, no 16"),
    ],
)
def test_what_a_descriptor_cannot_hold_is_refused(
    board: Board, settings: dict[str, float], said: str
) -> None:
    arguments = {"channel": 0, "bits": 8, "frequency": 1e6, "chip_select": 0, **settings}
    with pytest.raises(ValueError, match=said):
        board.bspis[0].setup(**arguments)  # type: ignore[arg-type]


def test_words_go_out_and_answers_come_back(board: Board, emulated: EmulatedBoard) -> None:
    spi = board.bspis[1]
    spi.setup(0, bits=16, frequency=10e6, chip_select=0)
    spi.setup(1, bits=8, frequency=1e6, chip_select=1, echo=False)
    emulated.bspi(1).answer([0x1234, 0xFF, 0xBEEF])
    assert spi.transfer([(0, 0xAAAA), (1, 0x155), (0, 0x5555)]) == [0x1234, 0xBEEF]
    assert emulated.bspi(1).sent == [
        SpiWord(0xAAAA, 16, 0, 0),
        SpiWord(0x55, 8, 1, 1),
        SpiWord(0x5555, 16, 0, 0),
    ]
    assert emulated.read(COUNT + 4) == 0
    assert spi.transfer([(0, 1)]) == [0xFFFF], "nobody answers: the input floats"


def test_reads_pop_and_count_writes_clear(board: Board, emulated: EmulatedBoard) -> None:
    board.bspis[0].setup(3, bits=32, frequency=50e6, chip_select=0)
    emulated.bspi(0).answer([1, 2, 3])
    for word in range(3):
        emulated.write(BASE + 4 * 3, word)
    assert emulated.read(COUNT) == 3 << 8
    emulated.advance(10.0)
    assert emulated.read(COUNT) == 3
    assert emulated.read(BASE) == 1
    assert emulated.read(BASE + 0x3C) == 2
    assert emulated.read(COUNT) == 1
    emulated.write(COUNT, 0)
    assert emulated.read(COUNT) == 0


def test_a_word_on_the_pins(board: Board, emulated: EmulatedBoard) -> None:
    spi = board.bspis[0]
    spi.setup(1, bits=4, frequency=1e6, chip_select=1, echo=False)
    assert [emulated.pin(n).level for n in (NOT_FRAME, OUT, CLOCK, SELECT_0, SELECT_1)] == list("10011")
    emulated.write(BASE + 4, 0b1010)
    assert [emulated.pin(n).level for n in (NOT_FRAME, SELECT_0, SELECT_1)] == list("010")
    rises = [level for _, level in edges(emulated, CLOCK, 500) if level == "1"]
    assert len(rises) == 4
    assert [emulated.pin(n).level for n in (NOT_FRAME, SELECT_0, SELECT_1)] == list("111")


def test_words_that_do_not_go_out_are_an_error(board: Board, emulated: EmulatedBoard) -> None:
    spi = board.bspis[0]
    spi.setup(0, bits=8, frequency=1e6, chip_select=0)
    for _ in range(16):
        emulated.write(DESCRIPTOR, 1 << 31)  # nothing comes back any more
    with pytest.raises(errors.ModuleTimeout) as caught:
        spi.transfer([(0, 1), (0, 2)])
    assert caught.value.expected == 2
    with pytest.raises(ValueError, match="set up"):
        spi.transfer([(9, 1)])
    with pytest.raises(ValueError, match="16"):
        spi.transfer([(0, 1)] * 17)


def test_a_frame_of_the_cycle(board: Board, emulated: EmulatedBoard) -> None:
    spi = board.bspis[0]
    spi.setup(0, bits=16, frequency=10e6, chip_select=0)
    spi.setup(1, bits=16, frequency=10e6, chip_select=1)
    frame = spi.frame([0, 1])
    for turn in range(4):
        emulated.bspi(0).answer([100 + turn, 200 + turn])
        frame[0], frame[1] = turn, 1000 + turn
        board.cycle.run()
        assert frame.values == (None if turn == 0 else [99 + turn, 199 + turn])
        emulated.advance(100.0)
    assert [word.value for word in emulated.bspi(0).sent] == [0, 1000, 1, 1001, 2, 1002, 3, 1003]
    frame.stop()
    board.cycle.run()
    emulated.advance(100.0)
    assert emulated.bspi(0).sent == []


def test_pins_are_let_go_at_close(emulated: EmulatedBoard) -> None:
    with hostmot2.open(emulated) as board:
        board.bspis[0].setup(0, bits=8, frequency=1e6, chip_select=0)
    assert {emulated.pin(n).level for n in (NOT_FRAME, OUT, CLOCK, SELECT_0)} == {"H"}


def test_after_a_bite_descriptors_are_back_and_pins_off(
    board: Board, emulated: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    spi = board.bspis[0]
    spi.setup(0, bits=8, frequency=1e6, chip_select=0)
    emulated.advance(60_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()
    words = written(board, monkeypatch)
    board.watchdog.acknowledge()
    assert words[DESCRIPTOR] == 0x10 << 24 | 49 << 8 | 7
    assert emulated.pin(OUT).level == "H"
    emulated.write(BASE, 0x5A)
    emulated.advance(100.0)
    assert emulated.bspi(0).sent == [], "nothing reaches the wire"
    spi.setup(0, bits=8, frequency=1e6, chip_select=0)
    emulated.bspi(0).answer([0x77])
    assert spi.transfer([(0, 1)]) == [0x77]


def test_decoded_selects_are_the_same_module() -> None:
    card = module_card(
        ModuleWords(DBSPI, 0x5800, 3, strides=0x10, multiple=7), pins=(pin(DBSPI, 0x82), pin(DBSPI, 0x83))
    )
    emulated = EmulatedBoard(card, clock="virtual")
    with hostmot2.open(emulated) as board:
        board.bspis[0].setup(0, bits=8, frequency=1e6, chip_select=3)
        emulated.bspi(0).answer([9])
        assert board.bspis[0].transfer([(0, 5)]) == [9]


@pytest.mark.parametrize("count", [0, 17])
def test_a_frame_the_fifo_cannot_hold_is_refused(
    board: Board, monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    spi = board.bspis[1]
    spi.setup(0, bits=16, frequency=10e6, chip_select=0)
    words = written(board, monkeypatch)
    with pytest.raises(ValueError, match=f"16 words in a frame, not {count}"):
        spi.frame([0] * count)
    with pytest.raises(ValueError, match="channel 3 is not set up"):
        spi.frame([0, 3])
    board.cycle.run()
    assert not any(address >> 8 == BASE >> 8 for address in words), "no word was sent"


def test_it_prints_the_channels_in_use(board: Board) -> None:
    spi = board.bspis[1]
    for channel in (7, 2):
        spi.setup(channel, bits=8, frequency=1e6, chip_select=0)
    assert len(spi.frame([2, 7, 2])) == 3
    assert repr(spi) == "<Bspi 1 channels [2, 7]>"
