"""The real firmware's recorded answers (tests/golden/sserial) behind a bus, and the C port that drives it.

A recording is a list of commands with the registers written before and read after each. `Recorded` serves
one command after the other: COMMAND stays busy as long as it did, then the registers read as they did. It
notes a command written over one that is at work, and an output word that differs from the recorded one.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.errors import new_error

GOLDEN = Path(__file__).parent.parent / "golden" / "sserial"
BASE, REGISTER, INSTANCE = 0x5A00, 0x100, 0x40
ROWS = {"command": 0, "data": 1, "cs": 2, "if0": 3, "if1": 4, "if2": 5}
NAMES = {number: name for name, number in ROWS.items()}
STEP_NS = 100
"""What one register access takes."""


@dataclass
class Step:
    command: int
    writes: dict[tuple[str, int], int] = field(default_factory=dict)
    reads: dict[tuple[str, int], int] = field(default_factory=dict)
    data: int | None = None
    duration_ns: int = 2000
    mode_sent: dict[int, int] = field(default_factory=dict)


def load(name: str) -> list[Step]:
    steps: list[Step] = []
    writes: dict[tuple[str, int], int] = {}
    for line in (GOLDEN / f"{name}.jsonl").read_text().splitlines():
        event = json.loads(line)
        op, reg, channel = event["op"], event.get("reg"), event.get("ch") or 0
        if op == "w" and reg == "command":
            steps.append(Step(int(event["value"], 16), writes))
            writes = {}
        elif op == "w" and reg in ROWS:
            writes[reg, channel] = int(event["value"], 16)
        elif op == "poll" and "dt_us" in event:
            steps[-1].duration_ns = round(event["dt_us"] * 1000)
        elif op == "r" and reg == "data" and steps:
            steps[-1].data = int(event["value"], 16)
        elif op == "r" and reg in ROWS and steps:
            steps[-1].reads.setdefault((reg, channel), int(event["value"], 16))
    return steps


def is_local_read(command: int) -> bool:
    return command & 0xF000 == 0x2000


class Recorded:
    """The bus. `expect(i)` tells which recorded command comes next."""

    def __init__(self, name: str) -> None:
        self.steps = load(name)
        self.next = 0
        self.now_ns = 0
        self.busy_until_ns = 0
        self.command = 0
        self.registers: dict[tuple[str, int], int] = {}
        self.written: dict[tuple[str, int], int] = {}
        self.accesses: list[tuple[str, int, str, int]] = []
        self.commands: list[int] = []
        self.faults: list[str] = []
        self.extra_doits: list[dict[tuple[str, int], int]] = []
        self.locals = {
            step.command & 0xFFF: step.data
            for step in self.steps
            if is_local_read(step.command) and step.data is not None
        }
        self._exchange: list[Any] = []
        self._callbacks = (
            ffi.callback("int(void *, const hm2_transfer *, size_t, hm2_error *)", self._begin),
            ffi.callback("int(void *, int64_t, hm2_error *)", lambda *_: 0),
            ffi.callback("int64_t(void *)", lambda _: self.now_ns),
            ffi.callback("void(void *, int64_t)", self._pause),
            ffi.callback("void(void *)", lambda _: None),
        )
        self.bus = ffi.new("hm2_bus *", (ffi.NULL, *self._callbacks))

    def expect(self, index: int) -> Step:
        self.next = index
        return self.steps[index]

    def _pause(self, _self: Any, ns: int) -> None:
        self.now_ns += ns

    def _begin(self, _self: Any, transfers: Any, count: int, _error: Any) -> int:
        for i in range(count):
            transfer = transfers[i]
            for word in range(transfer.count):
                self.now_ns += STEP_NS
                address = transfer.address + 4 * word
                row, channel = NAMES[(address - BASE) // REGISTER], (address % REGISTER) // 4
                if transfer.flags & lib.HM2_TRANSFER_WRITE:
                    self._write(row, channel, transfer.words[word])
                else:
                    transfer.words[word] = self._read(row, channel)
        return 0

    def _read(self, row: str, channel: int) -> int:
        if row == "command":
            if self.now_ns >= self.busy_until_ns:
                self.command = 0
            value = self.command
        else:
            value = self.registers.get((row, channel), 0)
        self.accesses.append(("r", channel, row, value))
        return value

    def _write(self, row: str, channel: int, value: int) -> None:
        self.accesses.append(("w", channel, row, value))
        if row != "command":
            self.written[row, channel] = value
        elif not value & 1 << 31:
            self._execute(value & 0xFFFF)

    def _execute(self, command: int) -> None:
        if self.command and self.now_ns < self.busy_until_ns:
            self.faults.append(f"0x{command:04X} written while 0x{self.command:04X} was at work")
        self.commands.append(command)
        step = self._take(command)
        self.command = command
        self.busy_until_ns = self.now_ns + step.duration_ns
        if step.data is not None:
            self.registers["data", 0] = step.data
        self.registers.update(step.reads)

    def _take(self, command: int) -> Step:
        while self.next < len(self.steps) and self.steps[self.next].command != command:
            if not is_local_read(self.steps[self.next].command):
                break
            self.next += 1  # the recording looked at counters in between
        step = self.steps[self.next] if self.next < len(self.steps) else None
        if step is not None and step.command == command:
            self.next += 1
            self._compare_outputs(step)
            return step
        if is_local_read(command):
            return Step(command, data=self.locals.get(command & 0xFFF, 0))
        if command & 0xFF00 == 0x1000:
            # the zeroes that the driver sends before a stop
            self.extra_doits.append({k: v for k, v in self.written.items() if k[0].startswith("if")})
            return Step(command, data=0, duration_ns=100_000)
        self.faults.append(f"0x{command:04X} is not in the recording")
        return Step(command)

    def _compare_outputs(self, step: Step) -> None:
        for (row, channel), value in step.writes.items():
            if row.startswith("if") and step.command & 0xFF00 == 0x1000:
                now = self.written.get((row, channel))
                if now != value:
                    self.faults.append(f"{row} of channel {channel} is {now}, recorded 0x{value:08X}")


class CPort:
    """The C port on a recording."""

    def __init__(self, recorded: Recorded, channels: int = 4) -> None:
        self.recorded = recorded
        self.error = new_error()
        board = ffi.new("struct hm2_board **")
        assert lib.hm2_board_open(recorded.bus, board, self.error) == lib.HM2_OK
        self.board = ffi.gc(board[0], lib.hm2_board_free)
        port = ffi.new("struct hm2_sserial **")
        config = ffi.new("hm2_sserial_config *", (BASE, REGISTER, INSTANCE, 0, channels, 3))
        assert lib.hm2_sserial_open(self.board, config, port, self.error) == lib.HM2_OK
        self.handle = ffi.gc(port[0], lib.hm2_sserial_free)
        self.image = lib.hm2_sserial_get_image(self.handle)

    def call(self, name: str, *arguments: Any) -> int:
        status = getattr(lib, "hm2_sserial_" + name)(self.handle, *arguments, self.error)
        return int(status)

    def events(self) -> list[tuple[int, int, int, int]]:
        """channel, failed, CS, rising bits of each new fault."""
        events, lost = ffi.new("hm2_sserial_event[64]"), ffi.new("uint64_t *")
        count = lib.hm2_sserial_take_events(self.handle, events, 64, lost)
        assert lost[0] == 0
        return [(e.channel, e.failed, e.cs, e.rising) for e in events[0:count]]

    def board_counters(self) -> tuple[int, int, int]:
        """exchanges, words read, words written."""
        counters = ffi.new("hm2_board_counters *")
        lib.hm2_board_get_counters(self.board, counters)
        return counters.exchanges, counters.words_read, counters.words_written
