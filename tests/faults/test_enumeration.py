"""One fault at a time, at counted steps of every operation. The whole of it: python -m tests.faults."""

from __future__ import annotations

import pytest

from faults.enumeration import OPERATIONS, Tally, groups, run_all, tabulate
from faults.layers import LAYERS, NAMES

QUICK, SLOW = 1, 5
"""Steps of each kind that are tried here."""


def total(most: int, workers: int) -> Tally:
    everything = Tally()
    for tally in tabulate(run_all(groups(most), workers)).values():
        everything += tally
    return everything


def test_every_fault_is_tried_or_has_a_reason_not_to_be() -> None:
    for layer in LAYERS:
        assert {variant.fault for variant in layer.variants} | set(layer.reasons) == set(NAMES)
        assert all(layer.reasons.values())
    assert {operation.name for operation in OPERATIONS} >= {
        "open",
        "discover",
        "start",
        "parameter read",
        "parameter write",
        "EEPROM save",
        "cycle",
        "stop",
        "close",
    }


def test_a_step_of_each_kind_fails_and_everything_holds() -> None:
    tally = total(QUICK, workers=0)
    assert not tally.wrong, "\n".join(tally.wrong)
    assert tally.reached > tally.runs * 0.9


@pytest.mark.slow
@pytest.mark.timeout(900)  # thousands of runs, on processors that other tests want, too
def test_steps_of_each_kind_fail_and_everything_holds() -> None:
    tally = total(SLOW, workers=2)
    assert not tally.wrong, "\n".join(tally.wrong)
    assert tally.reached > tally.runs * 0.9
