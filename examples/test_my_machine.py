"""Your machine's code under test without a machine: the fixtures come with hostmot2's pytest plug-in.

pytest examples/test_my_machine.py
"""

import pytest

from hostmot2 import HostMot2Error


def jog_until_switch(card, emulated, volts: float, switch: int) -> None:
    """The code under test: jog axis 0 until a field input closes."""
    card.analog[0].volts = volts
    card.analog_enable = True
    for _ in range(1000):
        emulated.advance(1000.0)
        card.exchange()
        if card.inputs[switch]:
            break
    card.analog_enable = False
    card.analog[0].volts = 0.0
    card.exchange()


def test_the_jog_stops_at_the_switch(hm2_board, hm2_emulated):
    card = hm2_board.card("7i77")
    card.start()
    hm2_emulated.sserial[0].remote(0).set("input", 1 << 7)
    jog_until_switch(card, hm2_emulated, 1.0, switch=7)
    analog = hm2_emulated.sserial[0].remote(1)
    assert analog.get("analogena") is False
    assert analog.get("analogout0") == 0.0


def test_a_dead_remote_is_an_error_and_not_a_motion(hm2_board, hm2_emulated):
    card = hm2_board.card("7i77")
    hm2_emulated.sserial[0].remote(1).alive = False
    with pytest.raises(HostMot2Error, match="0x02"):
        card.start()
