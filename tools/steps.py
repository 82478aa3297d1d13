"""How the steps of tools/check.py are made, run two at a time, repeated and told."""

from __future__ import annotations

import os
import re
import subprocess
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SANITIZER_REPORT = re.compile(r"^.*(runtime error:|ERROR: \w+Sanitizer)(.*\n){0,12}", re.MULTILINE)


class Failed(Exception):
    """A step found something; the text is its output."""


class Repeat(Exception):
    """A step failed as it may on a busy machine: `again` does that part anew, when nothing else runs.

    The text is what failed first; it is told whatever the repetition says.
    """

    def __init__(self, first: str, again: Callable[[], str]) -> None:
        super().__init__(first)
        self.again = again


class Skipped(Exception):
    """A step could not run here; the text is the reason."""


STEPS: dict[str, Callable[[], str]] = {}


def step(function: Callable[[], str]) -> Callable[[], str]:
    """Makes a function a step; the slowest are declared first."""
    STEPS[function.__name__.replace("_", "-")] = function
    return function


def run(
    *command: str, env: dict[str, str] | None = None, cwd: Path = ROOT, codes: tuple[int, ...] = (0,)
) -> str:
    """The output of a command; Failed with the end of it if it does not end well."""
    environment = os.environ | (env or {})
    result = subprocess.run(
        command,
        cwd=cwd,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if result.returncode not in codes:
        report = SANITIZER_REPORT.search(result.stdout)  # that is where to look first
        head = f"{report[0][:2000]}\n...\n" if report else ""
        tail = result.stdout[-12000:]
        raise Failed(f"$ {' '.join(command)}\n{head}{tail}exit status {result.returncode}")
    return result.stdout


def last_line(output: str) -> str:
    """The summary most tools end with."""
    lines = [line for line in output.strip().splitlines() if line.strip()]
    return lines[-1].strip("= ") if lines else ""


@dataclass(frozen=True)
class Outcome:
    """How a step ended."""

    name: str
    verdict: str  # ok, FAILED, SKIPPED, REPEAT
    text: str
    seconds: float
    again: Callable[[], str] | None = None


def perform(name: str, call: Callable[[], str]) -> Outcome:
    """Runs one step, or the part of it that is repeated."""
    start = time.monotonic()
    again = None
    try:
        verdict, text = "ok", call()
    except Skipped as reason:
        verdict, text = "SKIPPED", str(reason)
    except Repeat as repeat:
        verdict, text, again = "REPEAT", str(repeat), repeat.again
    except Failed as failure:
        verdict, text = "FAILED", str(failure)
    return Outcome(name, verdict, text, time.monotonic() - start, again)


def outcomes_of(names: list[str]) -> Iterator[Outcome]:
    """Two steps at a time; then, one after the other, what is repeated."""
    later = []
    with ThreadPoolExecutor(2) as pool:
        for future in as_completed([pool.submit(perform, name, STEPS[name]) for name in names]):
            yield future.result()
            if future.result().again:
                later.append(future.result())
    for outcome in later:
        assert outcome.again
        yield perform(outcome.name, outcome.again)
