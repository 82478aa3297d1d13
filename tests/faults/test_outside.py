"""What comes from outside the program, in small; the whole counts are commands, see faults/__init__.py."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from faults.enumeration import pairs, run_pairs
from faults.interrupts import interrupt
from faults.kills import kill
from faults.soak import soak


@pytest.mark.slow
def test_two_faults_at_once() -> None:
    wrong = [text for _, tally in run_pairs(pairs(400)) for text in tally.wrong]
    assert not wrong, "\n".join(wrong)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # Ctrl-C within a finalizer
def test_ctrl_c_at_any_moment() -> None:
    result = interrupt(300, seed=2)
    assert result.interrupted == 300
    assert not result.wrong, "\n".join(result.wrong)


@pytest.mark.slow
def test_the_motor_stops_in_time_whenever_its_driver_is_killed() -> None:
    kills = kill(6, seed=3)
    assert kills.stopped == kills.readable == kills.count


@pytest.mark.slow
def test_every_datagram_is_accounted_for_and_memory_stays_what_it_was() -> None:
    result = soak(10.0, 2000.0, "0.1%", every=1.0)
    assert result.lost > 0
    assert not result.wrong(), result.wrong()


@pytest.mark.slow
@pytest.mark.parametrize(("what", "count"), [("forks", 120), ("endings", 40)])
def test_forked_children_and_processes_that_end_leave_the_card_as_they_should(what: str, count: int) -> None:
    command = [sys.executable, "-m", f"tests.faults.{what}", "--count", str(count)]
    done = subprocess.run(
        command, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False, timeout=200
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 wrong" in done.stdout
