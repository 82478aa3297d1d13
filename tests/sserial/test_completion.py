"""When the end of a DOIT is seen, in virtual time, beside a twin whose COMMAND is looked at all the time."""

import pytest

from hostmot2.bench.completion import STEP_US, completions
from hostmot2.bench.doit import MIXES


@pytest.mark.parametrize("mix", MIXES[3:], ids=[mix.name for mix in MIXES[3:]])
def test_the_end_of_a_doit_is_seen_within_two_microseconds_and_few_looks(mix):
    found = completions(mix, 50)
    assert min(found.seen) > -STEP_US
    assert found.latest <= 2.0
    assert found.looks <= 3
    # what the fact sheet says of this mix, sserial.md 10: the line, and 4 to 9 us of firmware
    assert found.line < min(found.busy) - found.turnaround
    assert max(found.busy) <= 100.0 + found.turnaround
