"""Addresses become names by the card's own descriptors."""

import hostmot2
from hostmot2.address_map import describe


def names(url: str, *addresses: int) -> list[list[str]]:
    with hostmot2.open(url) as board:
        return [[at.name for at in describe(board.inventory, address)] for address in addresses]


def test_registers_of_a_5i25_with_a_7i77_are_where_its_descriptors_say() -> None:
    """registers.md 3.2, generation A: SSERIAL at 5A00, CS at 5C00, muxed encoders at 3500."""
    found = names("emu://5i25+7i77", 0x0100, 0x0428, 0x5A00, 0x5C08, 0x3610, 0x3700, 0x1104)
    assert found == [
        ["id cookie"],
        ["idrom clock_low"],
        ["sserial 0 command"],
        ["sserial 0 cs 2"],
        ["muxed_encoder 4 control"],
        ["muxed_encoder timestamp_divider"],
        ["ioport 1 ddr"],
    ]


def test_an_optional_register_has_no_name_because_the_card_does_not_say_whether_it_is_there() -> None:
    assert names("emu://5i25+7i77", 0x3A00) == [[]]


def test_generation_b_moves_the_same_registers() -> None:
    found = names("emu://5i25+7i77?firmware=b", 0x5B00, 0x3600)
    assert found == [["sserial 0 command"], ["muxed_encoder 0 count"]]
