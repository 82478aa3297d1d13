"""Addresses become names by the card's own descriptors."""

import hostmot2
from hostmot2.decoding import describe, places


def test_registers_of_a_5i25_with_a_7i77_are_where_its_descriptors_say() -> None:
    """registers.md 3.2, generation A: SSERIAL at 5A00, CS of channel 2 at 5C08, control of encoder 4 at 3610."""
    with hostmot2.open("emu://5i25+7i77") as board:
        known = places(board.inventory)
    assert str(known[0x0100][0]) == "id.cookie"
    assert str(known[0x0428][0]) == "idrom.clock_low"
    assert str(known[0x5A00][0]) == "sserial.command"
    assert str(known[0x5C08][0]) == "sserial.cs channel 2"
    assert str(known[0x3610][0]) == "muxed_encoder[4].control"
    assert str(known[0x3700][0]) == "muxed_encoder.timestamp_divider"
    assert str(known[0x1104][0]) == "ioport[1].ddr"
    assert 0x3A00 not in known  # the optional timer select: the card does not say whether it has it


def test_generation_b_moves_the_same_registers() -> None:
    with hostmot2.open("emu://5i25+7i77?firmware=b") as board:
        known = places(board.inventory)
    assert str(known[0x5B00][0]) == "sserial.command"
    assert str(known[0x3600][0]) == "muxed_encoder[0].count"


def test_a_word_is_described_by_its_readable_fields() -> None:
    """card_observed.md 4h: unconnected inputs power up as 8003."""
    with hostmot2.open("emu://5i25+7i77") as board:
        place = places(board.inventory)[0x3600][0]
    text = describe(place, 0x00018003)
    assert "input_a=1 input_b=1 input_index=0" in text
    assert "quad_error=1 latch=0x0001" in text
