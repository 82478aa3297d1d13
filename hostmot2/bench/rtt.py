"""Ethernet: the driver's cycle beside a bare exchange, the emulated card beside a bare answerer."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import median
from struct import Struct
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.bench import peers
from hostmot2.bench.report import Goal, Report, Section
from hostmot2.bench.rounds import ROUNDS, Timing
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.ethernet import EthernetServer
from hostmot2.errors import check, new_error
from hostmot2.process_data import ProcessData
from hostmot2.transports.udp import UdpLink

EXCHANGES = 300
"""Of one candidate in one round."""
SPIN_US = 30
PERIODIC_HZ = 4000
CHANNELS = 2

BARE, ENGINE = "bare send and receive", "cycle in C: pack, exchange, unpack"
FROM_PYTHON, WITH_VALUES = "the same, called from Python", "the same, and eight values read"
ANSWERER, CARD = "bare answerer", "emulated 7I92 with a 7I77"

# HostMot2 registers of a 7I92 with a 7I77: what a cycle of its field I/O, analog outputs and encoders moves
READS = (
    (0x1000, 2), (0x0D00, 1), (0x3900, 1), (0x3600, 6), (0x3700, 6), (0x5B00, 1), (0x5C00, 1), (0x5D00, 2),
)  # fmt: skip
WRITES = ((0x1000, 2), (0x0E00, 1), (0x5D00, 2), (0x5B00, 1))
USER = (0x5E00, 0x5F00, 0x6000)
"""Interface data registers, a word per channel."""


def run(count: int | None = None) -> Report:
    """Rounds: `count`, or 15. The cycles at 4 kHz take four seconds a round."""
    rounds = count or ROUNDS
    report = Report("rtt")
    _cycle(report, rounds)
    _emulator(report, rounds)
    _periodic(report, seconds=min(60, 4 * rounds))
    report.notes.append("both ends on this machine, on one processor each; every candidate waits alike")
    return report


def _fifo() -> int:
    """The priority of what answers: that of the measuring thread, if it is real-time."""
    real_time = os.sched_getscheduler(0) == os.SCHED_FIFO
    return int(os.sched_getparam(0).sched_priority) if real_time else 0


@contextmanager
def _on_one_processor() -> Iterator[int]:
    """This thread on the first processor, for the other end the last; -1 if there is but one."""
    allowed = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {allowed[0]})
    try:
        yield allowed[-1] if len(allowed) > 1 else -1
    finally:
        os.sched_setaffinity(0, set(allowed))


class Cycle:
    """A whole cycle over a link to a port of this machine: 7I77 process data and the transfers around it."""

    def __init__(self, port: int, *, retry_ms: float = 25.0) -> None:
        self._error = new_error()
        self._keep: list[Any] = []
        self._used = 0
        self.link = UdpLink("127.0.0.1", port, spin_us=SPIN_US, retry_ms=retry_ms, error_limit=0)
        self._board = self._made("struct hm2_board **", lib.hm2_board_open, self.link.bus)
        self._cycle = self._made("struct hm2_cycle **", lib.hm2_cycle_new, self._board)
        words = self._buffer(2 * len(USER) * CHANNELS)
        self._blocks: Any = ffi.new("hm2_cyclic_words[]", len(READS) + len(WRITES) + 2 * len(USER))
        inputs, outputs = words + 0, words + len(USER) * CHANNELS
        for place, address in enumerate(USER):
            self._add(address, inputs + place * CHANNELS, CHANNELS, lib.HM2_TRANSFER_READ)
            self._add(address, outputs + place * CHANNELS, CHANNELS, lib.HM2_TRANSFER_WRITE)
        for address, size in READS:
            self._add(address, self._buffer(size), size, lib.HM2_TRANSFER_READ)
        for address, size in WRITES:
            self._add(address, self._buffer(size), size, lib.HM2_TRANSFER_WRITE)
        self.data = _process_data(inputs, outputs)
        self.context: Any = ffi.new("hm2_udp_floor_cycle *")
        self.context.cycle = self._cycle
        self.context.process_data = self.data.plan

    def _made(self, kind: str, make: Callable[..., int], source: Any) -> Any:
        out: Any = ffi.new(kind)
        check(make(source, out, self._error), self._error)
        return out[0]

    def _buffer(self, words: int) -> Any:
        buffer = ffi.new("uint32_t[]", words)
        self._keep.append(buffer)
        return buffer

    def _add(self, address: int, words: Any, count: int, flags: int) -> None:
        part: Any = ffi.new("hm2_cyclic *")
        block = self._blocks + self._used
        self._used += 1
        block.transfer.address, block.transfer.count = address, count
        block.transfer.words, block.transfer.flags = words, flags
        block.enabled = 1
        lib.hm2_cyclic_words_part(block, part)
        check(lib.hm2_cycle_add(self._cycle, part, self._error), self._error)

    def run(self) -> None:
        """One cycle; raises what went wrong."""
        check(lib.hm2_udp_floor_cycle_run(self.context), ffi.addressof(self.context, "error"))

    def request_size(self, sink: socket.socket) -> int:
        """Bytes of a cycle's request: one is sent to a socket that answers nothing."""
        check(lib.hm2_cycle_begin(self._cycle, self._error), self._error)
        size = len(sink.recv(2048))
        lib.hm2_cycle_finish(self._cycle, 0, self._error)
        return size

    def close(self) -> None:
        """Close the link."""
        lib.hm2_cycle_free(self._cycle)
        lib.hm2_board_free(self._board)
        self.link.disown()


def _process_data(inputs: Any, outputs: Any) -> ProcessData:
    """Two channels on the words of the transfers: a register after the other, a word per channel."""
    import numpy as np

    shape, strides = (CHANNELS, len(USER)), (4, 4 * CHANNELS)

    def image(words: Any) -> Any:
        flat = np.frombuffer(ffi.buffer(words, 4 * CHANNELS * len(USER)), np.uint32)
        return np.lib.stride_tricks.as_strided(flat, shape, strides)

    layouts = dict.fromkeys(range(CHANNELS), peers.LAYOUT)
    return ProcessData(layouts, input_image=image(inputs), output_image=image(outputs))


def _request_size() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sink:
        sink.bind(("127.0.0.1", 0))
        sink.settimeout(5)
        cycle = Cycle(sink.getsockname()[1])
        try:
            return cycle.request_size(sink)
        finally:
            cycle.close()


REPLY_SIZE = 8 + 4 * (sum(size for _, size in READS) + len(USER) * CHANNELS)


@contextmanager
def _answerer(reply_size: int, cpu: int) -> Iterator[int]:
    error, out = new_error(), ffi.new("struct hm2_udp_floor **")
    check(lib.hm2_udp_floor_open(reply_size, 100, _fifo(), cpu, out, error), error)
    floor: Any = out[0]
    try:
        yield int(lib.hm2_udp_floor_port(floor))
    finally:
        lib.hm2_udp_floor_close(floor)


def _times() -> Any:
    return ffi.new("uint64_t[]", EXCHANGES)


def _bare(port: int, request: bytes, window: int = 1) -> list[int]:
    times, error = _times(), new_error()
    status = lib.hm2_udp_floor_exchanges(
        port, request, len(request), SPIN_US * 1000, window, EXCHANGES, times, error
    )
    check(status, error)
    return list(times)


def _in_c(cycle: Cycle) -> list[int]:
    times = _times()
    check(lib.hm2_udp_floor_cycles(cycle.context, EXCHANGES, times), ffi.addressof(cycle.context, "error"))
    return list(times)


def _look_ns() -> float:
    """Of a look at an empty socket."""
    times, error = _times(), new_error()
    check(lib.hm2_udp_floor_looks(EXCHANGES, times, error), error)
    return float(median(list(times)) - median(_nothing_in_c()))


def _nothing_in_c() -> list[int]:
    times = _times()
    lib.hm2_udp_floor_nothing(EXCHANGES, times)
    return list(times)


def _nothing_in_python() -> list[int]:
    now = time.perf_counter_ns
    times = []
    for _ in range(EXCHANGES):
        start = now()
        times.append(now() - start)
    return times


def _from_python(cycle: Cycle) -> list[int]:
    """Timed around the call, as a program would make it: bound once, one argument."""
    step, context, now = lib.hm2_udp_floor_cycle_run, cycle.context, time.perf_counter_ns
    times = []
    for _ in range(EXCHANGES):
        start = now()
        status = step(context)
        times.append(now() - start)
        check(status, ffi.addressof(context, "error"))
    return times


def _with_values(cycle: Cycle) -> list[int]:
    """The same, and the first eight values as Python numbers."""
    step, context, now = lib.hm2_udp_floor_cycle_run, cycle.context, time.perf_counter_ns
    eight, values = Struct("8d").unpack_from, cycle.data.values.data
    times = []
    for _ in range(EXCHANGES):
        start = now()
        status = step(context)
        eight(values)
        times.append(now() - start)
        check(status, ffi.addressof(context, "error"))
    return times


Measurement = tuple[Callable[[], list[int]], Callable[[], list[int]]]
"""What is timed, and the timing of nothing in the same way."""


def _in_turn(candidates: dict[str, Measurement], rounds: int) -> dict[str, Timing]:
    """The median of each candidate in each round, less what timing nothing takes."""
    found: dict[str, list[float]] = {name: [] for name in candidates}
    for call, _ in candidates.values():
        call()
    for _ in range(rounds):
        for name, (call, nothing) in candidates.items():
            found[name].append(median(call()) - median(nothing()))
    return {name: Timing(name, tuple(values)) for name, values in found.items()}


def _cycle(report: Report, rounds: int) -> None:
    request = bytes(_request_size())
    with _on_one_processor() as other, _answerer(REPLY_SIZE, other) as port:
        cycle = Cycle(port)
        timings = _in_turn(
            {
                BARE: (lambda: _bare(port, request), _nothing_in_c),
                ENGINE: (lambda: _in_c(cycle), _nothing_in_c),
                FROM_PYTHON: (lambda: _from_python(cycle), _nothing_in_python),
                WITH_VALUES: (lambda: _with_values(cycle), _nothing_in_python),
            },
            rounds,
        )
        sent, look = cycle.link.counters, _look_ns()
        cycle.close()
    title = f"a cycle over UDP, {len(request)} bytes out, {REPLY_SIZE} back, ns"
    report.sections.append(Section(title, timings, BARE))
    why = (
        f"a reply is noticed at the next look at the socket, and a look takes {look:.0f} ns here, "
        f"{100 * look / timings[BARE].ns:.0f} % of a bare exchange; the rest is packing, listing, "
        "comparing and unpacking, met from caches that the system calls have emptied"
    )
    python = "; a call hands over the interpreter lock and takes it back, from caches the system has emptied"
    for name, limit, more in ((ENGINE, 1.03, ""), (FROM_PYTHON, 1.06, python), (WITH_VALUES, 1.10, python)):
        ratio = timings[BARE].times_faster_than(timings[name])
        text = f"{name}, times a bare exchange"
        report.goals.append(Goal(text, ratio, limit, at_least=False, why=why + more))
    per_cycle = (sent.requests + sent.replies) / sent.exchanges
    report.goals.append(Goal("datagrams per cycle, both ways", per_cycle, 2, at_least=False))


def _emulator(report: Report, rounds: int) -> None:
    """Exchanges one after the other, and eight under way."""
    request = _register_request()
    with (
        _on_one_processor() as other,
        EmulatedBoard("7i92+7i77", clock="real") as board,
        EthernetServer(board, spin_us=100, fifo_priority=_fifo(), cpu=other) as server,
        _answerer(REPLY_SIZE, other) as port,
    ):
        for window, limit in ((1, 0.9), (8, 0.8)):
            timings = _rates(port, server.port, request, window, rounds)
            report.sections.append(
                Section(f"an answer, {window} under way, {len(request)} bytes in, ns", timings, ANSWERER)
            )
            ratio = timings[CARD].times_faster_than(timings[ANSWERER])
            text = f"emulated card, exchanges per second beside a bare answerer, {window} under way"
            report.goals.append(Goal(text, ratio, limit, why=EMULATING))


def _rates(floor: int, card: int, request: bytes, window: int, rounds: int) -> dict[str, Timing]:
    """Means: with several under way single times say nothing."""
    found: dict[str, list[float]] = {ANSWERER: [], CARD: []}
    for _ in range(rounds):
        for name, port in ((ANSWERER, floor), (CARD, card)):
            found[name].append(sum(_bare(port, request, window)) / EXCHANGES)
    return {name: Timing(name, tuple(values)) for name, values in found.items()}


def _register_request() -> bytes:
    """A cycle's reads with the numbers around them, as the driver sends it, without what starts anything."""
    from hostmot2 import lbp16
    from hostmot2.registers import Lbp16Space, Lbp16Timer

    scratch = Lbp16Timer.scratch.number
    reads = [*READS, *((address, CHANNELS) for address in USER)]
    body = b"".join(lbp16.read(Lbp16Space.HOSTMOT2, address, size) for address, size in reads)
    number = lbp16.read(Lbp16Space.TIMER, scratch, 2)
    return number + body + lbp16.write(Lbp16Space.TIMER, scratch, [1, 0]) + number


EMULATING = (
    "a cycle's packet is 16 commands on 27 registers, with encoders, smart-serial firmware and a watchdog "
    "brought up to its moment first: some 10,000 instructions, none of which stands out"
)
STAGES = ("woken late", "sending", "answer")
WORST = 5


def _periodic(report: Report, seconds: int) -> None:
    """At 4 kHz on the emulated card: nothing lost, every late cycle accounted for."""
    count = seconds * PERIODIC_HZ
    with (
        _on_one_processor() as other,
        EmulatedBoard("7i92+7i77", clock="real") as board,
        EthernetServer(board, spin_us=100, fifo_priority=_fifo(), cpu=other) as server,
    ):
        cycle, timing = Cycle(server.port, retry_ms=0), ffi.new("hm2_udp_floor_timing *")
        lates = ffi.new("hm2_udp_floor_late[]", count)
        timing.lates, timing.capacity = lates, count
        lib.hm2_udp_floor_periodic(cycle.context, 1_000_000_000 // PERIODIC_HZ, count, timing)
        cycle.close()
    _account(report, timing, [lates[n] for n in range(timing.recorded)], seconds)


def _account(report: Report, timing: Any, lates: list[Any], seconds: int) -> None:
    text = f"in {seconds} s at {PERIODIC_HZ} Hz"
    report.goals.append(Goal(f"replies lost {text}", float(timing.lost), 0, at_least=False))
    unknown = float(timing.late - len(lates))
    report.goals.append(Goal(f"late cycles not accounted for {text}", unknown, 0, at_least=False))
    report.notes.append(
        f"{timing.cycles} cycles {text}, {timing.late} of them later than a period, "
        f"{timing.skipped} periods left out"
    )
    for number, stage in enumerate(STAGES):
        times = sorted((late.ns[number] / 1e3 for late in lates if late.stage == number), reverse=True)
        if times:
            worst = ", ".join(f"{us:.0f}" for us in times[:WORST])
            report.notes.append(f"late by {stage}: {len(times)}, the longest {worst} us")
