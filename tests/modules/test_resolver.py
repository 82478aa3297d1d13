"""Resolvers: excitation commands, angles and velocities of fact sheet registers 2.10."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import hostmot2
from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.board import Board
from hostmot2.emulator.board import EmulatedBoard
from tests.modules.module_card import CLOCK_LOW, ModuleWords, module_card, pin, written

RESOLVER, BASE = 0xC0, 0x3C00
NUMBERS = (0x81, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x09, 0x0A)
CARD = module_card(
    ModuleWords(RESOLVER, BASE, 5, multiple=0x1F), pins=tuple(pin(RESOLVER, number) for number in NUMBERS)
)


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard(CARD, clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Board]:
    with hostmot2.open(emulated) as board:
        yield board


@pytest.mark.parametrize(
    ("kilohertz", "command", "divider"), [(10, 0x803, 5000), (5, 0x802, 10000), (2.5, 0x801, 20000)]
)
def test_excitation(
    board: Board, monkeypatch: pytest.MonkeyPatch, kilohertz: float, command: int, divider: int
) -> None:
    resolvers = board.resolvers
    words = written(board, monkeypatch)
    resolvers.excitation_khz = kilohertz
    assert words[BASE] == command
    assert resolvers.excitation == CLOCK_LOW / divider
    with pytest.raises(ValueError, match="excitation"):
        resolvers.excitation_khz = 7


def test_a_processor_that_hangs_is_an_error(
    board: Board, emulated: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    resolvers = board.resolvers
    monkeypatch.setattr(resolvers, "read", lambda register: 0x802)
    with pytest.raises(errors.ModuleTimeout) as caught:
        resolvers.excitation_khz = 10
    assert caught.value.received == 0x802
    assert resolvers.excitation_khz == 5
    assert emulated.now_us == pytest.approx(1e6, rel=0.01)


def test_the_angle_is_absolute(board: Board, emulated: EmulatedBoard) -> None:
    emulated.resolver(4).angle = 0.75
    resolver = board.resolvers[4]
    emulated.advance(1000.0)
    board.cycle.run()
    assert resolver.angle == pytest.approx(0.75)
    assert resolver.position == pytest.approx(0.75)
    assert resolver.count == 0.75 * 2**24
    resolver.scale = -360.0
    assert resolver.position == pytest.approx(-270.0)


def test_turns_are_counted_both_ways(board: Board, emulated: EmulatedBoard) -> None:
    shaft, resolver = emulated.resolver(1), board.resolvers[1]
    board.resolvers.excitation_khz = 10
    board.cycle.run()
    shaft.speed = 50.0
    for _ in range(100):
        emulated.advance(1000.0)
        board.cycle.run()
    assert resolver.position == pytest.approx(5.0, abs=0.05)
    assert resolver.velocity == pytest.approx(50.0, rel=1e-6)
    shaft.speed = -75.0
    for _ in range(200):
        emulated.advance(1000.0)
        board.cycle.run()
    assert resolver.position == pytest.approx(-10.0, abs=0.1)
    assert resolver.velocity == pytest.approx(-75.0, rel=1e-6)
    resolver.reset()
    assert resolver.position == 0.0


@pytest.mark.parametrize("speed", [10.0, -10.0])
def test_the_index_is_where_the_angle_passes_zero(
    board: Board, emulated: EmulatedBoard, speed: float
) -> None:
    shaft, resolver = emulated.resolver(0), board.resolvers[0]
    shaft.angle = 0.5
    emulated.advance(1000.0)
    board.cycle.run()
    resolver.index_divisor = 2
    resolver.index_enable = True
    shaft.speed = speed
    passed = None
    for _ in range(250):
        emulated.advance(1000.0)
        board.cycle.run()
        if passed is None and not resolver.index_enable:
            passed = resolver.position
    # upwards the second zero lies 1.5 turns on, downwards the first half a turn back
    assert passed == pytest.approx(0.0, abs=0.02)
    assert abs(resolver.position) == pytest.approx(2.5 - (1.5 if speed > 0 else 0.5), abs=0.05)


def test_the_flag_is_shown_as_it_is(board: Board, emulated: EmulatedBoard) -> None:
    emulated.resolver(3).set_flag(True)
    resolvers = board.resolvers
    board.cycle.run()
    assert [resolver.flag for resolver in resolvers] == [False, False, False, True, False, False]


def test_more_modules_than_can_be_told_apart_are_refused() -> None:
    descriptors = [replace(m, instances=2) if m.gtag == RESOLVER else m for m in CARD.modules]
    emulated = EmulatedBoard(replace(CARD, modules=tuple(descriptors)), clock="virtual")
    with hostmot2.open(emulated) as board, pytest.raises(errors.UnsupportedFirmware, match="far apart"):
        _ = board.resolvers


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(-(2**31) + 1, 2**31 - 1), min_size=1, max_size=30))
def test_thirty_two_bits_are_extended(start: int, steps: list[int]) -> None:
    resolver = ffi.new("hm2_resolver *")
    resolver.index_divisor = 1
    lib.hm2_resolver_update(resolver, start)
    total = start
    for step in steps:
        total += step
        lib.hm2_resolver_update(resolver, total & 0xFFFFFFFF)
        assert resolver.turns == total


def test_the_excitation_is_set_again_after_a_bite(
    board: Board, emulated: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    board.resolvers.excitation_khz = 10
    board.watchdog.arm()
    emulated.advance(60_000.0)
    with pytest.raises(errors.WatchdogBite):
        board.cycle.run()
    words = written(board, monkeypatch)
    board.watchdog.acknowledge()
    assert words[BASE] == 0x803


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("scale", 0.0),
        ("scale", float("nan")),
        ("scale", float("inf")),
        ("index_divisor", 0),
        ("index_divisor", 1001),
        ("index_divisor", -1),
    ],
)
def test_a_wrong_setting_is_refused_and_changes_nothing(board: Board, name: str, wrong: float) -> None:
    resolver = board.resolvers[3]
    before = getattr(resolver, name)
    with pytest.raises(ValueError, match=f"resolver 3: .*{wrong}"):
        setattr(resolver, name, wrong)
    assert getattr(resolver, name) == before


def test_it_prints_position_and_angle(board: Board, emulated: EmulatedBoard) -> None:
    emulated.resolver(2).angle = 0.25
    board.resolvers[2].scale = 360.0
    for _ in range(3):
        emulated.advance(1000.0)
        board.cycle.run()
    assert repr(board.resolvers[2]).startswith("<Resolver 2 position ")
    assert repr(board.resolvers[2]).endswith(" angle 0.250000>")


def test_text_asks_for_no_index(board: Board) -> None:
    wrong: Any = "off"
    with pytest.raises(TypeError, match="True or False"):
        board.resolvers[0].index_enable = wrong
    assert board.resolvers[0].index_enable is False
