"""What an emulated card, its remotes and what hangs on them refuse, and that all is as before then."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from hostmot2.emulator import DescribedRemote, EmulatedBoard, EmulatedRemote, catalog
from hostmot2.emulator.cards import CardDescription, ModuleWords, card, pin
from hostmot2.emulator.description import Parameter as DescribedParameter
from hostmot2.emulator.description import RemoteDescription, SoftwareMode, compile_description
from hostmot2.emulator.plant import DcMotorConstants, Rotor, couple_dc_motor
from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.registers import Gtag

PINS = tuple(pin(Gtag.RESOLVER, number) for number in (0x81, 0x82, 0x83))


@pytest.fixture
def small() -> EmulatedBoard:
    """A card with one of everything that something hangs on."""
    modules = (
        ModuleWords(Gtag.WATCHDOG, 0x0C00, 3),
        ModuleWords(Gtag.IOPORT, 0x1000, 5, multiple=0x1F),
        ModuleWords(Gtag.RESOLVER, 0x3C00, 5, multiple=0x1F),
        ModuleWords(Gtag.PERIOD, 0x9600, 4, multiple=0xF),
        ModuleWords(Gtag.SSI, 0x6900, 4, multiple=3),
        ModuleWords(Gtag.INMUX, 0x8000, 5, multiple=0x1F),
    )
    own = CardDescription(name="small", board_name="MESATEST", modules=modules, pins=(pin(0, 0),) * 17)
    return EmulatedBoard(own, clock="virtual")


# ---- the card


@pytest.mark.parametrize("options", [{"clock": "real time"}, {"clock": ""}, {"wire": "slow"}, {"wire": True}])
def test_a_clock_or_wire_that_is_none(options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="clock is"):
        EmulatedBoard("5i25+7i77", **options)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"pins": (0,) * 18}, "18 pins are no multiple of the port width 17"),
        ({"pins": (0,) * 153}, "144 pins"),
        ({"modules": (ModuleWords(Gtag.LED, 0x0200, 1),) * 33}, "32 module descriptors"),
    ],
)
def test_a_description_that_no_idrom_holds(change: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        replace(card("5i25+7i77"), **change).idrom()


def test_more_words_than_an_idrom_has() -> None:
    with pytest.raises(ValueError, match="an IDROM has 256 words, not 257"):
        EmulatedBoard([0] * 257)


def test_remotes_of_channels_that_are_not_there_are_not_attached() -> None:
    with EmulatedBoard("5i25+7i77", clock="virtual", sserial_channels=1) as board:
        assert board.sserial[0].channels == 1
        assert board.sserial[0].remote(0).name == "7I77"


@pytest.mark.parametrize("wrong", [-1.0, 1_000_001.0])
def test_a_delay_of_the_multiplexer_has_bounds(wrong: float) -> None:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    board.mux_delay_ns = 20.0
    with pytest.raises(ValueError, match="0 to 1000000 ns"):
        board.mux_delay_ns = wrong
    assert board.mux_delay_ns == 20.0


def test_a_pin_prints_its_number_and_level() -> None:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    board.pin(20).drive(0)
    assert repr(board.pin(20)) == "<pin IO20 0>"


def test_an_unplugged_encoder_lets_its_lines_float() -> None:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    board.encoder_input(1).set(a=0, b=0, z=0)  # the second of a pair: nobody drives the select line
    board.advance_clocks(1000)
    assert board.read(0x3604) & 3 == 0
    board.encoder_input(1).unplug()
    board.advance_clocks(1000)
    assert board.read(0x3604) & 3 == 3


# ---- what hangs on its modules


def test_a_resolver_keeps_turning_as_it_did_when_a_speed_is_refused(small: EmulatedBoard) -> None:
    shaft = small.resolver(0)
    shaft.speed = 10.0
    for wrong in (1e9, math.nan, -math.inf):
        with pytest.raises(ValueError, match=f"{wrong} turns per second".replace("+", r"\+")):
            shaft.speed = wrong
    for wrong in (math.nan, math.inf):
        with pytest.raises(ValueError, match=f"an angle of {wrong} turns"):
            shaft.angle = wrong
    assert shaft.speed == 10.0
    shaft.angle = 0.25
    small.advance(50_000.0)
    assert shaft.angle == pytest.approx(0.75, abs=1e-4)


@pytest.mark.parametrize(
    ("use", "said"),
    [
        (lambda board: board.period(0).run(0.0), "a signal of 0.0 Hz"),
        (lambda board: board.period(0).run(math.nan), "a signal of nan Hz"),
        (lambda board: board.period(0).run(2e9), r"a signal of 2000000000\.0 Hz"),
        (lambda board: board.period(0).run(100.0, 1.5), r"duty 1\.5"),
        (lambda board: board.inmux(0).drive(32, 1), "line 32, level 1"),
        (lambda board: board.inmux(0).drive(3, 2), "line 3, level 2"),
        (lambda board: setattr(board.ssi(0), "value", 1 << 64), "no 64-bit value"),
        (lambda board: setattr(board.ssi(0), "value", -1), "-1 is no 64-bit value"),
    ],
)
def test_a_stimulus_that_cannot_be(
    small: EmulatedBoard, use: Callable[[EmulatedBoard], Any], said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        use(small)


def test_the_bits_of_an_ssi_encoder_are_read_back(small: EmulatedBoard) -> None:
    encoder = small.ssi(0)
    encoder.value = 0xABCDEF
    assert encoder.value == 0xABCDEF


@pytest.mark.parametrize(
    "use",
    [
        *(
            lambda board, kind=kind: getattr(board, kind)(9)
            for kind in ("period", "resolver", "ssi", "inmux")
        ),
        lambda board: board.bspi(9),
        lambda board: board.uart(9).received,
        lambda board: board.uart(9).send(b"x"),
        lambda board: board.pktuart(9).received,
        lambda board: board.pktuart(9).send(b"x"),
    ],
)
def test_what_the_card_does_not_have_is_an_index_error(
    small: EmulatedBoard, use: Callable[[EmulatedBoard], Any]
) -> None:
    with pytest.raises(IndexError, match=r"the card has no .* 9"):
        use(small)


# ---- motors


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"constants": DcMotorConstants(rotor=Rotor(inertia=0.0))}, ValueError, r"inertia 0\.0 kg"),
        ({"constants": DcMotorConstants(rotor=Rotor(inertia=math.nan))}, ValueError, "inertia nan"),
        ({"limit_inputs": (0, 32)}, ValueError, r"input has bits 0\.\.31, no 32"),
        ({"axis": 6}, ValueError, "axis 6"),
        ({"channels": (2, 1)}, TypeError, "channel 2 carries no remote with described elements"),
    ],
)
def test_a_motor_that_cannot_be_coupled(options: dict[str, Any], error: type[Exception], said: str) -> None:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    board.sserial[0].attach(2, EmulatedRemote("BARE"))
    with pytest.raises(error, match=said):
        couple_dc_motor(board, **options)


def test_the_load_on_a_motor_is_what_was_put_on_it() -> None:
    motor = couple_dc_motor(EmulatedBoard("5i25+7i77", clock="virtual"))
    assert motor.load == 0.0
    motor.load = -0.25
    assert motor.load == -0.25


# ---- remotes


def test_a_remote_prints_what_it_is_and_tells_its_settings() -> None:
    remote = EmulatedRemote("7I77", 0x12000001, 5, 2, turnaround_us=4.5)
    assert repr(remote) == "<EmulatedRemote 7I77 unit 0x12000001, 2 bytes out, 5 in>"
    assert remote.turnaround_us == 4.5
    with pytest.raises(ValueError, match="is outside its range"):
        remote.turnaround_us = -1.0
    assert remote.turnaround_us == 4.5


@pytest.mark.parametrize("call", ["poke", "peek"])
def test_memory_beyond_its_end_is_refused(call: str) -> None:
    remote = EmulatedRemote("7I77")
    arguments = {"poke": (0xFFFF, b"ab"), "peek": (0xFFFF, 2)}[call]
    with pytest.raises(ValueError, match="7I77: outside its range"):
        getattr(remote, call)(*arguments)


def test_a_jumper_can_be_asked_and_an_unknown_mode_is_not_in_force() -> None:
    remote = catalog.remote("7i77-io")
    assert remote.setup_jumper is False
    remote.setup_jumper = True
    assert remote.setup_jumper is True
    remote.software_mode = 99
    assert remote.mode.index == 0


@pytest.mark.parametrize(("name", "what"), [("7i77-io", "everything"), ("7i64", "loop")])
def test_a_corruption_that_is_none_or_has_nothing_to_corrupt(name: str, what: str) -> None:
    with pytest.raises(ValueError, match=f"corrupt.'{what}'.: not one of record_type"):
        catalog.remote(name).corrupt(what)


def _field(name: str, bits: int, kind: FieldKind = FieldKind.BITS) -> Field:
    return Field(name, kind, bits, Direction.INPUT, 0.0, 0.0, "")


def test_a_remote_whose_process_data_is_too_long() -> None:
    mode = SoftwareMode(3, "wide", tuple(_field(f"in{n}", 64) for n in range(33)))
    wide = RemoteDescription(name="WIDE", unit_number=1, modes=(mode,))
    with pytest.raises(ValueError, match="WIDE mode 3: more than 255 bytes"):
        DescribedRemote(wide)


def test_a_remote_whose_parameters_do_not_fit() -> None:
    cells = tuple(DescribedParameter(_field(f"NV{n}", 64, FieldKind.NONVOL_UNSIGNED), 0) for n in range(513))
    mode = SoftwareMode(0, "plain", (_field("in", 8),))
    with pytest.raises(ValueError, match="FULL: the description does not fit"):
        compile_description(RemoteDescription("FULL", 1, (mode,), parameters=cells))
