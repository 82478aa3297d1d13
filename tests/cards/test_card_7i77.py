"""The 7I77 as one card: what is set arrives at its remotes, what they see comes back, and it goes off."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.cards.card_7i77 import find_7i77d
from hostmot2.cards.errors import CardFault
from hostmot2.emulator import catalog
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.cards import GPIO
from hostmot2.emulator.cards import card as card_description
from hostmot2.emulator.described import DescribedRemote
from hostmot2.emulator.plant import couple_dc_motor
from hostmot2.registers import Gtag


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual")


@pytest.fixture
def card(emulated: EmulatedBoard) -> Iterator[Any]:
    with hostmot2.open(emulated) as board:
        yield board.card("7i77")


def remotes(emulated: EmulatedBoard, first: int = 0) -> tuple[DescribedRemote, DescribedRemote]:
    io, analog = emulated.sserial[0].remote(first), emulated.sserial[0].remote(first + 1)
    assert isinstance(io, DescribedRemote)
    assert isinstance(analog, DescribedRemote)
    return io, analog


def cycles(card: Any, emulated: EmulatedBoard, count: int) -> None:
    for _ in range(count):
        emulated.advance(1000.0)
        card.exchange()


def test_nothing_is_driven_before_start(card: Any, emulated: EmulatedBoard) -> None:
    with pytest.raises(CardFault, match=r"call start\(\) first"):
        card.analog_enable = True
    assert remotes(emulated)[1].get("analogena") is False


def test_after_start_everything_is_off(card: Any, emulated: EmulatedBoard) -> None:
    card.start()
    cycles(card, emulated, 5)
    io, analog = remotes(emulated)
    assert io.get("output") == 0
    assert [analog.get(f"analogout{n}") for n in range(6)] == [0.0] * 6
    assert (analog.get("analogena"), analog.get("spinena")) == (False, False)
    assert (card.analog_enable, card.spindle_enable) == (False, False)


def test_a_start_of_a_card_that_runs_turns_everything_off_too(card: Any, emulated: EmulatedBoard) -> None:
    card.start()
    card.analog[0].volts = 5.0
    card.analog_enable = card.outputs[3] = True
    cycles(card, emulated, 3)
    card.start()
    assert (card.analog[0].volts, card.analog_enable, card.outputs) == (0.0, False, 0)
    cycles(card, emulated, 2)
    io, analog = remotes(emulated)
    assert (analog.get("analogena"), io.get("output")) == (False, 0)


@pytest.mark.parametrize("enable", ["analog_enable", "spindle_enable"])
def test_drives_are_enabled_only_with_the_watchdog_armed(card: Any, enable: str) -> None:
    card.board.cycle.automatic_watchdog = False
    card.start()
    card.board.cycle.automatic_watchdog = True
    assert not card.board.watchdog.armed
    setattr(card, enable, True)
    assert card.board.watchdog.armed


def test_volts_enables_and_outputs_arrive_at_the_remotes(card: Any, emulated: EmulatedBoard) -> None:
    card.start()
    for axis, volts in enumerate((1.0, -2.0, 10.0, -10.0, 0.5, 12.0)):
        card.analog[axis].volts = volts
    card.analog_enable = True
    card.outputs[0] = True
    card.outputs[15] = True
    cycles(card, emulated, 2)
    io, analog = remotes(emulated)
    seen = [analog.get(f"analogout{n}") for n in range(6)]
    assert seen == pytest.approx([1.0, -2.0, 10.0, -10.0, 0.5, 10.0], abs=0.003)
    assert (analog.get("analogena"), analog.get("spinena")) == (True, False)
    assert io.get("output") == 0x8001
    card.outputs[0] = False
    cycles(card, emulated, 1)
    assert io.get("output") == 0x8000


def test_inputs_come_back(card: Any, emulated: EmulatedBoard) -> None:
    card.start()
    remotes(emulated)[0].set("input", 0x80010001)
    cycles(card, emulated, 2)
    assert [n for n, on in enumerate(card.inputs) if on] == [0, 16, 31]


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_each_mode_reports_what_it_has_and_names_the_mode_that_has_the_rest(
    card: Any, emulated: EmulatedBoard, mode: int
) -> None:
    card.mode = mode
    card.start()
    io, _ = remotes(emulated)
    assert io.software_mode == mode
    have = {"analog_inputs": mode >= 1, "field_voltage": mode >= 2, "mpg": mode >= 3}
    if mode >= 1:
        io.set("analogin2", 12.0)
    if mode >= 2:
        io.set("fieldvoltage", 24.0)
    if mode >= 3:
        io.set("enc0", 7)
    cycles(card, emulated, 3)
    for name, there in have.items():
        if there:
            getattr(card, name)
        else:
            with pytest.raises(errors.ModuleMissing, match="mode"):
                getattr(card, name)
    if mode >= 1:
        assert card.analog_inputs[2] == pytest.approx(12.0, abs=0.08)
    if mode >= 2:
        assert card.field_voltage == pytest.approx(24.0, abs=0.08)
    if mode >= 3:
        assert card.mpg == (7, 0)


def test_a_mode_the_card_does_not_have_is_refused_before_anything_is_sent(card: Any) -> None:
    with pytest.raises(ValueError, match="mode 4"):
        card.mode = 4


def test_the_encoders_are_those_of_its_own_connector() -> None:
    with EmulatedBoard("5i25+7i77x2", clock="virtual") as emulated, hostmot2.open(emulated) as board:
        first, second = board.cards.all("7i77")
        assert [encoder.index for encoder in first.encoders] == [0, 1, 2, 3, 4, 5]
        assert [encoder.index for encoder in second.encoders] == [6, 7, 8, 9, 10, 11]
        assert (first.channel_numbers, second.channel_numbers) == ((0, 1), (3, 4))


def test_the_remotes_are_told_apart_by_unit_number_not_by_position(emulated: EmulatedBoard) -> None:
    io, analog = remotes(emulated)
    emulated.sserial[0].attach(0, analog, through_pins=True)
    emulated.sserial[0].attach(1, io, through_pins=True)
    with hostmot2.open(emulated) as board:
        card = board.card("7i77")
        assert (card.field_io_channel.number, card.analog_channel.number) == (1, 0)
        card.start()
        card.outputs[2] = True
        card.exchange()
        card.exchange()
        assert io.get("output") == 4


def test_a_fault_drops_the_enables_also_behind_a_callback_that_raises(emulated: EmulatedBoard) -> None:
    def broken(faults: object) -> None:
        raise RuntimeError("a callback of the user's")

    with hostmot2.open(emulated) as board:
        board.sserial[0].on_faults.append(broken)
        card = board.card("7i77")
        card.start()
        cycles(card, emulated, 2)
        card.analog_enable = True
        cycles(card, emulated, 2)
        remotes(emulated)[1].fault = 0x08
        with pytest.raises(RuntimeError, match="callback"):
            cycles(card, emulated, 3)
        assert card.analog_enable is False


def test_a_fault_of_another_remote_in_its_place_is_no_error_of_the_card(
    card: Any, emulated: EmulatedBoard
) -> None:
    card.start()
    card.stop()
    stranger = catalog.remote("7i64")
    emulated.sserial[0].attach(1, stranger, through_pins=True)
    port = card.board.sserial[0]
    assert port.start(0b11).failed == 0
    assert port.doit().failed == 0
    emulated.advance(1000.0)
    stranger.inject(skip=1)
    assert port.doit().failed == 0b10


def test_a_fault_drops_the_enables_and_they_stay_off(card: Any, emulated: EmulatedBoard) -> None:
    card.start()
    card.analog[0].volts = 5.0
    card.analog_enable = True
    cycles(card, emulated, 3)
    _io, analog = remotes(emulated)
    assert analog.get("analogena") is True
    analog.fault = 0x08
    cycles(card, emulated, 3)
    assert card.analog_enable is False
    with pytest.raises(CardFault, match="channel 1"):
        card.analog_enable = True
    analog.fault = 0
    cycles(card, emulated, 3)
    assert card.analog_enable is False


def test_a_lost_reply_fails_that_exchange_only_and_keeps_the_inputs(
    card: Any, emulated: EmulatedBoard
) -> None:
    card.start()
    io, _ = remotes(emulated)
    io.set("input", 5)
    cycles(card, emulated, 3)
    io.inject(skip=1)
    emulated.advance(1000.0)
    assert card.exchange().failed == 1
    assert int(card.inputs) == 5
    emulated.advance(1000.0)
    assert card.exchange().failed == 0


def test_silence_of_the_host_stops_a_running_motor(card: Any, emulated: EmulatedBoard) -> None:
    motor = couple_dc_motor(emulated)
    card.start()
    card.analog[0].volts = 5.0
    card.analog_enable = True
    cycles(card, emulated, 300)
    assert motor.turns_per_second > 20
    emulated.advance(55_000.0)
    assert motor.torque == 0.0
    with pytest.raises(errors.WatchdogBite):
        card.exchange()
    card.board.watchdog.acknowledge()
    card.start()
    cycles(card, emulated, 50)
    assert motor.torque == 0.0, "acknowledging and starting enable nothing"


@pytest.mark.parametrize("way", ["close", "exception", "stop"])
def test_every_way_out_switches_the_amplifier_off(emulated: EmulatedBoard, way: str) -> None:
    motor = couple_dc_motor(emulated)

    def drive() -> None:
        with hostmot2.open(emulated) as board:
            card = board.card("7i77")
            card.start()
            card.analog[0].volts = 5.0
            card.analog_enable = True
            cycles(card, emulated, 100)
            assert motor.torque > 0.0
            if way == "exception":
                raise RuntimeError("user")
            if way == "stop":
                card.stop()
                emulated.advance(200.0)
                assert motor.torque == 0.0

    if way == "exception":
        with pytest.raises(RuntimeError):
            drive()
    else:
        drive()
    emulated.advance(200.0)
    assert motor.torque == 0.0
    assert emulated.pin(5).level == "H", "the pins are let go"
    assert emulated.read(0x0D00) == 1, "the watchdog has been made to bite"


def test_a_position_loop_closes(card: Any, emulated: EmulatedBoard) -> None:
    motor = couple_dc_motor(emulated)
    encoder = card.encoders[0]
    encoder.scale = 4000.0
    card.start()
    card.analog_enable = True
    for _ in range(1500):
        emulated.advance(900.0)
        card.exchange()
        card.analog[0].volts = 8.0 * (2.0 - encoder.position) - 0.35 * encoder.velocity
    assert encoder.position == pytest.approx(2.0, abs=0.02)
    assert motor.turns == pytest.approx(2.0, abs=0.02)


def test_a_fault_of_one_card_drops_its_enables_whichever_card_exchanges() -> None:
    emulated = EmulatedBoard("5i25+7i77x2", clock="virtual")
    with hostmot2.open(emulated) as board:
        cards = [board.cards.get("7i77", number) for number in (0, 1)]
        for card in cards:
            card.start()
            card.analog_enable = card.spindle_enable = True
        cycles(cards[0], emulated, 2)
        remotes(emulated, 3)[1].fault = 0x04
        cycles(cards[0], emulated, 2)
        remotes(emulated, 3)[1].fault = 0
        cycles(cards[0], emulated, 2)
        assert (cards[1].analog_enable, cards[1].spindle_enable) == (False, False)
        assert remotes(emulated, 3)[1].get("analogena") is False
        assert remotes(emulated, 0)[1].get("analogena") is True


def test_a_7i77d_is_found_when_you_say_so(emulated: EmulatedBoard) -> None:
    with hostmot2.open(emulated) as board:
        (card,) = find_7i77d(board)
        assert (card.name, card.output_type) == ("7I77D", "sinking")
        card.start()
        card.analog[3].volts = -2.5
        assert repr(card.analog[3]) == "<analog output 3 -2.500 V>"


def test_firmware_without_encoders_makes_no_7i77_but_says_so() -> None:
    """The remotes answer, but the card's encoder lines lead nowhere: no axis could be counted."""
    full = card_description("5i25+7i77")
    encoders = (Gtag.MUXED_ENCODER, Gtag.MUXED_ENCODER_SELECT)
    description = replace(
        full,
        modules=tuple(module for module in full.modules if module.gtag not in encoders),
        pins=tuple(GPIO if word >> 8 & 0xFF in encoders else word for word in full.pins),
    )
    said = "no encoders for the 7I77 of channel 1"
    emulated = EmulatedBoard(description, clock="virtual")
    with hostmot2.open(emulated) as board, pytest.raises(errors.ModuleMissing, match=said):
        _ = board.card("7i77").encoders


def test_a_7i77_on_a_channel_without_pins_is_no_card() -> None:
    with EmulatedBoard("5i25+7i77", clock="virtual", sserial_channels=4) as emulated:
        emulated.sserial[0].attach(3, catalog.remote("7i77-io"))
        said = "no pin leads to smart serial channel 3"
        with hostmot2.open(emulated) as board, pytest.raises(errors.ModuleMissing, match=said):
            board.card("7i77")
