"""The emulated LBP16 engine against the fact sheet's dialogue and against recorded LinuxCNC cycles."""

from __future__ import annotations

import json
import re
import struct
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lbp16_reference import Command

from hostmot2 import flash_layout
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.board import UNDRIVEN
from hostmot2.emulator.ethernet import DESCRIPTIONS, EthernetCard, EthernetDescription, description

GOLDEN = Path(__file__).parent / "golden"
ID_BLOCK = bytes.fromhex("84c20001fecaaa55484f53544d4f543200040000")
QUICK = {"restart_us": 20_000, "reload_us": 20_000}


def card(**facts) -> EthernetCard:
    engine = EthernetCard(EthernetDescription("7I92", **{**QUICK, **facts}))
    return engine


def dialogue() -> list[tuple[int, bytes, str]]:
    """Line number, request, expected reply of the golden trace."""
    steps, request = [], b""
    for number, line in enumerate((GOLDEN / "lbp16_trace.txt").read_text().splitlines(), 1):
        text = line.replace(" ", "")
        if text.startswith(">"):
            request = bytes.fromhex(text[1:])
        elif text.startswith("<"):
            steps.append((number, request, text[1:]))
    return steps


def test_dialogue_of_the_fact_sheet():
    engine = card()
    assert engine.process(ID_BLOCK) is None
    wrong = []
    for number, request, expected in dialogue():
        reply = engine.process(request)
        got = "none" if reply is None else reply.hex()
        if not re.fullmatch(expected.replace("x", "."), got):
            wrong.append(f"line {number}: > {request.hex()} expected {expected} got {got}")
    assert not wrong, "\n".join(wrong)


def test_recorded_linuxcnc_requests_get_replies_of_the_recorded_length():
    engine = card()
    for line in (GOLDEN / "linuxcnc_20cycles.jsonl").read_text().splitlines():
        record = json.loads(line)
        reply = engine.process(bytes.fromhex(record["req"]))
        assert len(reply or b"") == record["rsp_len"]
        if reply:  # the counters of LinuxCNC's own sequence check
            assert reply[-8:-4].hex() == record["rsp"][-16:-8]


def wait_until_it_answers(engine: EthernetCard) -> None:
    for _ in range(100):
        if engine.process(bytes.fromhex("01420001")):
            return
        time.sleep(0.005)
    raise AssertionError("the engine stayed silent")


def test_engine_reset_clears_ram_and_reads_the_eeprom_again():
    engine = card()
    engine.process(ID_BLOCK)
    engine.process(bytes.fromhex("84d110000100020003000400"))
    engine.process(bytes.fromhex("80420001"))
    engine.poke(2, 0x10, 0x4142)
    engine.process(bytes.fromhex("01d91c000100"))
    assert engine.process(bytes.fromhex("01420001")) is None
    wait_until_it_answers(engine)
    assert engine.process(bytes.fromhex("84511000")) == bytes(8)
    assert engine.peek(6, 2) == 0
    assert engine.process(bytes.fromhex("815d0000")) == b"BA"
    assert engine.process(bytes.fromhex("01420001")) == bytes.fromhex("fecaaa55")


def reload_request(words: list[int]) -> bytes:
    return b"".join(bytes.fromhex("01d91e00") + struct.pack("<H", word) for word in words)


@pytest.mark.parametrize(("efinix", "fallback"), [(False, False), (False, True), (True, False), (True, True)])
def test_reload_boots_the_image_asked_for(efinix, fallback):
    engine = card(efinix=efinix)
    if efinix:  # mesaflash sends rubbish behind the two words that count
        request = reload_request(flash_layout.efinix_reload_words(fallback) + [0x1234, 0xFFFF] * 6)
    else:
        request = reload_request(flash_layout.xilinx_reload_words(0x10000 if fallback else 0))
        assert len(request) == 84
    engine.process(ID_BLOCK)
    assert engine.process(request) is None
    assert engine.image == ("fallback" if fallback else "user")
    wait_until_it_answers(engine)
    assert engine.process(bytes.fromhex("01420001")) == bytes(4)  # registers are as at power-up


@pytest.mark.parametrize("rubbish", ["01d91e000400 01d91e000c00", "01420001", "01d110003412", "80420001"])
def test_behind_the_words_that_reload_nothing_of_a_packet_counts(rubbish):
    """mesaflash sends 72 bytes of whatever its memory holds behind an Efinix card's two words."""
    engine = card(efinix=True, reload_us=0)
    words = reload_request(flash_layout.efinix_reload_words(False))
    assert engine.process(words + bytes.fromhex(rubbish)) is None, "the engine that would answer is gone"
    assert engine.image == "user"
    assert [engine.peek(4, 0x10), engine.peek(6, 0), engine.peek(6, 2)] == [0, 0, 0]


def test_reload_falls_back_when_the_user_image_is_gone_and_dies_without_any():
    engine = card()
    engine.flash_write(0x100000, b"\xff" * 64)
    engine.process(reload_request(flash_layout.xilinx_reload_words(0)))
    assert engine.image == "fallback"
    engine.flash_write(0x10000, b"\xff" * 64)
    engine.power_up()
    assert engine.image == "none"
    assert engine.process(bytes.fromhex("01420001")) is None


def test_firmware_before_15_cannot_reload():
    engine = card(firmware_version=14)
    engine.process(ID_BLOCK)
    engine.process(reload_request(flash_layout.xilinx_reload_words(0)))
    assert engine.process(bytes.fromhex("01420001")) == bytes.fromhex("fecaaa55")


def test_boot_block_is_that_of_the_sheet():
    block = flash_layout.boot_block(0x100000)
    assert block.hex() == (
        "ffff" * 5 + "aa995566" + "31e1ffff" + "32610000" + "32810b10" + "32a10000" + "32c10b01"
        "30a10000" + "33012100" + "3201001f" + "30a1000e" + "2000" * 7
    )
    assert card().flash_read(0, 64) == block


def test_page_program_wraps_inside_its_page():
    engine = card()
    engine.flash_write(0x20000, b"\xff" * 0x300)
    engine.process(bytes.fromhex("01ce0000f8010200"))
    key = bytes.fromhex("01d91a00035a")
    engine.process(key + bytes.fromhex("04ce0400") + bytes(range(16)))
    assert engine.flash_read(0x20100, 0x100) == b"\xff" * 0x100  # still in the part's buffer
    assert engine.process(bytes.fromhex("014e0000")) == bytes.fromhex("08020200")
    assert engine.flash_read(0x201F8, 8) == bytes(range(8))
    assert engine.flash_read(0x20100, 8) == bytes(range(8, 16))
    assert engine.flash_read(0x20200, 0x100) == b"\xff" * 0x100


@pytest.mark.parametrize(
    ("request_", "counter"),
    [
        ("02d10001 1234", 4),  # space 4, two words wanted and one there
        ("02d10001", 4),
        ("02c10001 1234", 2),  # space 0 has no 16-bit words
        ("01c10001", 2),
        ("01c80001 12", 2),  # 8-bit
        ("01d50000", 2),  # space 5
    ],
)
def test_what_the_parser_refuses_is_a_parse_error_even_if_data_are_missing(request_, counter):
    """Hardware does not notice missing data; what it does notice comes first."""
    engine = card()
    assert engine.process(bytes.fromhex(request_)) is None
    assert [engine.peek(6, word) for word in (2, 4, 6)] == [int(counter == word) for word in (2, 4, 6)]


def test_an_erase_that_takes_more_than_3_seconds_is_a_write_error():
    """The engine polls the part that long; what it does meanwhile nobody knows, so the reply is lost."""
    request = bytes.fromhex("01d91a00035a 01ce0c0000000000 014e0000")
    with EmulatedBoard("7i92+7i77", clock="virtual") as board:
        for erase_us, errors in ((2_900_000, 0), (3_100_000, 1)):
            facts = EthernetDescription("7I92", **{**QUICK, "erase_us": erase_us})
            engine = EthernetCard(facts, board)
            before = board.now_us
            assert (engine.process(request) is None) == bool(errors)
            assert board.now_us - before == min(erase_us, 3_000_000)
            assert (engine.peek(6, 0), engine.peek(6, 6)) == (4 * errors, errors)


def test_a_reset_taken_back_in_the_same_packet_is_none():
    """The word is looked at when the packet is done."""
    engine = card(restart_us=0)
    engine.process(bytes.fromhex("01d110003412 01d91c000100 01d91c000000"))
    assert engine.peek(4, 0x10) == 0x1234
    engine.process(bytes.fromhex("01d91c000100"))
    assert engine.peek(4, 0x10) == 0


def test_a_reply_too_big_is_dropped_and_counted():
    engine = card()
    whole, one = bytes.fromhex("ff420000"), bytes.fromhex("81420000")
    assert len(engine.process(bytes.fromhex("fa420000") * 2 + bytes.fromhex("fc420000"))) == 1472
    assert engine.process(whole * 3) is None
    assert engine.peek(6, 0x00) == 0x10
    assert engine.peek(6, 0x12) == 1
    assert engine.process(one) == bytes(4)


def test_a_frame_too_long_is_a_bad_frame():
    engine = card()
    assert engine.process(bytes.fromhex("81420000") * 369) is None
    assert (engine.peek(6, 0x00), engine.peek(6, 0x0C)) == (0x08, 1)


def test_lbp_error_counters_saturate():
    engine = card()
    engine.poke(6, 2, 0xFFFE)
    for _ in range(3):
        engine.process(bytes.fromhex("80420001"))
    assert engine.peek(6, 2) == 0xFFFF


def test_microsecond_stamp_runs_and_waiting_takes_its_time():
    engine = card()
    (before, after) = struct.unpack("<HH", engine.process(bytes.fromhex("01510000 01d10200d007 01510000")))
    assert (after - before) % 0x10000 >= 2000


def test_the_engine_keeps_the_time_of_a_card_with_a_virtual_clock():
    with EmulatedBoard("7i92+7i77", clock="virtual") as board:
        engine = EthernetCard(EthernetDescription("7I92", restart_us=100_000), board)
        stamps = struct.unpack(
            "<HHH", engine.process(bytes.fromhex("01510000 01d10200d007 01510000 015d1800"))
        )
        assert (stamps[1] - stamps[0]) % 0x10000 == 2000
        assert stamps[2] == stamps[0], "the packet came in when its first command ran"
        board.advance(500.0)
        assert engine.process(bytes.fromhex("01510000")) == struct.pack("<H", stamps[1] + 500)
        engine.process(bytes.fromhex("01d91c000100"))
        board.advance(99_999.0)
        assert engine.process(bytes.fromhex("01420001")) is None
        board.advance(2.0)
        assert engine.process(bytes.fromhex("01420001")) == bytes.fromhex("fecaaa55")


def test_space_0_wraps_at_64_kib():
    engine = card()
    engine.process(bytes.fromhex("82c2fcff 11111111 22222222"))
    assert engine.process(bytes.fromhex("81420000")) == b"\x22" * 4


@pytest.mark.parametrize("spec", ["7i92+7i77", "7i76e", "7i96", "7i80hd"])
def test_card_name_in_eeprom_and_information_space_agree(spec):
    engine = EthernetCard(description(spec))
    name = engine.process(bytes.fromhex("885d0000"))
    assert name == engine.process(bytes.fromhex("88491000"))
    assert name.rstrip(b"\0").decode().lower().startswith(spec.split("+")[0])


@pytest.mark.parametrize("strict", [False, True])
def test_a_packet_goes_on_behind_words_that_nothing_decodes(strict):
    with EmulatedBoard("7i92+7i77", clock="virtual", strict=strict) as board:
        engine = EthernetCard(description("7i92"), board)
        engine.process(bytes.fromhex("89c20011") + struct.pack("<9I", *range(0x100, 0x109)))
        ports = (0x108, 0x101, *(UNDRIVEN,) * 6, 0x108)  # they repeat every 32 bytes
        assert engine.process(bytes.fromhex("89420011")) == struct.pack("<9I", *ports)


def test_pci_cards_have_no_ethernet_description():
    with pytest.raises(ValueError, match="no emulated Ethernet card '5i25"):
        description("5i25+7i77")


@given(
    st.lists(
        st.tuples(st.integers(0, 0x3FFF), st.integers(0, 2**32 - 1), st.booleans()), min_size=1, max_size=40
    )
)
def test_space_0_behaves_as_a_list_of_words(operations):
    engine, model, request, expected = card(), {}, b"", b""
    for place, value, write in operations:
        data = struct.pack("<I", value)
        request += Command(0, 4, 1, write=write, address=place * 4, data=data if write else b"").wire()
        if write:
            model[place] = data
        else:
            expected += model.get(place, bytes(4))
    assert (engine.process(request) or b"") == expected


@given(st.binary(max_size=1600))
def test_no_packet_breaks_the_engine(packet):
    engine = card()
    engine.process(packet)
    engine.power_up()
    assert engine.process(bytes.fromhex("814207018142fe01")) is not None


def test_every_card_description_makes_a_card():
    for facts in DESCRIPTIONS.values():
        assert EthernetCard(facts).image == "user"


def test_waiting_for_a_dpll_line_takes_until_its_edge():
    """registers.md 2.8: at 100 MHz prescale 24 and base rate 1055531162 make a reference of 1 kHz."""
    with EmulatedBoard("7i92+7i77", clock="virtual") as board:
        engine = EthernetCard(description("7i92"), board)
        board.write(0x7200, 24 << 24 | 0x400000)
        board.write(0x7000, 1055531162)
        engine.process(bytes.fromhex("01d10400d007"))  # limit 2000 us
        engine.process(bytes.fromhex("01510600"))
        start = board.now_us
        (waited,) = struct.unpack("<H", engine.process(bytes.fromhex("01510600")))
        assert waited == 1000
        assert board.now_us - start == 1000
        assert engine.peek(6, 0) == 0
        engine.process(bytes.fromhex("01d10400f401"))  # limit 500 us: runs out
        assert engine.process(bytes.fromhex("01510600")) == struct.pack("<H", 500)
        assert engine.peek(6, 0) == 0x20
