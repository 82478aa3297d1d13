"""python -m tests.faults.endings [--count 2500] [--seconds S] [--seed N] [-o FILE]

Processes that drive a card in real time, with the engine's thread, end at random moments: by SIGTERM, SIGHUP,
Ctrl-C, or sys.exit(); others fork there, and the child ends. Behind the end of a process nothing is driven;
behind the end of a child everything is as it was.

The card is a file that both processes map, so that its registers are seen when the process is gone.
"""

from __future__ import annotations

import fcntl
import os
import random
import select
import signal
import struct
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
if str(TESTS) not in sys.path:
    sys.path.insert(0, str(TESTS))

import hostmot2  # noqa: E402
import hostmot2.cycle  # noqa: E402
import hostmot2.engine  # noqa: E402
from faults import command  # noqa: E402

WAYS = ("SIGTERM", "SIGHUP", "Ctrl-C", "sys.exit()", "fork")
SIGNALS = {"SIGTERM": signal.SIGTERM, "SIGHUP": signal.SIGHUP, "Ctrl-C": signal.SIGINT}
EXPECTED = {
    "SIGTERM": {0, 128 + signal.SIGTERM, -signal.SIGTERM},
    "SIGHUP": {0, 128 + signal.SIGHUP, -signal.SIGHUP},
    "Ctrl-C": {0, -signal.SIGINT},
    "sys.exit()": {0, 3},
    "fork": {0},
}
"""How a process may end; 0: it was too late, negative: it was too early for a handler."""
PHASES = ("opening", "driving", "exchanging", "engine", "closing")
DDR, PORTS = 0x1100, 2
ENGINE_S = 0.03
HANGS_S = 60.0
OFF_IN_MIDST, CHILD_FAILED = 9, 8
CHILD_MAY = {0, 1}
"""1: TransportClosed, where the way out led through code that wanted the card, such as close() itself."""


@dataclass
class Endings:
    """What came of them."""

    count: int = 0
    ended: Counter[str] = field(default_factory=Counter)
    """By way, those that it ended; in the others it came too late."""
    places: Counter[str] = field(default_factory=Counter)
    """What was being done."""
    wrong: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return f"{self.count} processes, {dict(self.ended)}, {dict(self.places)}, {len(self.wrong)} wrong"


# ---- the process that ends ---------------------------------------------------------------------------


def program(path: str, reached: Callable[[str], None]) -> None:
    """What ends: a program that drives pins, exchanges, and runs an engine in real time."""
    reached("opening")
    with hostmot2.open(f"pci://{path}") as board:
        reached("driving")
        for pin in board.gpio.free[:4]:
            pin.drive(True)
        reached("exchanging")
        for _ in range(20):
            board.cycle.run()
        reached("engine")
        with board.engine(1000.0) as engine:
            end = time.monotonic() + ENGINE_S
            while time.monotonic() < end:
                engine.write()
                time.sleep(0.002)
        reached("closing")
        if not any(board.read(DDR + 4 * port) for port in range(PORTS)):
            os._exit(OFF_IN_MIDST)


def process(path: str, way: str, phase: str, delay_s: float, tell: int) -> int:
    """In the child: the program as a script of its own would run it. Returns to the interpreter's end."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGTERM, signal.SIGHUP):  # whatever nohup or a service has made of them
        signal.signal(number, signal.SIG_DFL)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # tracebacks of those who are interrupted
    children: list[int] = []

    def on_alarm(_number: int, _frame: object) -> None:
        if way == "sys.exit()":
            sys.exit(3)
        child = os.fork()
        if child == 0:
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(30)  # ends one that waits for ever
            sys.exit(0)
        children.append(child)

    def reached(begins: str) -> None:
        os.write(tell, bytes([PHASES.index(begins)]))
        if begins == phase and way not in SIGNALS:
            signal.signal(signal.SIGALRM, on_alarm)
            signal.setitimer(signal.ITIMER_REAL, max(1e-6, delay_s))

    program(path, reached)
    signal.setitimer(signal.ITIMER_REAL, 0)
    ended = {os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children}
    return CHILD_FAILED if ended - CHILD_MAY else 0


# ---- who watches it ----------------------------------------------------------------------------------


class Bench:
    """The card's file, and the processes."""

    def __init__(self, folder: Path) -> None:
        image = bytearray(0x10000)
        golden = TESTS / "golden/card/idrom_5i25_7i77x2.hex"
        for address, word in map(str.split, golden.read_text().splitlines()):
            struct.pack_into("<I", image, int(address, 16), int(word, 16))
        self.path = folder / "card.bin"
        self.path.write_bytes(image)

    def driven(self) -> tuple[int, ...]:
        """The direction registers."""
        with self.path.open("rb") as file:
            file.seek(DDR)
            return struct.unpack(f"<{PORTS}I", file.read(4 * PORTS))

    def locked(self) -> bool:
        """Whether somebody still has the card."""
        with self.path.open("rb+") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
            return False


def watch(child: int, heard: int, way: str, phase: str, delay_s: float) -> tuple[int | None, str]:
    """Sends the signal when it is time. The exit status (None: it hangs), and what was reached."""
    end, doing, sent = time.monotonic() + HANGS_S, "", way not in SIGNALS
    while time.monotonic() < end:
        if select.select([heard], [], [], 0.002)[0]:
            told = os.read(heard, 16)
            doing = PHASES[told[-1]] if told else doing
        if not sent and doing and PHASES.index(doing) >= PHASES.index(phase):
            time.sleep(delay_s)
            os.kill(child, SIGNALS[way])
            sent = True
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status), doing
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None, doing


def judge(bench: Bench, way: str, status: int | None, doing: str, result: Endings) -> None:
    """What must be so when the process is gone."""
    what = f"{way} while {doing}"
    result.count += 1
    result.places[doing] += 1
    result.ended[way] += status != 0 or way == "fork"
    if status is None:
        result.wrong.append(f"{what}: hangs")
    elif status not in EXPECTED[way]:
        result.wrong.append(f"{what}: ended with {status}")
    if any(bench.driven()):
        result.wrong.append(f"{what}: pins are driven: {bench.driven()}")
    if bench.locked():
        result.wrong.append(f"{what}: the card is still locked")


def end_all(count: int, seed: int, seconds: float, folder: Path) -> Endings | int:
    """So many processes, or as many as fit into the time. An exit status: this is one of them."""
    end = time.monotonic() + seconds
    draw, result, bench = random.Random(seed), Endings(), Bench(folder)
    while time.monotonic() < end and result.count < count and len(result.wrong) < 50:
        way, phase = draw.choice(WAYS), draw.choice(PHASES)
        delay_s = draw.random() * (ENGINE_S if phase == "engine" else 0.01)
        heard, tell = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(heard)
            return process(str(bench.path), way, phase, delay_s, tell)
        os.close(tell)
        judge(bench, way, *watch(child, heard, way, phase, delay_s), result)
        os.close(heard)
    return result


def main() -> int:
    """Runs them and prints what came of it."""
    arguments = command.draws(__doc__, 2500, timed=True).parse_args()
    folder = tempfile.mkdtemp(
        prefix="hm2-endings-"
    )  # not a context manager: children leave through here, too
    result = end_all(arguments.count, arguments.seed, arguments.seconds, Path(folder))
    return result if isinstance(result, int) else command.tell(result, arguments.output)


if __name__ == "__main__":
    sys.exit(main())
