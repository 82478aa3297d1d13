"""Terminals, jumpers and LEDs as the manuals give them, and that they agree with the rest of the package."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import pytest

import hostmot2
from hostmot2.cli.main import main
from hostmot2.registers import Gtag
from hostmot2.wiring import WIRING
from hostmot2.wiring.drawing import draw

CARD = WIRING["7i77"]


def test_each_connector_numbers_its_pins_from_one_without_gaps() -> None:
    for card in WIRING.values():
        for connector in card.connectors:
            assert [t.pin for t in connector.terminals] == list(range(1, len(connector.terminals) + 1)), (
                connector.name
            )


@pytest.mark.parametrize(
    ("connector", "pin", "signal"),
    [
        ("P1", 17, "ENCMUX"), ("P1", 4, "SS0RX"), ("P1", 1, "SS2TXEN"), ("P1", 13, "QCMUXI45"),
        ("TB2", 5, "VIN"), ("TB2", 8, "GROUND"), ("TB3", 1, "QA0"), ("TB3", 24, "/IDX2"), ("TB4", 12, "QB4"),
        ("TB5", 4, "AOUT0"), ("TB5", 21, "ENA5-"), ("TB6", 3, "RX+"), ("TB8", 1, "INPUT0"),
        ("TB8", 24, "OUTPUT7"), ("TB7", 16, "INPUT31"), ("TB7", 17, "OUTPUT8"),
    ],
)  # fmt: skip
def test_terminals_of_the_7i77_manual(connector: str, pin: int, signal: str) -> None:
    assert CARD.connector(connector).terminals[pin - 1].signal == signal


def test_of_two_figures_in_a_manual_the_stricter_is_the_limit() -> None:
    """7I77 manual, operation and specifications; 8I20 manual, motor power: above 385 V the drive faults."""
    limits = {limit.what: (limit.minimum, limit.maximum) for card in WIRING.values() for limit in card.limits}
    assert limits["field voltage VFIELD"] == (5.0, 28.0)
    assert limits["field logic voltage VIN"] == (10.0, 32.0)
    assert limits["load of one field output"] == (None, 0.3)
    assert limits["motor power"] == (35.0, 385.0)
    notes = [t.note for card in WIRING.values() for c in card.connectors for t in c.terminals]
    assert not [note for note in notes if "400 V" in note or "8 to 32" in note]


def test_host_signals_are_where_the_firmware_has_its_functions() -> None:
    """Directions on P1 seen from the card are the FPGA's turned round."""
    with hostmot2.open("emu://5i25+7i77?clock=virtual") as board:
        by_pin = {pin.connector_pin: pin for pin in board.pins if pin.connector == "P3"}
        for terminal in CARD.connector("P1").terminals[:17]:
            pin = by_pin[terminal.pin]
            assert f"I/O {pin.index}" == terminal.note
            assert pin.is_output == (terminal.direction == "in"), terminal
            module = Gtag.SSERIAL if terminal.signal.startswith("SS") else None
            assert module is None or pin.secondary_gtag == module


def test_every_jumper_has_two_positions_and_no_jumper_stands_twice() -> None:
    for card in WIRING.values():
        names = [name for jumper in card.jumpers for name in jumper.names]
        assert len(names) == len(set(names))
        assert all(len(jumper.positions) == 2 for jumper in card.jumpers)
    assert sorted(int(n[1:]) for j in CARD.jumpers for n in j.names) == list(range(1, 23))


def test_the_drawing_is_a_picture_with_every_terminal() -> None:
    for card in WIRING.values():
        text = "".join(ET.fromstring(draw(card)).itertext())
        for connector in card.connectors:
            for terminal in connector.terminals:
                assert terminal.signal in text


def test_the_command_tells_one_connector_or_everything(capsys: pytest.CaptureFixture[str]) -> None:
    def run(*arguments: str) -> tuple[int, str]:
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        return int(ended.value.code or 0), capsys.readouterr().out

    status, text = run("pins", "7i77", "--connector", "tb5")
    assert status == 0
    assert "AOUT3" in text
    assert "QA0" not in text
    assert json.loads(run("--json", "pins", "8i20")[1])["name"] == "8i20"
    assert run("pins", "7i77", "--connector", "TB9")[0] == 2


def test_what_a_card_does_not_have_is_named() -> None:
    card = WIRING["7i77"]
    with pytest.raises(KeyError, match="7i77 has no connector 'TB99'"):
        card.connector("TB99")
    with pytest.raises(KeyError, match="TB2 has no 'VBUS'"):
        card.connector("TB2").terminal("VBUS")
