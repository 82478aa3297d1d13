"""SSERIAL as part of the emulated card: attaching remotes, pins, channels and address decoding."""

from __future__ import annotations

import pytest

from hostmot2._core import lib
from hostmot2.emulator import EmulatedBoard, EmulatedRemote
from hostmot2.emulator.cards import CARD_NAMES, card

COMMAND, DATA, CS = 0x5A00, 0x5B00, 0x5C00
START_SETUP, DOIT = 0x0F00, 0x1000
SWITCH_7I77 = [(0x1200, 0x0000_007F), (0x1100, 0x0000_002B)]  # alternate source; TXEN2, TX2, TX1, TX0 out


def board(**options: object) -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual", strict=True, **options)  # type: ignore[arg-type]


def start(card: EmulatedBoard, mask: int, command: int = 0x0900) -> int:
    """Start channels and return DATA: a bit for each that did not."""
    card.write(COMMAND, 0x0800)
    card.advance(500)
    card.write(COMMAND, command | mask)
    for _ in range(200):
        card.advance(1000)
        if card.read(COMMAND) == 0:
            return int(card.read(DATA))
    raise AssertionError("the start never completed")


def test_the_example_of_the_documentation_works_as_written() -> None:
    card = board(sserial_channels=4)
    remote = EmulatedRemote(
        name="7I84", unit_number=0xBEEF, receive_size=5, transmit_size=4, ptoc=0x0700, gtoc=0x0720,
        memory={0x0700: 0x00}, turnaround_us=6.0,
    )  # fmt: skip
    card.sserial[0].attach(2, remote)
    assert card.sserial[0].remote(2) is remote
    card.write(COMMAND, 0x0800)
    card.advance(10.0)
    assert card.read(COMMAND) == 0x0800  # with four channels STOP ALL takes some 60 us
    card.advance(100.0)
    assert card.read(COMMAND) == 0
    assert card.read(DATA) == 0xAA


def test_an_attached_remote_answers_without_pins() -> None:
    card = board(sserial_channels=4)
    card.sserial[0].attach(2, EmulatedRemote(name="7I84", receive_size=5, transmit_size=4))
    assert start(card, 0x04) & 0x04 == 0
    card.sserial[0].detach(2)
    assert card.sserial[0].remote(2) is None
    assert start(card, 0x04) & 0x04


class CardsOnly:
    """The core, without what reaches into a remote whatever its card does meanwhile."""

    def __getattr__(self, name: str) -> object:
        assert name not in ("hm2_remote_peek", "hm2_remote_poke")
        return getattr(lib, name)


def test_a_remotes_memory_is_its_cards_while_it_hangs_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thread that looks comes between two accesses of the host."""
    card, remote = board(sserial_channels=4), EmulatedRemote(name="7I84", receive_size=5, transmit_size=4)
    card.sserial[0].attach(2, remote)
    with monkeypatch.context() as context:
        context.setattr("hostmot2.emulator.remote.lib", CardsOnly())
        remote.poke(0x200, b"\x12\x34")
        assert remote.peek(0x200, 2) == b"\x12\x34"
        card.sserial[0].detach(2)
        with pytest.raises(AssertionError):
            remote.peek(0x200, 2)
    assert remote.peek(0x200, 2) == b"\x12\x34"


def test_the_daughter_cards_remotes_need_switched_pins() -> None:
    card = board()
    assert start(card, 0x03) & 0x03 == 0x03
    for address, value in SWITCH_7I77:
        card.write(address, value)
    assert start(card, 0x03) & 0x03 == 0
    card.write(0x1100, 0x0000_000B)  # TX0 no longer drives
    assert start(card, 0x03) & 0x03 == 0x01


def test_a_transmit_line_is_high_between_bytes_and_shows_their_bits() -> None:
    card = board()
    for address, value in SWITCH_7I77:
        card.write(address, value)
    assert [card.pin(n).level for n in (1, 3, 5)] == ["0"] * 3, "no rate yet"
    card.advance(500)
    assert [card.pin(n).level for n in (1, 3, 5)] == ["1"] * 3
    assert card.read(0x1000) & 0b101010 == 0b101010
    card.write(COMMAND, 0x0901)
    while card.pin(5).level == "1":
        card.advance(0.01)
    card.advance(0.2)
    bits = []
    for _ in range(20):
        bits.append(card.pin(5).level)
        card.advance(0.4015)  # a byte takes 4.03 us with the gap behind it
    assert "".join(bits) == "".join("0" + f"{byte:08b}"[::-1] + "1" for byte in (0xDF, 0x16))
    assert [card.pin(n).level for n in (1, 3, 5)] == ["1"] * 3
    card.write(COMMAND, 0x4000)
    assert card.pin(5).level == "1", "a processor in reset sends nothing"
    card.write(0x1100, 0)
    assert card.pin(5).level == "H"


def test_a_watchdog_bite_cuts_the_remotes_off() -> None:
    card = board()
    for address, value in SWITCH_7I77:
        card.write(address, value)
    assert start(card, 0x03) & 0x03 == 0
    card.write(0x0D00, 0)
    card.write(0x0C00, 100)
    card.advance_clocks(103)
    assert card.read(0x0D00) == 1
    assert start(card, 0x03) & 0x03 == 0x03


def test_channel_slots_repeat_at_the_next_power_of_two() -> None:
    card = board()  # three channels
    card.advance(1000)
    assert card.sserial[0].channels == 3
    assert card.read(CS + 4 * 4) == card.read(CS)
    for register in (CS, CS + 0x100, CS + 0x300):
        card.write(register + 4 * 3, 0x12345678)
        assert card.read(register + 4 * 3) == 0  # a slot that no channel has: observed with three ports
    assert EmulatedBoard("5i25+7i77x2", clock="virtual").sserial[0].channels == 6
    assert board(sserial_channels=4).sserial[0].channels == 4


def test_channels_that_do_not_exist_are_refused() -> None:
    with pytest.raises(IndexError, match=r"channels 0\.\.2"):
        board().sserial[0].attach(3, EmulatedRemote())
    with pytest.raises(ValueError, match="1 to 8"):
        board(sserial_channels=9)


@pytest.mark.parametrize("name", CARD_NAMES)
def test_every_card_of_the_catalogue_comes_up(name: str) -> None:
    with EmulatedBoard(name, clock="virtual") as emulated:
        facts = card(name)
        assert emulated.read(0x100, 4) == [0x55AACAFE, 0x54534F48, 0x32544F4D, 0x400]
        assert emulated.read(0x400, 256) == facts.idrom()
        assert len(list(emulated.pins)) == len(facts.pins)
        assert [pin.level for pin in emulated.pins] == ["H"] * len(facts.pins)
        assert len(emulated.leds) == facts.leds


def test_register_generations_move_the_modules_that_moved() -> None:
    old, new = (
        EmulatedBoard("5i25+7i77", clock="virtual"),
        EmulatedBoard("5i25+7i77", clock="virtual", firmware="b"),
    )
    for emulated, counts in ((old, 0x3500), (new, 0x3600)):
        emulated.write(0x1200, 0x80)
        emulated.write(0x1100, 0x80)
        emulated.encoder_input(0).run(2000.0, 5)
        emulated.advance(20.0)
        assert emulated.read(counts) & 0xFFFF == 5
    with pytest.raises(ValueError, match="'a' nor 'b'"):
        EmulatedBoard("5i25+7i77", firmware="c")
    with pytest.raises(KeyError, match="no emulated card"):
        EmulatedBoard("5i99")


@pytest.mark.parametrize(
    ("spec", "selects"), [("7i92+7i77+7i76", (0x2A00, 0x3B00)), ("7i76e", (0x2A00, 0x3500))]
)
def test_only_generation_b_samples_by_dpll_timers(spec: str, selects: tuple[int, ...]) -> None:
    """A client takes a register that reads back 0 for one; in generation A other modules lie there."""
    old = EmulatedBoard(spec, clock="virtual", firmware="a")
    new = EmulatedBoard(spec, clock="virtual", firmware="b")
    for address in selects:
        new.write(address, 0)
        assert new.read(address) == 0
    for address in (0x2A00, 0x3A00, *(() if spec == "7i92+7i77+7i76" else (0x3500,))):
        old.write(address, 0)
        assert old.read(address) == 0xDEADBEEF


def test_raw_idrom_words_make_a_card_and_broken_ones_are_refused() -> None:
    words = card("5i25+7i77").idrom()
    assert EmulatedBoard(words, clock="virtual").read(0x100) == 0x55AACAFE
    for index, value in ((0x24 // 4, 0), (0x28 // 4, 1), (0x1C // 4, 99), (0x1C0 // 4, 0)):
        broken = list(words)
        broken[index] = value
        with pytest.raises(Exception, match="emulated idrom"):
            EmulatedBoard(broken)
