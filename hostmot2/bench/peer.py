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
import time
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import Any

from hostmot2.bench.report import Goal, Report
from hostmot2.histogram import Histogram

ROUNDS = 2
CYCLES = 3000
SETTLE_SECONDS = 0.3
INTEROP = Path(__file__).parents[2] / "tests" / "interop"
PROGRAMS = ("halrun", "rtapi_app", "ip", "nsenter", "unshare", "setpriv", "chrt")
THEIRS, OURS = "LinuxCNC's hm2_eth, read and write", "our engine, request to write"
NOTE = (
    "a 7I92 with a 7I77 at 1 kHz, both at SCHED_FIFO 40 below the card's 45; pins, encoders and smart "
    "serial take part in both; LinuxCNC: read.time + write.time, by its sampler; every good cycle of both"
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
    records = ring.pop(cycles + 300)[300:]
    stages = records[records["status"] == 0]["stage_ns"].astype(int)
    took = stages[:, 6] - stages[:, 0]
    print(json.dumps({"ns": took.tolist(), "failures": len(records) - len(stages)}))
"""


def run(count: int | None = None) -> Report:
    """Rounds of both: `count`, or 2. Says what is missing where it cannot be run."""
    report = Report("peer")
    reason = missing()
    if reason:
        report.left_out.append(f"LinuxCNC's hm2_eth beside ours: {reason}")
        return report
    theirs, ours, failed = _rounds(count or ROUNDS)
    found = {THEIRS: theirs, OURS: ours}
    report.histograms |= {
        name: Histogram([ns for each in rounds for ns in each]) for name, rounds in found.items()
    }
    ratio = median(median(a) / median(b) for a, b in zip(ours, theirs, strict=True))
    text = "our read and write time of a cycle, times that of LinuxCNC's hm2_eth"
    report.goals.append(Goal(text, ratio, 1.0, at_least=False))
    report.notes += [NOTE, f"exchanges failed: {failed[0]} of LinuxCNC's, {failed[1]} of ours"]
    return report


def missing() -> str:
    """What keeps LinuxCNC from running here; nothing if it can."""
    if os.geteuid() != 0:
        return "it needs root"
    if not (INTEROP / "machine.py").exists():
        return "it needs a source tree of this package"
    absent = [name for name in PROGRAMS if shutil.which(name) is None]
    return f"not installed: {', '.join(absent)}; make interop installs them" if absent else ""


def _rounds(rounds: int) -> tuple[list[list[int]], list[list[int]], list[int]]:
    """ns of each cycle, theirs and ours, and how many exchanges of either failed."""
    sys.path.insert(0, str(INTEROP))
    machine, linuxcnc = import_module("machine"), import_module("test_linuxcnc")
    theirs, ours, failed = [], [], [0, 0]
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
                theirs.append(_their_times(hal, linuxcnc.CARD, directory / "samples"))
                failed[0] += round(linuxcnc.faults(hal)["packet-error-total"])
            _open_again(network)
            found = _our_loop(network, machine.CARD_IP, machine.HOST_CPU)
            ours.append(found["ns"])
            failed[1] += found["failures"]
    return theirs, ours, failed


def _their_times(hal: Any, card: str, path: Path) -> list[int]:
    """ns; HAL counts in cycles of the processor's clock. Its own sampler takes them, in its own thread.

    Not those in which it does nothing: after some lost replies in a row it stops, here later than it would.
    """
    hal.halcmd(f"setp {card}.packet-error-limit {CYCLES}", f"setp {card}.io_error 0")
    time.sleep(SETTLE_SECONDS)
    hal.set_pins({f"{card}.watchdog.has_bit": 0})
    hal.halcmd(f"loadrt sampler depth={CYCLES} cfg=SSb")
    pins = ("read.time", "write.time", "packet-error-exceeded")
    nets = [f"net took{n} {card}.{pin} => sampler.0.pin.{n}" for n, pin in enumerate(pins)]
    hal.halcmd(*nets, "addf sampler.0 servo")
    with path.open("w") as output:
        hal._inside_run("halsampler", "-n", str(CYCLES), output=output)
    ghz = clock_ghz()
    samples = re.findall(r"^(\d+) (\d+) 0 *$", path.read_text(), re.MULTILINE)
    if len(samples) < CYCLES / 2:
        raise RuntimeError(f"LinuxCNC stopped, {len(samples)} of {CYCLES} cycles did something: stalls?")
    return [round((int(read) + int(write)) / ghz) for read, write in samples]


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


def _our_loop(network: Any, address: str, cpu: int) -> dict[str, Any]:
    command = [sys.executable, "-c", OUR_LOOP, f"udp://{address}?error_limit=0", str(CYCLES), str(cpu)]
    done = subprocess.run(network.in_host(*command), capture_output=True, text=True, timeout=120, check=False)
    if done.returncode:
        raise RuntimeError(f"our loop failed: {done.stderr[-500:]}")
    return dict(json.loads(done.stdout))
