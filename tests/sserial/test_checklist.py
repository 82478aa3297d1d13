"""What to check when a remote is silent: in the order that the answers of the others suggest."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import hostmot2
from hostmot2.board import Board
from hostmot2.sserial import NoRemote, SetupJumper
from hostmot2.sserial.checklist import checklist_of
from hostmot2.wiring import WIRING, CardFacts

VIRTUAL = "emu://5i25+7i77?clock=virtual"


@contextmanager
def opened(options: str = "", card: str = VIRTUAL) -> Iterator[Board]:
    with hostmot2.open(card + options) as board:
        yield board


def start_error(options: str, mask: int) -> NoRemote:
    with opened(options) as board, pytest.raises(NoRemote) as caught:
        board.sserial.start(mask).raise_for_failed()
    return caught.value


def test_field_io_alone_silent_points_at_vin_first_and_names_its_terminals() -> None:
    """7I77 manual: VIN is TB2-5, ground TB2-8, VFIELD TB2-1 to 4; W1 left joins them; W12 is field set-up."""
    error = start_error("&silent=0", 0x01)
    assert error.causes[0].startswith("field logic power VIN")
    assert "TB2-5 against TB2-8" in error.causes[0]
    assert [index for index, cause in enumerate(error.causes) if "W12" in cause] == [2]
    assert any("analog outputs (channel 1) did answer" in line for line in error.evidence)
    text = str(error)
    assert text.index("VIN") < text.index("CR3") < text.index("W12")


def test_analog_alone_silent_points_at_5_v_first() -> None:
    """W5 chooses 5 V from the cable or TB1; CR6 and CR7 watch the analog supplies; W4 is analog set-up."""
    error = start_error("&silent=1", 0x02)
    assert error.causes[0].startswith("5 V: CR1")
    assert [("CR6" in c, "W4" in c) for c in error.causes[1:]] == [(True, False), (False, True)]
    assert not any("VIN" in cause for cause in error.causes)


def test_nothing_of_the_card_points_at_5_v_and_cable_before_field_power() -> None:
    error = start_error("&silent=0,1", 0x03)
    assert error.causes == WIRING["7i77"].silent_checks
    places = [next(i for i, c in enumerate(error.causes) if word in c) for word in ("CR1", "P1", "VIN")]
    assert places == sorted(places)
    assert not any("did answer" in line for line in error.evidence)


def test_the_others_are_asked_even_if_only_one_was_to_start() -> None:
    """Which advice is right depends on them; in set-up mode, too."""
    with opened("&silent=0") as board:
        result = board.sserial.start(0x01, "setup")
        assert result.failed == 1
        assert result.advice.checks == WIRING["7i77"].remotes[0].checks
    with opened("&silent=0") as board, pytest.raises(NoRemote) as caught:
        board.sserial[0].channels[0].discover()
    assert caught.value.causes == WIRING["7i77"].remotes[0].checks


def test_the_second_7i77_is_judged_by_its_own_connector() -> None:
    with opened("&silent=3", "emu://5i25+7i77x2?clock=virtual") as board, pytest.raises(NoRemote) as caught:
        board.sserial.start(0x1B).raise_for_failed()
    assert caught.value.causes == WIRING["7i77"].remotes[0].checks
    assert any("at P2" in line and "(channel 4)" in line for line in caught.value.evidence)


def test_a_free_connector_is_no_fault_in_a_scan_but_one_that_was_asked_for_is() -> None:
    with opened() as board:
        scan = board.sserial[0].scan()
        assert scan.wrong == ()
        assert scan.advice.checks == ()
        assert "TB6" in scan.advice.seen[0]
    assert any("TB6-3" in cause for cause in start_error("", 0x04).causes)


def test_a_set_up_jumper_is_found_by_its_rate() -> None:
    """W4 right, 7I77 manual: set-up mode is fixed at 115.2 kbaud."""
    with opened("&setup=1") as board:
        port = board.sserial[0]
        before = [channel.baud_rate for channel in port.channels]
        scan = port.scan(setup_rate=True)
        assert "115.2 kbaud only" in scan[1].reason
        assert scan.advice.checks == ("the set-up jumper: W4 left for operate mode, then cycle the power",)
        assert [channel.baud_rate for channel in port.channels] == before
        with pytest.raises(SetupJumper):
            _ = port.channels[1].outputs
        assert port.start(0x01).failed == 0, "the others are not disturbed"


def test_a_bitfile_for_another_card_gets_the_general_list() -> None:
    """A 7I76E's second channel is RS-422 for any remote: nothing is invented about it."""
    with opened("", "emu://7i76e?clock=virtual") as board:
        result = board.sserial.start(0x02)
        assert result.advice.checks == tuple(NoRemote.causes[:-1]), "the bitfile is good: the 7I76 answers"
        assert not re.search(r"TB\d|W\d", "".join(result.advice.checks[:2]))


def test_a_damaged_line_is_told_from_a_silent_one() -> None:
    from hostmot2.emulator import EmulatedBoard

    board = EmulatedBoard("5i25+7i77", clock="virtual")
    board.sserial[0].remote(0).inject(bad_crc=1000)
    with hostmot2.open(board) as hm2:
        result = hm2.sserial.start(0x01)
    assert "polarity" in result.advice.checks[0]
    board.close()


TOKEN = re.compile(r"\b(TB\d+|J\d+|P\d+)(?:-(\d+))?\b|\b(W\d+|CR\d+)\b")


@pytest.mark.parametrize("card", WIRING.values(), ids=lambda card: card.name)
def test_checklists_name_only_terminals_jumpers_and_leds_of_the_manual(card: CardFacts) -> None:
    """hostmot2/wiring is copied from the manuals' tables; nothing else may be named."""
    jumpers = {name for jumper in card.jumpers for name in jumper.names}
    leds = {led.name for led in card.leds}
    found = 0
    for checks in checklist_of(card.name).values():
        for text in checks:
            for block, pin, part in TOKEN.findall(text):
                found += 1
                if part:
                    assert part in (jumpers if part.startswith("W") else leds), text
                else:
                    connector = card.connector(block)
                    assert not pin or 1 <= int(pin) <= len(connector.terminals), text
    assert found > 5


def test_signals_named_with_a_terminal_are_the_terminals_own() -> None:
    text = " ".join(check for checks in checklist_of("7i77").values() for check in checks)
    power = WIRING["7i77"].connector("TB2")
    assert (power.terminal("VIN").pin, power.terminal("GROUND").pin) == (5, 8)
    assert "VIN: 10 to 32 V on TB2-5 against TB2-8" in text
    assert [t.pin for t in power.terminals if t.signal == "VFIELD"] == [1, 2, 3, 4]
    assert "VFIELD, TB2-1 to TB2-4" in text
    serial = WIRING["7i77"].connector("TB6")
    assert [serial.terminal(name).pin for name in ("RX+", "RX-", "TX+", "TX-")] == [3, 4, 5, 6]
    assert "TB6-3 and TB6-4 (RX+, RX-)" in text
    assert "TB6-5 and TB6-6 (TX+, TX-)" in text


def test_scan_at_the_prompt_has_a_row_per_channel_with_its_reason_and_the_checklist(command_line) -> None:
    status, out, _ = command_line("--board", f"{VIRTUAL}&silent=0", "sserial", "scan")
    assert status == 0
    lines = out.splitlines()
    assert [line.split()[0] for line in lines[1:4]] == ["0", "1", "2"]
    assert "no answer" in lines[1]
    assert "field I/O" in lines[1]
    assert out.index("1. field logic power VIN") < out.index("3. W12")
    rows = json.loads(command_line("--board", f"{VIRTUAL}&silent=0", "--json", "sserial", "scan")[1])
    assert [bool(row["checks"]) for row in rows] == [True, False, False]
    assert rows[0]["place"] == {"connector": "P3", "card": "7i77", "remote": "field I/O"}


def test_the_error_at_the_prompt_has_what_evidence_causes_and_what_to_do(command_line) -> None:
    status, _, err = command_line("--board", f"{VIRTUAL}&silent=0", "param", "list", "0.0")
    assert status == 6
    heads = [line.split(":")[0].strip() for line in err.splitlines() if re.match(r"  [A-Z]", line)]
    assert heads == ["Evidence", "Likely", "Do", "More"]
    assert "HM2-E021 NoRemote" in err
    assert "TB2-5" in err


def test_a_url_takes_power_or_sets_jumpers_only_where_remotes_are(command_line) -> None:
    for option in ("silent=2", "setup=9.0", "silent=x", "silent=0.7"):
        status, _, err = command_line("--board", f"{VIRTUAL}&{option}", "info")
        assert status == 2
        assert "there is no remote" in err
