"""The keys by which a served card is steered: what can be read and set, and what is refused."""

import pytest

from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.control import Controls, answer
from hostmot2.emulator.ethernet import EthernetServer, Fault


@pytest.fixture
def controls():
    board = EmulatedBoard("7i92+7i77", clock="virtual")
    with EthernetServer(board) as server:
        yield Controls(board, server)


def test_faults_are_read_back_as_they_were_set(controls):
    for key, value in (
        ("loss", 0.5),
        ("dup", 0.25),
        ("reorder", 1),
        ("delay", 100),
        ("jitter", 7),
        ("seed", 3),
    ):
        assert answer(controls, f"set fault.{key} {value}") == "ok"
        assert float(answer(controls, f"get fault.{key}")) == value
    assert answer(controls, "set fault.replies 0") == "ok"
    assert answer(controls, "get fault.replies") == "0"


def test_a_change_of_another_fault_does_not_draw_the_same_again():
    """A seed is set once: another setting later goes on with the same draw."""
    board = EmulatedBoard("7i92+7i77", clock="virtual")
    with EthernetServer(board) as server:
        steered = Controls(board, server, Fault(seed=5))
        assert answer(steered, "get fault.seed") == "5"
        assert answer(steered, "set fault.loss 0.1") == "ok"
        assert answer(steered, "get fault.seed") == "0"


def test_counters_encoders_leds_and_elements(controls):
    assert answer(controls, "get requests") == "0"
    assert answer(controls, "get replies") == "0"
    assert answer(controls, "set encoder0_position 12") == "ok"
    assert answer(controls, "get encoder0_position") == "12"
    assert answer(controls, "get encoder0_rate") == "0"
    assert answer(controls, "set encoder0_rate -1000") == "ok"
    assert answer(controls, "get encoder0_rate") == "-1000"
    assert answer(controls, "get led0") == "0"
    assert answer(controls, "set 0.fieldvoltage 0x10") == "ok"
    assert float(answer(controls, "get fieldvoltage")) == pytest.approx(16, abs=0.5)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("get fault.color", "faults are"),
        ("set fault.loss 2", "a probability is 0 to 1"),
        ("set fault.delay -1", "-1.0 is negative"),
        ("set led0 1", "can only be read"),
        ("get led99", "LEDs"),
        ("get x.fieldvoltage", "no key"),
        ("get 7.fieldvoltage", "no daughter card 7"),
        ("get nothing", "no remote of daughter card 0"),
        ("get encoder99_rate", ""),
        ("set fieldvoltage much", "could not convert"),
        ("fly", "get KEY, or set KEY VALUE"),
    ],
)
def test_what_there_is_none_of_is_said(controls, line, said):
    text = answer(controls, line)
    assert text.startswith("error: ")
    assert said in text
