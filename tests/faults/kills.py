"""python -m tests.faults.kills [--count 200] [--seed N] [-o FILE]

A motor runs on an emulated Ethernet card in this process; another process drives and records it and is killed
with SIGKILL at a random moment. By the card's own clock the motor is without torque within the watchdog's
time after that, every time, and what was recorded can be read.
"""

from __future__ import annotations

import json
import multiprocessing
import random
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

TESTS = str(Path(__file__).resolve().parent.parent)
if TESTS not in sys.path:
    sys.path.insert(0, TESTS)

import hostmot2  # noqa: E402
from faults import command  # noqa: E402
from hostmot2 import recording  # noqa: E402
from hostmot2.emulator import EmulatedBoard  # noqa: E402
from hostmot2.emulator.ethernet import EthernetServer  # noqa: E402
from hostmot2.emulator.plant import couple_dc_motor  # noqa: E402

WATCHDOG_US = 50_000.0
MARGIN_US = 200.0
"""Plus what it takes the card to look: a few of its clocks, and the turn of the motor's model."""
LONGEST_S = 1.6
PATIENCE_S = 60.0
TRIES = 10
SERVER_PRIORITY = 50


def drive(url: str, path: str, moving: Any) -> None:
    """What is killed: a program that moves the motor and records it."""
    with hostmot2.open(url) as board:
        board.sserial.start(0x03).raise_for_failed()  # the engine arms the watchdog
        engine = board.engine(1000.0, stale_limit=0, fault_bucket=(0, 0, 0), real_time=True, early=0.0)
        with recording.record(engine, path), engine:
            engine.outputs["analogout0"] = 4.0
            engine.outputs["analogena"] = 1.0
            engine.enable()
            moving.set()
            while True:
                engine.write()
                time.sleep(0.005)


@dataclass
class Kills:
    """What came of them. Times by the card's clock."""

    count: int = 0
    turning: int = 0
    """Had torque when they were killed; the others were killed earlier, or their own watchdog had bitten."""
    stopped: int = 0
    """Without torque within the watchdog's time."""
    readable: int = 0
    cycles: int = 0
    """In all recordings."""
    latest_us: float = 0.0
    """The longest time after a kill at which torque was still seen."""

    def wrong(self) -> list[str]:
        """What must not be."""
        found = []
        if self.stopped != self.count:
            found.append(f"{self.count - self.stopped} motors went on")
        if self.readable != self.count:
            found.append(f"{self.count - self.readable} recordings cannot be read")
        if self.turning < self.count / 2:
            found.append(f"only {self.turning} of {self.count} were turning")
        return found


class Bench:
    """The card, its motor, and the server that drivers reach it by."""

    def __init__(self) -> None:
        self.board = EmulatedBoard("7i92+7i77", clock="real")
        self.motor = couple_dc_motor(self.board)
        self.server = EthernetServer(self.board, port=0, spin_us=0, fifo_priority=SERVER_PRIORITY)

    def look(self) -> tuple[float, float]:
        """The card's time, and the motor's torque then."""
        with self.server.card.hold():
            self.board.sync()
            return self.board.now_us, self.motor.torque


def kill_once(bench: Bench, start: Any, folder: Path, moment_s: float, kills: Kills) -> None:
    """One program, from its beginning to what it leaves behind."""
    path = folder / f"{kills.count}.mcap"
    process = _begin(bench, start, path)
    _wait(bench, moment_s)
    process.kill()
    process.join(PATIENCE_S)
    killed_us, torque = bench.look()
    kills.count += 1
    kills.turning += torque != 0.0
    kills.stopped += _stops(bench, killed_us, kills)
    run = recording.read(path)
    kills.readable += 1
    kills.cycles += len(run.records)
    path.unlink()


def _begin(bench: Bench, start: Any, path: Path) -> Any:
    """A program that moves the motor. On a busy machine one may stall so long at first that it gives up."""
    for _ in range(TRIES):
        moving = start.Event()
        process = start.Process(target=drive, args=(bench.server.url, str(path), moving))
        process.start()
        while not moving.is_set() and process.is_alive():
            _wait(bench, 0.02)
        if moving.is_set():
            return process
        process.join(PATIENCE_S)
    raise RuntimeError("no driver begins to move")


def _wait(bench: Bench, seconds: float) -> None:
    """A card that nobody looks at for long has much to catch up with at the next look."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        bench.look()
        time.sleep(min(0.02, seconds))


def _stops(bench: Bench, killed_us: float, kills: Kills) -> bool:
    while True:
        now_us, torque = bench.look()
        if torque:
            kills.latest_us = max(kills.latest_us, now_us - killed_us)
        if now_us - killed_us > WATCHDOG_US + MARGIN_US:
            return torque == 0.0
        time.sleep(0.001)


def kill(count: int, seed: int) -> Kills:
    """So many programs, one after the other."""
    draw = random.Random(seed)
    kills = Kills()
    start = multiprocessing.get_context("forkserver")
    start.set_forkserver_preload(["faults.kills", "hostmot2.recording", "hostmot2.engine", "hostmot2.cards"])
    bench = Bench()
    with tempfile.TemporaryDirectory() as folder, bench.server:
        for _ in range(count):
            kill_once(bench, start, Path(folder), draw.random() * LONGEST_S, kills)
    return kills


def main() -> int:
    """Runs them and prints what came of it."""
    arguments = command.draws(__doc__, 200).parse_args()
    kills = kill(arguments.count, arguments.seed)
    print(kills, flush=True)
    if arguments.output:
        arguments.output.write_text(json.dumps(asdict(kills)))
    print("\n".join(kills.wrong()) or "all stopped in time, all recordings read")
    return 1 if kills.wrong() else 0


if __name__ == "__main__":
    from faults.kills import main as run  # under its importable name, for the processes that are started

    sys.exit(run())
