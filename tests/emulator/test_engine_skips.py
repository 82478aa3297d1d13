"""The engine skips spans in which nothing changes: that must never show.

Two boards get the same accesses and stimulus; one is advanced in one go, the other clock by clock (which
leaves nothing to skip). Everything that can be read must agree.
"""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from hostmot2.emulator import CardDescription, EmulatedBoard
from hostmot2.emulator.cards import GENERATIONS, GPIO, ModuleWords, pin, pins_7i77
from hostmot2.registers import Gtag

A = GENERATIONS["a"]
MODULES = (
    ModuleWords(Gtag.DPLL, 0x7000, 7),
    ModuleWords(Gtag.WATCHDOG, 0x0C00, 3),
    ModuleWords(Gtag.IOPORT, 0x1000, 5, instances=2, multiple=0x1F),
    ModuleWords(Gtag.ENCODER, 0x3000, 5, instances=2, version=0x83, multiple=3),
    ModuleWords(Gtag.MUXED_ENCODER, A.muxed_qcount, 5, instances=6, version=3, multiple=3),
    ModuleWords(Gtag.MUXED_ENCODER_SELECT, 0, 0),
    ModuleWords(Gtag.STEPGEN, 0x2000, 10, instances=2, version=2, multiple=0x1FF),
    ModuleWords(Gtag.PWMGEN, A.pwm, 5, instances=2, clock=2, multiple=3),
    ModuleWords(Gtag.LED, 0x0200, 1),
)
PINS = (
    *(GPIO,) * 7,
    *pins_7i77(0, 0, 0)[7:],
    *(pin(Gtag.STEPGEN, number, unit) for unit in (0, 1) for number in (0x81, 0x82)),
    *(pin(Gtag.PWMGEN, number, unit) for unit in (0, 1) for number in (0x81, 0x82, 0x83)),
    *(pin(Gtag.DPLL, number) for number in (0x01, 0x82, 0x83)),
    *(pin(Gtag.ENCODER, number) for number in (1, 2, 3, 5)),
)
CARD = CardDescription(name="mixed", board_name="MESATEST", modules=MODULES, pins=PINS)
REGISTERS = [
    0x0A00, 0x0C00, 0x0D00, 0x1000, 0x1004, 0x1100, 0x2100, 0x2104, 0x2900, 0x3000, 0x3004, 0x3100, 0x3104,
    *range(0x3500, 0x3518, 4), *range(0x3600, 0x3618, 4), 0x3800, 0x7000, 0x7100, 0x7200, 0x7300,
]  # fmt: skip


def stepgen(board: EmulatedBoard, rng: random.Random) -> None:
    unit = 4 * rng.randrange(2)
    rate = rng.choice([0, rng.randrange(1 << 32), rng.randrange(1 << 26), (1 << 32) - rng.randrange(1 << 26)])
    register, value = rng.choice(
        [
            (0x2000, rate),
            (0x2000, rate),
            (0x2100, rng.randrange(1 << 32)),
            (0x2200, rng.randrange(4)),
            (0x2300, rng.randrange(40)),
            (0x2400, rng.randrange(40)),
            (0x2500, rng.randrange(60)),
            (0x2600, rng.randrange(60)),
            (0x2700, rng.randrange(4)),
            (0x2800, rng.randrange(16)),
        ]
    )
    board.write(register + unit, value)
    if rng.random() < 0.2:
        board.write(0x2900, rng.choice([0xFFFFFFFF, 0x80000000, 0x12345678]))


def encoder(board: EmulatedBoard, rng: random.Random) -> None:
    number = rng.randrange(8)
    what = rng.randrange(5)
    if what == 0:
        period = rng.choice([30, 45, 60, 100, 240, 333.3, 1000])
        board.encoder_input(number).run(period, rng.randrange(-200, 200))
    elif what == 1:
        board.encoder_input(number).set_rate(rng.uniform(-3e6, 3e6))
    elif what == 2:
        board.encoder_input(number).index_every(rng.randrange(1, 40), rng.randrange(4))
    elif what == 3:
        base = 0x3100 + 4 * rng.randrange(2) if rng.random() < 0.3 else 0x3600 + 4 * rng.randrange(6)
        board.write(base, rng.randrange(1 << 16))
    else:
        rate = rng.choice([0xFFF, 0, 1, 2, 5, 0x20]) | rng.randrange(5) << 28
        board.write(rng.choice([0x3400, 0x3900]), rate)


def dpll(board: EmulatedBoard, rng: random.Random) -> None:
    register, value = rng.choice(
        [
            (0x7000, rng.randrange(1 << 32)),
            (0x7100, rng.randrange(1 << 32)),
            (0x7200, rng.choice([1, 2, 3, 8]) << 24 | 0x400000),
            (0x7300, rng.choice([1, 2, 3, 20]) << 16),
            (0x7400, rng.randrange(1 << 32)),
            (0x7600, 0),
            (0x0A00, rng.randrange(8) << 2 | 2),
        ]
    )
    board.write(register, value)
    if rng.random() < 0.7:
        board.read(0x7600)
    if rng.random() < 0.3:
        board.pin(27).drive(rng.randrange(2))


def pwm(board: EmulatedBoard, rng: random.Random) -> None:
    register, value = rng.choice(
        [
            (0x4000, rng.randrange(1 << 32)),
            (0x4100, rng.randrange(64) | rng.choice([0, 0x18])),
            (0x4200, rng.randrange(1 << 16)),
            (0x4300, rng.randrange(1 << 16)),
            (0x4400, rng.randrange(4)),
        ]
    )
    board.write(register + (4 * rng.randrange(2) if register < 0x4200 else 0), value)


def ports(board: EmulatedBoard, rng: random.Random) -> None:
    board.write(rng.choice([0x1000, 0x1200, 0x1400]) + 4 * rng.randrange(2), rng.randrange(1 << 17))
    board.write(rng.choice([0x1100, 0x1300]) + 4 * rng.randrange(2), rng.randrange(1 << 17))
    if rng.random() < 0.3:
        board.write(0x0C00, rng.randrange(600))


def look(board: EmulatedBoard) -> list[object]:
    registers = [board.read(address) for address in REGISTERS]
    return [*registers, *(p.level for p in board.pins), board.interrupt]


@pytest.mark.parametrize(
    "acts", [(stepgen,), (encoder,), (dpll,), (pwm,), (stepgen, encoder, dpll, pwm, ports)]
)
@pytest.mark.parametrize("seed", range(6))
def test_skipped_spans_do_not_show(
    acts: tuple[Callable[[EmulatedBoard, random.Random], None], ...], seed: int
) -> None:
    whole, stepped = (EmulatedBoard(CARD, clock="virtual") for _ in range(2))
    for board in (whole, stepped):  # past the first, long countdowns of the DPLL
        board.write(0x7200, 0x01400000)
        board.write(0x7300, 0x00010000)
        board.advance_clocks(70000)
    rngs = [random.Random(seed), random.Random(seed)]
    for board in (whole, stepped):
        board.write(0x2900, 0xFFFFFFFF)
        for port in (0, 4):
            board.write(0x1200 + port, 0x1FFFF)
            board.write(0x1100 + port, 0x00080 if port == 0 else 0x01FFF)
    for turn in range(40):
        clocks = random.Random(seed * 1000 + turn).choice([1, 3, 17, 100, 700, 2500])
        for board, rng in zip((whole, stepped), rngs, strict=True):
            for _ in range(3):
                acts[rng.randrange(len(acts))](board, rng)
        whole.advance_clocks(clocks)
        for _ in range(clocks):
            stepped.advance_clocks(1)
        assert look(whole) == look(stepped), f"turn {turn}"
