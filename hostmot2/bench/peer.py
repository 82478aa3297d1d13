"""LinuxCNC's hm2_eth and our engine on the same emulated card, in turns: read and write time of a cycle.

Needs root (network namespaces), Debian's linuxcnc-uspace, and a source tree: LinuxCNC is run as the tests do.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from hostmot2.bench.report import Goal, Report
from hostmot2.histogram import Histogram

ROUNDS = 2
SAMPLES = 300
CYCLES = 3000
INTEROP = Path(__file__).parents[2] / "tests" / "interop"
PROGRAMS = ("halrun", "rtapi_app", "ip", "nsenter", "unshare", "setpriv", "chrt")
THEIRS, OURS = "LinuxCNC's hm2_eth, read and write", "our engine, request to write"
NOTE = (
    "a 7I92 with a 7I77 at 1 kHz, both at SCHED_FIFO 40 below the card's 45; all pins, encoders "
    "and smart serial take part in both; LinuxCNC: read.time + write.time, sampled; ours: every cycle"
)

# in the host's namespace, as a program of a user's would be
OUR_LOOP = """
import json, sys, time, hostmot2
with hostmot2.open(sys.argv[1]) as board:
    if board.watchdog.has_bitten:
        board.watchdog.acknowledge()
    board.watchdog.timeout = 1.0
    board.ioport
    board.card("7i77").start()
    cycles = int(sys.argv[2])
    engine = board.engine(1000, style="pipelined", dead_man=0, real_time=40, cpu=int(sys.argv[3]))
    ring = engine.record(slots=1 << (cycles + 500).bit_length())
    with engine:
        time.sleep((cycles + 300) / 1000)
        state = engine.status
    stages = ring.pop(cycles + 300)[300:]["stage_ns"].astype(int)
    took = stages[:, 6] - stages[:, 0]
    print(json.dumps({"ns": took.tolist(), "failures": state.failures}))
"""


def run(count: int | None = None) -> Report:
    """Rounds of both: `count`, or 2. Says what is missing where it cannot be run."""
    report = Report("peer")
    reason = missing()
    if reason:
        report.left_out.append(f"LinuxCNC's hm2_eth beside ours: {reason}")
        return report
    theirs, ours = _rounds(count or ROUNDS)
    found = {THEIRS: theirs, OURS: ours}
    report.histograms |= {
        name: Histogram([ns for each in rounds for ns in each]) for name, rounds in found.items()
    }
    ratio = median(median(a) / median(b) for a, b in zip(ours, theirs, strict=True))
    text = "our read and write time of a cycle, times that of LinuxCNC's hm2_eth"
    report.goals.append(Goal(text, ratio, 1.0, at_least=False))
    report.notes.append(NOTE)
    return report


def missing() -> str:
    """What keeps LinuxCNC from running here; nothing if it can."""
    if os.geteuid() != 0:
        return "it needs root"
    if not (INTEROP / "machine.py").exists():
        return "it needs a source tree of this package"
    absent = [name for name in PROGRAMS if shutil.which(name) is None]
    return f"not installed: {', '.join(absent)}; make interop installs them" if absent else ""


def _rounds(rounds: int) -> tuple[list[list[int]], list[list[int]]]:
    sys.path.insert(0, str(INTEROP))
    machine, linuxcnc = import_module("machine"), import_module("test_linuxcnc")
    theirs, ours = [], []
    with (
        tempfile.TemporaryDirectory() as name,
        machine.Network() as network,
        machine.ServedCard(network, Path(name)),
    ):
        for number in range(rounds):
            directory = Path(name) / str(number)
            directory.mkdir()
            with machine.Hal(network, directory) as hal:
                linuxcnc.start(hal, watchdog_ms=100)
                theirs.append(_their_times(hal.pins, linuxcnc.CARD))
            _open_again(network)
            ours.append(_our_times(network, machine.CARD_IP))
    return theirs, ours


def _their_times(pins: Callable[[str], dict[str, float]], card: str) -> list[int]:
    """ns; HAL counts in cycles of the processor's clock."""
    ghz = clock_ghz()
    samples = [pins(card) for _ in range(SAMPLES)]
    return [round((each[f"{card}.read.time"] + each[f"{card}.write.time"]) / ghz) for each in samples]


def clock_ghz() -> float:
    """Of the time-stamp counter, as the kernel states it."""
    found = re.search(r"^cpu MHz\s*: ([\d.]+)", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    if not found:
        raise RuntimeError("the kernel does not tell the processor's clock")
    return float(found[1]) / 1000


def _open_again(network: Any) -> None:
    """LinuxCNC leaves rules that reject everybody else's datagrams."""
    flush = network.in_host("iptables", "-F", "hm2-eth-rules-output")
    subprocess.run(flush, capture_output=True, check=False)


def _our_times(network: Any, address: str) -> list[int]:
    command = [sys.executable, "-c", OUR_LOOP, f"udp://{address}", str(CYCLES), "-1"]
    done = subprocess.run(network.in_host(*command), capture_output=True, text=True, timeout=120, check=False)
    if done.returncode:
        raise RuntimeError(f"our loop failed: {done.stderr[-500:]}")
    found = json.loads(done.stdout)
    return [int(ns) for ns in np.asarray(found["ns"])]
