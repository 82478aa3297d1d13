"""A run of LinuxCNC looked at cycle by cycle, and the machine under it by an independent witness.

LinuxCNC answers to the clock: when the machine stops one of its threads, or the card's, for longer than a
reply may take, it reports an error, and is right. Each error is therefore held against what a witness saw
that knows nothing of either: it must coincide with a stall of the machine, or the card is to blame.
"""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import TracebackType

import numpy as np
import numpy.typing as npt
from machine import Hal, HalError, ServedCard, run

SOURCE = Path(__file__).with_name("witness.c")
PROBLEMS = ("packet-error-total", "sserial.port-0.fault-count", "watchdog.has_bit", "packet-error-exceeded")
BITTEN, EXCEEDED = PROBLEMS.index("watchdog.has_bit"), PROBLEMS.index("packet-error-exceeded")
ENCODERS = 6
PERIOD = 0.001
"""Seconds, of LinuxCNC's thread."""
PORT_STOPS = 200
"""Failed smart serial cycles, weighted, after which LinuxCNC stops a port."""
PORT_STARTS = 3.0
"""Seconds: LinuxCNC waits for 2.1 s for a command's end before it starts a port anew."""
WATCHDOG = 0.025
"""Seconds: above the stalls of a shared machine. Behind a bite the encoders' multiplexer has no select, and
counts are lost."""
BITE = WATCHDOG - 0.005
"""Seconds: no shorter stall lets it bite."""
LOST_UNTIL_STOPPED = 5
"""Replies in a row: packet-error-limit over packet-error-increment, as hm2_eth has them (interop.md)."""
LEAST = 0.00025
"""Seconds of stalls about an error that explain it: LinuxCNC waits 0.8 ms for a reply that takes 0.1 to 0.2.
Short ones add up."""
FIRST_DOIT_MISSED = "sserial.port-0.fault-count 0 -> 9"
"""One failed cycle, +10 and -1: of a port that LinuxCNC was told to start anew."""
RESTARTING = LOST_UNTIL_STOPPED + 1
"""Cycles: told to go on, LinuxCNC writes everything anew, misses replies meanwhile, and finds that the card's
watchdog has bitten and cut off the remotes. Whether all of it comes back the plant's rounds tell."""
NOTICED = 100
"""Cycles: a bite while LinuxCNC was stopped is known by the first reply that is not missed again."""
SEEN = PORT_STARTS + 0.5
"""Seconds: what a stopped port brings about is seen within that time."""
BEFORE, AFTER = 0.003, 0.001
"""Seconds: an error is reported up to so long after its stall began to matter, and known to so much."""


@dataclass(frozen=True)
class Stall:
    """Seconds of CLOCK_MONOTONIC."""

    start: float
    end: float

    @property
    def seconds(self) -> float:
        return self.end - self.start


class Witness:
    """Compiled and started on every processor; `stalls` when the block is over."""

    def __init__(self, directory: Path) -> None:
        self._program = directory / "witness"
        self.stalls: list[Stall] = []
        self.per_second = 0.0
        """Stalls that each explain an error by themselves."""

    def __enter__(self) -> Witness:
        run("cc", "-O2", "-D_GNU_SOURCE", "-o", str(self._program), str(SOURCE))
        self._processes = [
            subprocess.Popen([str(self._program), str(cpu)], stdout=subprocess.PIPE, text=True)
            for cpu in sorted(os.sched_getaffinity(0))
        ]
        for process in self._processes:
            assert process.stdout
            assert process.stdout.readline() == "ready\n", "the witness needs SCHED_FIFO"
        self._since = time.monotonic()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        seconds = time.monotonic() - self._since
        for process in self._processes:
            process.send_signal(signal.SIGTERM)
            out, _ = process.communicate(timeout=20)
            rows = [line.split() for line in out.splitlines()]
            self.stalls += [Stall(int(start) / 1e9, int(end) / 1e9) for start, end in rows]
        self.stalls.sort(key=lambda stall: stall.start)
        self.per_second = sum(stall.seconds >= LEAST for stall in self.stalls) / seconds


@dataclass(frozen=True)
class Cycle:
    """One cycle of LinuxCNC's thread."""

    seconds: float
    """Since the first one."""
    problems: tuple[int, ...]
    counts: tuple[int, ...]

    @property
    def stopped(self) -> bool:
        """By LinuxCNC or by the card: until its user has cleared it there is no select for the encoders."""
        return bool(self.problems[BITTEN] or self.problems[EXCEEDED])


class Recorder:
    """LinuxCNC's own sampler in the thread: what it reported and read in each cycle."""

    def __init__(self, hal: Hal, card: str, served: ServedCard, directory: Path) -> None:
        self._hal, self._card, self._served = hal, card, served
        self._path = directory / "samples"
        self._moments: list[tuple[float, int, float]] = []
        self.recoveries: list[float] = []
        """When LinuxCNC was told to go on, on the witness's clock."""
        self.remote_faults: list[float] = []
        """When the remotes' own watchdog was seen to have bitten, on the same clock."""
        self._stopping = threading.Event()
        self._watcher = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Recorder:
        self.load()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end_watching()
        self._process.terminate()
        self._process.wait()

    def load(self) -> None:
        """Before the thread starts."""
        kinds = "s" + "uubb" + "s" * ENCODERS
        self._hal.halcmd("loadrt timedelta")
        self._hal.halcmd(f"loadrt sampler depth=8000 cfg={kinds}")
        sources = [
            "timedelta.0.out",
            *(f"{self._card}.{name}" for name in PROBLEMS),
            *(f"{self._card}.encoder.0{n}.rawcounts" for n in range(ENCODERS)),
        ]
        for number, source in enumerate(sources):
            self._hal.halcmd(f"net sample{number} {source} sampler.0.pin.{number}")
        self._hal.halcmd("addf timedelta.0 servo", "addf sampler.0 servo")
        self._process = self._hal.spawn("halsampler", "-t", output=self._path)
        self._watcher.start()
        self._requests, self._replies = (round(self._served.get(key)) for key in ("requests", "replies"))

    def look(self) -> None:
        """How many cycles the card has answered by now: ties LinuxCNC's time to the witness's."""
        before = time.monotonic()
        answered = round(self._served.get("replies")) - self._replies
        self._moments.append((before, answered, time.monotonic()))

    def _watch(self) -> None:
        """Until the recorder stops: after an error that stops things, do what the manuals tell the user.

        hm2_eth(9), hostmot2(9), sserial(9). At once, so that no 16-bit counter turns over unseen. Remotes
        that got no DOIT for 50 ms keep their outputs off until their port is started anew (sserial.md 11),
        and LinuxCNC goes on without a word on any pin: the card is asked.
        """
        bitten = BITTEN + 1
        while not self._stopping.wait(0.1):
            try:
                self._recover_if_stopped(f"{self._card}.sserial.port-0", bitten)
            except (HalError, KeyError):
                return  # LinuxCNC has gone: whoever ended it knows why

    def _end_watching(self) -> None:
        self._stopping.set()
        self._watcher.join()

    def _recover_if_stopped(self, port: str, bitten: int) -> None:
        pins = self._hal.pins(self._card)
        stopped = pins[f"{self._card}.io_error"] or pins[f"{self._card}.watchdog.has_bit"]
        starting = self.recoveries and time.monotonic() < self.recoveries[-1] + PORT_STARTS
        faulted = not starting and self._served.get("fault") != 0
        if not stopped and not faulted and pins[f"{port}.fault-count"] < PORT_STOPS:
            return
        if faulted:
            self.remote_faults.append(time.monotonic())
        self._hal.halcmd(f"setp {self._card}.io_error 0", f"sets sample{bitten} 0", f"setp {port}.run 0")
        time.sleep(0.05)
        self.recoveries.append(time.monotonic())
        self._hal.halcmd(f"setp {port}.run 1")

    def stop(self) -> tuple[int, int]:
        """The thread has been stopped. Datagrams the card got and sent meanwhile."""
        self._end_watching()
        time.sleep(0.5)  # until the sampler has written the last ones
        requests, replies = (round(self._served.get(key)) for key in ("requests", "replies"))
        return requests - self._requests, replies - self._replies

    def cycles(self) -> list[Cycle]:
        """All of them, none missing."""
        found, elapsed = [], 0.0
        for number, line in enumerate(self._path.read_text().splitlines()):
            words = [int(float(word)) for word in line.split()]
            assert words[0] == number, f"the sampler lost cycles before {words[0]}"
            elapsed += words[1] / 1e9 if number else 0.0
            found.append(Cycle(elapsed, tuple(words[2:6]), tuple(words[6:])))
        return found

    def start_time(self, cycles: list[Cycle]) -> float:
        """Of cycle 0, on the witness's clock. A look saw n cycles answered: the last was, the next not.

        By the looks among cycles that came and were answered in time, before LinuxCNC first stopped: when
        it is stopped there are cycles that ask for nothing.
        """
        asking = next((n for n, cycle in enumerate(cycles) if cycle.stopped), len(cycles))
        moments = [moment for moment in self._moments if _calm(cycles[:asking], moment[1])]
        assert moments, "the machine stalls too much to tell what happened when"
        latest = min(after - cycles[n - 1].seconds for _, n, after in moments)
        earliest = max(before - cycles[n].seconds for before, n, _ in moments)
        assert latest - earliest > -0.001, "the card did not answer once a cycle"
        return (earliest + latest) / 2


def _calm(cycles: list[Cycle], number: int) -> bool:
    """Whether the cycles about this one took their millisecond each and brought no error."""
    about = cycles[max(0, number - 3) : number + 3]
    return len(about) == 6 and all(
        abs(cycle.seconds - before.seconds - PERIOD) < PERIOD / 5 and not _rises(before, cycle)
        for before, cycle in pairwise(about)
    )


@dataclass(frozen=True)
class Verdict:
    """Errors by whether the machine explains them."""

    cycles: int
    explained_cycles: int
    """Cycles with an error that a stall explains."""
    unexplained: tuple[str, ...]
    excusable: float
    """The part of the cycles in which stalls would explain an error. The larger, the less is shown."""
    longest_ms: float


def judge(
    cycles: list[Cycle],
    start: float,
    stalls: list[Stall],
    recoveries: Sequence[float] = (),
    remote_faults: Sequence[float] = (),
) -> Verdict:
    """Each rise of a number by which LinuxCNC says that something went wrong, each fault of the remotes."""
    at = start + np.array([cycle.seconds for cycle in cycles])
    # no card can make a cycle so long: LinuxCNC waits 0.8 ms for it
    stalls = stalls + [Stall(float(at[n - 1]), float(at[n])) for n in held_up(cycles)]
    lost = _seconds_lost(at, stalls)
    bites = _seconds_lost(at, [stall for stall in stalls if stall.seconds >= BITE])
    explained, unexplained = 0, []
    for number in range(1, len(cycles)):
        before, cycle = cycles[number - 1 : number + 1]
        wrong = _rises(before, cycle)
        bitten = cycle.problems[BITTEN] > before.problems[BITTEN]
        lately = cycles[max(0, number - (NOTICED if bitten else RESTARTING)) : number]
        if not wrong or any(earlier.stopped for earlier in lately):
            continue
        if wrong == [FIRST_DOIT_MISSED] and any(0 < at[number] - told < SEEN for told in recoveries):
            continue
        if bites[number] >= BITE if bitten else lost[number] >= LEAST:
            explained += 1
        else:
            unexplained.append(f"{', '.join(wrong)} at {cycle.seconds:.3f} s")
    silent = [stall for stall in stalls if stall.seconds >= BITE]
    silent += [Stall(float(at[n - 1]), float(at[n])) for n in range(1, len(cycles)) if cycles[n].stopped]
    for seen in remote_faults:
        if not any(stall.start < seen < stall.end + SEEN for stall in silent):
            unexplained.append(f"fault of the remotes at {seen - start:.3f} s")
    longest = max((stall.seconds for stall in stalls), default=0.0)
    excusable = float(np.mean(lost >= LEAST))
    return Verdict(len(cycles), explained, tuple(unexplained), round(excusable, 3), round(longest * 1e3, 2))


def _rises(before: Cycle, cycle: Cycle) -> list[str]:
    numbers = zip(PROBLEMS, before.problems, cycle.problems, strict=True)
    return [f"{name} {old} -> {new}" for name, old, new in numbers if new > old]


def _seconds_lost(at: npt.NDArray[np.float64], stalls: list[Stall]) -> npt.NDArray[np.float64]:
    """At each of these times, in stalls that bear upon it.

    Behind a stall LinuxCNC runs the cycles it missed back to back: they may fail for as long again.
    """
    change = np.zeros(len(at) + 1)
    for stall in stalls:
        first, behind = np.searchsorted(at, (stall.start - AFTER, stall.end + BEFORE + stall.seconds))
        change[first] += stall.seconds
        change[behind] -= stall.seconds
    return np.cumsum(change)[:-1]


def held_up(cycles: list[Cycle]) -> list[int]:
    """Cycles that took so long that the card's watchdog may have bitten, and LinuxCNC does not know.

    For a reply missed meanwhile it writes everything anew, the watchdog's status too, before it reads it: no
    pin tells of the bite, all works again, and counts are lost. Seen with stalls made on purpose.
    """
    return [n for n in range(1, len(cycles)) if cycles[n].seconds - cycles[n - 1].seconds >= BITE]


def counts_wrong(cycles: list[Cycle], rate: float) -> list[int]:
    """Cycles that brought a count of encoder 0 which it did not have between the cycle before and this one.

    It turns steadily from its first movement to its last. A cycle without a reply repeats the count before.
    Nothing is said of the cycles in which it was stopped or the card's watchdog may have bitten unseen.
    """
    unsaid = {n for n, cycle in enumerate(cycles) if cycle.stopped} | set(held_up(cycles))
    moves = [n for n in range(1, len(cycles)) if cycles[n].counts[0] != cycles[n - 1].counts[0]]
    wrong: list[int] = []
    for last, now in pairwise(moves[1:-1]):
        if now - last > LOST_UNTIL_STOPPED or not unsaid.isdisjoint(range(last - 1, now + 1)):
            continue
        moved = cycles[now].counts[0] - cycles[last].counts[0]
        least = rate * (cycles[now - 1].seconds - cycles[last].seconds)
        most = rate * (cycles[now].seconds - cycles[last - 1].seconds)
        if not least - 2 <= moved <= most + 2:
            wrong.append(now)
    return wrong
