"""One change tried: always put back, and a difference is claimed only where there is one."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from doctor.trees import FakeLinks, machine
from hostmot2.doctor.experiment import interval, try_change
from hostmot2.doctor.knobs import KEYS, Knob, knob
from hostmot2.doctor.links import Coalescing
from hostmot2.doctor.measure import Measurement, lateness
from hostmot2.histogram import Histogram

ROOT = Path(__file__).parent.parent.parent


class Setting:
    """A knob in memory that takes 10 us off when it is at "0"."""

    def __init__(self, effect_us: float = 10.0) -> None:
        self.value, self.effect_us = "57", effect_us
        self.history: list[str] = []
        self._random = random.Random(3)

    def knob(self) -> Knob:
        return Knob("rx-usecs", lambda: self.value, self._write, kept=False)

    def _write(self, value: str) -> None:
        self.value = value
        self.history.append(value)

    def probe(self) -> Measurement:
        base = 60.0 - (self.effect_us if self.value == "0" else 0)
        times = [round(1000 * (base + self._random.gauss(0, 2))) for _ in range(200)]
        return Measurement("round trip", "made up", Histogram(times))


def test_a_change_that_helps_is_told_with_its_bounds() -> None:
    setting = Setting()
    outcome = try_change(setting.knob(), "0", setting.probe)
    found = outcome.differences["p50"]
    assert found.verdict == "faster"
    assert found.low < -9 < found.before - 60 + found.high + 2
    assert found.low <= -10 <= found.high or abs(found.low + 10) < 1
    assert outcome.restored
    assert setting.value == "57"
    assert setting.history.count("0") == 10


def test_a_change_that_does_nothing_is_not_told_as_one() -> None:
    setting = Setting(effect_us=0)
    assert try_change(setting.knob(), "0", setting.probe).differences["p50"].verdict == "no difference shown"


def test_both_are_measured_first_in_turn() -> None:
    setting = Setting()
    try_change(setting.knob(), "0", setting.probe, rounds=6)
    assert setting.history == ["57", "0", "0", "57"] * 3 + ["57"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_an_exception_puts_the_setting_back(error: type[BaseException]) -> None:
    setting = Setting()

    def probe() -> Measurement:
        if setting.value == "0":
            raise error
        return setting.probe()

    with pytest.raises(error):
        try_change(setting.knob(), "0", probe)
    assert setting.value == "57"


def test_the_interval_covers_what_it_says() -> None:
    """By the binomial distribution; here counted for a skewed distribution whose median is known."""
    generator = random.Random(1)
    inside = 0
    for _ in range(2000):
        low, high, sure = interval([generator.expovariate(1) for _ in range(10)])
        inside += low <= 0.6931 <= high
    assert sure == pytest.approx(0.9785, abs=1e-4)
    assert inside / 2000 >= 0.965
    with pytest.raises(ValueError, match="too few"):
        interval([1.0] * 5)


PROGRAM = """
import sys, time
from pathlib import Path
from hostmot2.doctor import knobs
from hostmot2.doctor.experiment import try_change
from hostmot2.doctor.measure import lateness

path = Path(sys.argv[1])
made = knobs._files("rt-runtime", [path], "file")
def probe():
    print("measuring", path.read_text(), flush=True)
    time.sleep(0.2)
    return lateness(100, priority=0)
try_change(made, "1", probe, rounds=50)
"""


def started(tmp_path: Path) -> tuple[subprocess.Popen[str], Path]:
    """A program in the midst of trying a change to a setting that stands in for the kernel's."""
    root = tmp_path / "root"
    path = root / "proc/sys/kernel/sched_rt_runtime_us"
    path.parent.mkdir(parents=True)
    path.write_text("950000")
    stand_in = (
        tmp_path / "sitecustomize.py"
    )  # the guardian is a process of its own: it must see the same tree
    stand_in.write_text(
        textwrap.dedent(f"""
        import pathlib
        from hostmot2.doctor import machine
        init = machine.Machine.__init__
        init.__defaults__ = (pathlib.Path({str(root)!r}), *init.__defaults__[1:])
        """)
    )
    env = os.environ | {"PYTHONPATH": f"{tmp_path}:{ROOT}"}
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(path)], stdout=subprocess.PIPE, text=True, env=env
    )
    assert process.stdout is not None
    for line in process.stdout:
        if line.split()[1:] == ["1"]:
            break
    return process, path


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_no_way_to_end_leaves_the_change_behind(tmp_path: Path, number: signal.Signals) -> None:
    process, path = started(tmp_path)
    assert path.read_text() == "1"
    process.send_signal(number)
    process.communicate()
    end = time.monotonic() + 30
    while path.read_text() != "950000" and time.monotonic() < end:
        time.sleep(0.05)
    assert path.read_text() == "950000"


def test_every_key_is_a_knob_or_says_what_is_missing(tmp_path: Path) -> None:
    root = machine(tmp_path)
    links = FakeLinks(coalesce=Coalescing(57, 30, True, False), sleeping=True)
    seen = {key: knob(key, root, lambda: links, "enp2s0").read() for key in KEYS}
    assert seen == {
        "rx-usecs": "57", "tx-usecs": "30", "adaptive-rx": "on", "adaptive-tx": "off", "eee": "on",
        "irq-cpu": "3", "governor": "performance", "cpu_dma_latency": "", "timer-slack": "50000",
        "rt-runtime": "950000",
    }  # fmt: skip
    with pytest.raises(ValueError, match="belongs to an interface"):
        knob("rx-usecs", root, lambda: links, None)
    with pytest.raises(ValueError, match="cannot be tried"):
        knob("magic", root, lambda: links, None)


def test_knobs_write_what_they_read(tmp_path: Path) -> None:
    root = machine(tmp_path, {"/proc/irq/40/smp_affinity_list": "0"})
    links = FakeLinks(coalesce=Coalescing(57, 0, True, False), sleeping=True)
    for key, value in (("rx-usecs", "0"), ("adaptive-rx", "off"), ("eee", "off"), ("irq-cpu", "2")):
        made = knob(key, root, lambda: links, "enp2s0")
        old = made.read()
        made.write(value)
        assert made.read() == value
        made.write(old)
        assert made.read() == old
    assert (tmp_path / "proc/irq/40/smp_affinity_list").read_text() == "0", "each to its own"
    assert (tmp_path / "proc/irq/41/smp_affinity_list").read_text() == "3"


def test_cpu_dma_latency_is_held_while_it_is_tried(tmp_path: Path) -> None:
    made = knob("cpu_dma_latency", machine(tmp_path), FakeLinks, None)
    made.write("0")
    assert (tmp_path / "dev/cpu_dma_latency").read_bytes() == bytes(4)
    assert str(tmp_path / "dev/cpu_dma_latency") in {
        os.readlink(p) for p in Path("/proc/self/fd").iterdir() if p.is_symlink() and p.exists()
    }
    made.write("")
    assert not made.read()


def test_wake_ups_are_measured_and_scheduling_is_put_back() -> None:
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)
    found = lateness(100, cpu=min(before[1]))
    assert len(found.times) == 100
    assert found.times.minimum >= 0
    assert f"processor {min(before[1])}" in found.how
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == before
