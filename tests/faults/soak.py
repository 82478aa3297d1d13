"""python -m tests.faults.soak [--seconds 600] [--rate 4000] [--loss 0.1%] [-o FILE]

A 7I92 with a 7I77, driven by the cycle engine over UDP, with datagrams lost in both directions: memory stays
what it was, and every datagram is accounted for.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

TESTS = str(Path(__file__).resolve().parent.parent)
if TESTS not in sys.path:
    sys.path.insert(0, TESTS)

import hostmot2  # noqa: E402
from faults import checks, command  # noqa: E402
from hostmot2.emulator import EmulatedBoard  # noqa: E402
from hostmot2.emulator.ethernet import EthernetServer  # noqa: E402

SERVER_PRIORITY = 50
SETTLE_S = 2.0
"""What is allocated once has been allocated."""


@dataclass
class Soak:
    """What a run counted, all between the engine's start and its stop."""

    seconds: float
    rate: float
    loss: str
    cycles: int = 0
    sent: int = 0
    answered: int = 0
    late: int = 0
    """Answers that came when they had been given up."""
    missed: int = 0
    """Given up by the driver."""
    lost: int = 0
    """Thrown away by the emulator, requests and answers."""
    overruns: int = 0
    resident_kib: list[int] = field(default_factory=list)
    allocated_bytes: list[int] = field(default_factory=list)

    def wrong(self) -> list[str]:
        """What does not add up."""
        found = []
        if self.sent != self.answered + self.missed:
            found.append(f"sent {self.sent}, answered {self.answered} + missed {self.missed}")
        if self.missed != self.lost + self.late:
            found.append(f"missed {self.missed}, lost {self.lost} + late {self.late}")
        if self.resident_kib[-1] - self.resident_kib[0] > 512:
            found.append(f"resident memory grew: {self.resident_kib[0]} to {self.resident_kib[-1]} KiB")
        if self.allocated_bytes[-1] - self.allocated_bytes[0] > 65_536:
            found.append(f"allocations grew: {self.allocated_bytes[0]} to {self.allocated_bytes[-1]} bytes")
        return found

    def __str__(self) -> str:
        return (
            f"{self.seconds:g} s at {self.rate:g} Hz, loss {self.loss}: {self.cycles} cycles, sent "
            f"{self.sent} = "
            f"answered {self.answered} + missed {self.missed}; missed = lost by the emulator {self.lost} + "
            f"late "
            f"{self.late}; {self.overruns} overruns; resident {self.resident_kib[0]} to "
            f"{self.resident_kib[-1]} KiB, allocated {self.allocated_bytes[0]} to "
            f"{self.allocated_bytes[-1]} bytes"
        )


def soak(seconds: float, rate: float, loss: str, every: float = 5.0, real_time: bool = False) -> Soak:
    """Run it."""
    result = Soak(seconds, rate, loss)
    emulated = EmulatedBoard("7i92+7i77", clock="real")
    priority = SERVER_PRIORITY if real_time else 0
    server = EthernetServer(emulated, port=0, spin_us=0, fifo_priority=priority)
    with server, hostmot2.open(f"{server.url}?error_limit=0&spin_us=0") as board:
        board.watchdog.timeout = 5.0  # a machine that stalls is not what is asked about
        board.card("7i77").start()
        link = board._transport.keep[0]
        before, lost_before = link.counters, server.counters.lost
        # nobody spins: ten minutes on a machine of two processors that others use, too
        options = {"dead_man": 0.0, "stale_limit": 0, "fault_bucket": (0, 0, 0), "early": 0.0}
        with board.engine(rate, real_time=real_time, **options) as engine:
            server.set_fault(f"loss={loss},seed=7")
            _watch(engine, result, every)
            server.set_fault("")
            status = engine.status
        time.sleep(0.2)
        board.read(0x100)  # takes what came late out of the socket
        now = link.counters
        result.cycles, result.overruns = status.cycles, status.overruns
        result.sent = now.requests - before.requests
        result.answered = now.replies - before.replies
        result.late = now.discarded - before.discarded
        result.missed = now.missed - before.missed + now.retries - before.retries
        result.lost = server.counters.lost - lost_before
    return result


def _watch(engine: Any, result: Soak, every: float) -> None:
    """Commands now and then, and what memory is held."""
    end = time.monotonic() + result.seconds
    settled = time.monotonic() + SETTLE_S
    turn = 0
    while time.monotonic() < end:
        if time.monotonic() >= settled:
            result.resident_kib.append(_resident_kib())
            result.allocated_bytes.append(checks.in_use())
        until = min(end, time.monotonic() + every)
        while time.monotonic() < until:
            turn += 1
            engine.outputs["analogout0"] = (turn % 100) / 20
            engine.write()
            engine.read()
            engine.events()
            time.sleep(0.02)


def _resident_kib() -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1])
    raise RuntimeError("no VmRSS")


def main() -> int:
    """Runs it and prints what was counted."""
    parser = command.parser(__doc__)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--rate", type=float, default=4000.0)
    parser.add_argument("--loss", default="0.1%")
    parser.add_argument("--real-time", action="store_true", help="the engine at SCHED_FIFO")
    arguments = parser.parse_args()
    result = soak(arguments.seconds, arguments.rate, arguments.loss, real_time=arguments.real_time)
    print(result)
    if arguments.output:
        arguments.output.write_text(json.dumps(asdict(result)))
    wrong = result.wrong()
    print("\n".join(wrong) or "everything adds up")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
