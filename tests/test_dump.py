"""Register dumps: what is in them and what not, as files, as read-only boards, as emulated ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import hostmot2
from hostmot2 import dump, errors
from hostmot2.address_map import describe, registers_of
from hostmot2.emulator import EmulatedBoard
from hostmot2.inventory import read_inventory

GOLDEN = Path(__file__).parent / "golden" / "card"


class Listening:
    """A board that notes which addresses are read."""

    def __init__(self, spec: str) -> None:
        self.board = hostmot2.open(f"emu://{spec}?clock=virtual")
        self.read_addresses: list[int] = []
        plain = self.board.read_words

        def read_words(address: int, count: int) -> list[int]:
            self.read_addresses.extend(range(address, address + 4 * count, 4))
            return plain(address, count)

        self.board.read_words = read_words  # type: ignore[method-assign]


Listen = Callable[[str], Listening]


@pytest.fixture
def listen() -> Iterator[Listen]:
    """Opens boards for a test and closes them behind it."""
    with ExitStack() as stack:

        def listen(spec: str) -> Listening:
            listening = Listening(spec)
            stack.callback(listening.board.close)
            return listening

        yield listen


def test_reads_with_side_effects_are_left_out_and_said_so(listen: Listen) -> None:
    card = listen("7i76e")
    taken = dump.take(card.board)
    assert 0x7600 not in card.read_addresses
    assert 0x7600 not in taken.words
    assert "samples the phase" in taken.omitted[0x7600]
    assert "7600 --------  dpll sync: " in dump.to_text(taken)


def test_reads_with_side_effects_happen_when_asked_for(listen: Listen) -> None:
    card = listen("7i76e")
    taken = dump.take(card.board, side_effects=True)
    assert 0x7600 in card.read_addresses
    assert 0x7600 in taken.words
    assert not taken.omitted


def test_registers_that_can_only_be_written_are_not_in_a_dump(listen: Listen) -> None:
    taken = dump.take(listen("5i25+7i77").board)
    assert {0x1000, 0x1004, 0x1100, 0x0C00, 0x5A00, 0x5B00, 0x5C00, 0x5C08, 0x3514} <= set(taken.words)
    for write_only in (0x0200, 0x0E00, 0x1200, 0x1300, 0x1400, 0x3900):
        assert write_only not in taken.words


def test_a_dump_holds_the_idrom_as_it_is(listen: Listen) -> None:
    taken = dump.take(listen("5i25+7i77x2").board)
    for line in (GOLDEN / "idrom_5i25_7i77x2.hex").read_text().splitlines():
        address, word = (int(field, 16) for field in line.split())
        if address < 0x400 + 448 + 4 * 34:
            assert taken.words[address] == word


def test_a_dump_survives_its_file(listen: Listen, tmp_path: Path) -> None:
    taken = dump.take(listen("7i76e").board)
    dump.save(taken, tmp_path / "board.hm2dump")
    again = dump.load(tmp_path / "board.hm2dump")
    assert again == taken
    assert again.facts["board"] == "MESA7I76"


def test_a_dump_opens_as_a_board_that_can_only_be_read(listen: Listen, tmp_path: Path) -> None:
    path = tmp_path / "board.hm2dump"
    original = listen("7i76e").board
    dump.save(dump.take(original), path)
    with hostmot2.open(f"dump://{path}") as board:
        assert board.read_only
        assert (board.idrom, board.modules, board.pins) == (original.idrom, original.modules, original.pins)
        assert board.read(0x0100, 2) == [0x55AACAFE, 0x54534F48]
        with pytest.raises(errors.NotInDump) as caught:
            board.read(0x7600)
        assert caught.value.address == 0x7600
        with pytest.raises(errors.NotInDump):
            board.read(0x100C)
        with pytest.raises(errors.ReadOnly):
            board.write(0x1000, 0)
        assert dump.compare(dump.take(board), dump.load(path)) == []


def test_a_dump_beside_the_working_directory_opens(
    listen: Listen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dump.save(dump.take(listen("5i25+7i77").board), tmp_path / "board.hm2dump")
    monkeypatch.chdir(tmp_path)
    with hostmot2.open("dump://board.hm2dump") as board:
        assert board.name == "5I25"


def test_a_dump_becomes_an_emulated_card(listen: Listen, tmp_path: Path) -> None:
    path = tmp_path / "board.hm2dump"
    original = listen("5i25+7i77x2").board
    dump.save(dump.take(original), path)
    with hostmot2.open(f"emu://{path}?clock=virtual") as board:
        assert (board.idrom, board.modules, board.pins) == (original.idrom, original.modules, original.pins)
        board.write(0x1100, 0x1F)
        assert board.read(0x1100) == 0x1F
    words = dump.load(path).idrom_words()
    with hostmot2.open(EmulatedBoard(words, clock="virtual")) as board:
        assert board.modules == original.modules


def test_a_published_idrom_listing_is_a_dump() -> None:
    with hostmot2.open(f"dump://{GOLDEN / 'idrom_5i25_7i77_7i76.hex'}") as board:
        assert [module.name for module in board.modules][-2:] == ["stepgen", "led"]


def test_differences_are_named() -> None:
    with hostmot2.open("emu://5i25+7i77?clock=virtual") as board:
        before = dump.take(board)
        board.write(0x1104, 0x3)
        found = {each.address: each for each in dump.compare(before, dump.take(board))}
    assert found[0x1104] == dump.Difference(0x1104, "ioport 1 ddr", 0, 3)
    assert set(found) == {0x1004, 0x1104}  # and the pads that are driven now


def test_a_word_only_one_dump_has_is_a_difference() -> None:
    left, right = dump.Dump({0x100: 1, 0x104: 2}), dump.Dump({0x100: 1}, names={0x104: "id name"})
    assert dump.compare(left, right) == [dump.Difference(0x104, "id name", 2, None)]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("# hm2dump 1\n0100 55AACAFE\nnonsense\n", 3),
        ("0100 55AACAFE\n0101 00000000\n", 2),
        ("0100 55AACAFE\n\n0100 55AACAFE\n", 3),
        ("10000 55AACAFE\n", 1),
        ("0100 55AACAFE0\n", 1),
    ],
)
def test_a_line_that_is_none_is_named(text: str, line: int) -> None:
    with pytest.raises(errors.BrokenDump, match=f"line {line} ") as caught:
        dump.from_text(text)
    assert caught.value.index == line


@pytest.mark.parametrize("text", ["", dump.FIRST_LINE + "\n"])
def test_a_file_without_a_line_of_a_dump_is_none(text: str) -> None:
    with pytest.raises(errors.BrokenDump, match="no line of a dump"):
        dump.from_text(text)


def test_a_file_that_is_no_dump_names_the_file(tmp_path: Path) -> None:
    path = tmp_path / "x.hm2dump"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(errors.BrokenDump, match=r"x\.hm2dump"):
        hostmot2.open(f"dump://{path}")
    path.write_text("hello\n")
    with pytest.raises(errors.BrokenDump, match=r"x\.hm2dump: line 1 "):
        hostmot2.open(f"dump://{path}")
    with pytest.raises(errors.CardNotFound, match=r"y\.hm2dump"):
        hostmot2.open(f"dump://{tmp_path}/y.hm2dump")


@pytest.mark.parametrize(
    ("address", "name"),
    [
        (0x0100, "id cookie"),
        (0x0428, "idrom clock_low"),
        (0x0C00, "watchdog timer"),
        (0x1004, "ioport 1 data"),
        (0x352C, "muxed_encoder 11 count"),
        (0x3800, "muxed_encoder timestamp_count"),
        (0x5A00, "sserial 0 command"),
        (0x5E08, "sserial 0 user1 2"),
        (0x5E18, None),
        (0x7600, None),
    ],
)
def test_addresses_have_names(address: int, name: str | None) -> None:
    with hostmot2.open("emu://5i25+7i77x2?clock=virtual") as board:
        found = {at.name for at in describe(board.inventory, address)}
    assert found == ({name} if name else set())


@pytest.mark.parametrize("spec", ["5i25+7i77x2", "7i76e", "7i96", "7i92+7i77"])
def test_no_two_registers_of_a_card_share_an_address_but_for_reading_and_writing(spec: str) -> None:
    card = EmulatedBoard(spec, clock="virtual")
    inventory = read_inventory(lambda address, count: [card.read(address + 4 * i) for i in range(count)])
    seen: dict[tuple[int, str], str] = {}
    for at in registers_of(inventory):
        for way in at.register.access:
            assert seen.setdefault((at.address, way), at.name) == at.name


def test_a_dump_without_an_id_block_has_no_idrom() -> None:
    with pytest.raises(errors.NotInDump, match="no word at 0x010C") as caught:
        dump.from_text("1000 00000001").idrom_words()
    assert caught.value.address == 0x10C


def test_a_dump_that_may_not_be_read_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_options: object) -> str:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(errors.PermissionDenied, match=r"card\.hm2dump: this user may not read it"):
        dump.load(tmp_path / "card.hm2dump")


def test_modules_behind_the_pins_are_in_the_dump_too() -> None:
    """Where the tables lie is the IDROM's to say."""
    plain = EmulatedBoard("5i25+7i77", clock="virtual")
    words = plain.read(0x0400, 256)
    modules, pins = words[16:112], words[112:]
    swapped = [*words[:16], *pins[:144], *modules]
    swapped[1], swapped[2] = 64 + 4 * 144, 64
    with hostmot2.open(EmulatedBoard(swapped, clock="virtual")) as board:
        taken = dump.take(board)
        again = taken.idrom_words()
    assert again[:256] == swapped


@pytest.mark.parametrize("name", ["\nESA5I25", "MES\x85", "A\x1b[2J"])
def test_a_board_name_that_is_no_text_leaves_a_dump_that_can_be_read(name: str) -> None:
    """An IDROM like that is what dumps are sent to somebody for."""
    text = dump.to_text(dump.Dump({0x100: 0x55AACAFE}, facts={"board": name, "source": "emu://x"}))
    found = dump.from_text(text)
    assert found.words == {0x100: 0x55AACAFE}
    assert found.facts["source"] == "emu://x"
    assert found.facts["board"].isprintable()
