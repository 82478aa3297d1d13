"""The emulated SSLBP firmware against recordings of the real one."""

from __future__ import annotations

import pytest

from tests.emulator.sslbp_replay import GOLDEN, Replay

TRACES = sorted(path.stem for path in GOLDEN.glob("*.jsonl"))


@pytest.mark.parametrize("trace", TRACES)
def test_emulated_firmware_answers_as_recorded(trace: str) -> None:
    assert Replay(trace).run() == []
