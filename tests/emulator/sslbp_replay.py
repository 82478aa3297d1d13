"""Replays a recording of the SSLBP firmware (tests/golden/sserial/README.md) on an emulated board."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hostmot2.emulator import EmulatedBoard, EmulatedRemote

GOLDEN = Path(__file__).parent.parent / "golden" / "sserial"
TOLERANCE_US = 3.0
POLL_US = 0.32
WATCH_US = 1.1
REGISTERS = {"command": 0x5A00, "data": 0x5B00, "cs": 0x5C00, "if0": 0x5D00, "if1": 0x5E00, "if2": 0x5F00}
STAND_INS = {0: ("7I77", 0x12345678), 2: ("7I84", 0x0000BEEF)}
SECOND_SET = ("s1_8i20_run", "w1_counters", "y5_7i77_bringup")
CHANNELS = {"y5_7i77_bringup": 3}
MODELS = {0: None, 1: "8i20", 2: "7i64"}
NUMBERS = {
    "recv_size": "receive_size",
    "xmit_size": "transmit_size",
    "ptoc": "ptoc",
    "gtoc": "gtoc",
    "unit": "unit_number",
    "fault_byte": "fault",
    "clrflag_busy_reads": "clear_flag_busy_reads",
    "fault_word": "fault_word",
    "fault_word_on_enable": "fault_word_on_enable",
    "pid_off_reads": "pid_off_reads",
    "bad_cookies": "bad_cookies",
    "cookie": "cookie",
}
FLAGS = {
    "alive": "alive",
    "fault_clear_works": "fault_clears",
    "unit_rpc_present": "answers_unit_number",
    "disc_rpc_present": "answers_discovery",
}
INJECTIONS = {
    "skip_replies": "skip",
    "bad_crc_replies": "bad_crc",
    "extra_bytes_once": "extra",
    "break_once": "framing_break",
}


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def image(trace: str) -> dict[int, int]:
    name = "remote_image2.json" if trace in SECOND_SET else "remote_image.json"
    memory = json.loads((GOLDEN / name).read_text())["mem"]
    return {int(address, 16): value for address, value in memory.items()}


class Replay:
    """Drives a board as the recorded host drove the HDL and collects every difference."""

    def __init__(self, trace: str) -> None:
        self.trace = trace
        self.events = lines(GOLDEN / f"{trace}.jsonl")
        self.board = EmulatedBoard("5i25+7i77", clock="virtual", sserial_channels=CHANNELS.get(trace, 4))
        self.port = self.board.sserial[0]
        self.remotes: dict[int, EmulatedRemote] = {}
        self.line: list[Any] = []
        self.differences: list[str] = []
        self.late = 0.0  # of the board against the recording, microseconds
        self.written = 0.0  # when the command in progress was
        self.shown: dict[int, list[tuple[float, int]]] = {}
        watched = [event for event in self.events if event["op"] == "watch"]
        self.watched = {event["ch"] for event in watched}
        self.spans = [(event["t_us"] - 5.0, event["t_us"] + 5.0) for event in watched]
        self.modes = [event for event in self.events if event["op"] == "remote_mode"]

    def run(self) -> list[str]:
        for channel in range(self.port.channels):
            self.port.detach(channel)
        for event in self.events:
            getattr(self, "do_" + event["op"])(event)
        self.advance(self.board.now_us + 60.0)
        self.check_writes()
        self.check_modes()
        self.check_watched()
        self.check_wire()
        return self.differences

    # -- time

    def advance(self, until: float) -> None:
        while self.spans and self.spans[0][0] + self.late < until:
            begin, end = (edge + self.late for edge in self.spans[0])
            self.step(begin)
            while self.board.now_us < min(end, until):
                self.step(self.board.now_us + 0.1)
                self.look()
            if end > until:
                break
            self.spans.pop(0)
        self.step(until)
        self.line += self.port.take_line_bytes()

    def step(self, until: float) -> None:
        if until > self.board.now_us:
            self.board.advance(until - self.board.now_us)

    def look(self) -> None:
        for channel in self.watched:
            value = self.board.read(REGISTERS["cs"] + 4 * channel)
            history = self.shown.setdefault(channel, [])
            if not history or history[-1][1] != value:
                history.append((self.board.now_us, value))

    def at(self, event: dict[str, Any]) -> None:
        self.advance(event["t_us"] + self.late)

    def differ(self, event: dict[str, Any], got: object) -> None:
        self.differences.append(f"{event} but {got}")

    # -- what the host does

    def do_note(self, event: dict[str, Any]) -> None:
        self.at(event)

    def do_w(self, event: dict[str, Any]) -> None:
        self.at(event)
        value = int(event["value"], 16)
        self.board.write(REGISTERS[event["reg"]] + 4 * (event["ch"] or 0), value)
        if event["reg"] == "command" and not value >> 31:
            self.written = self.board.now_us

    def do_r(self, event: dict[str, Any]) -> None:
        self.at(event)
        got = int(self.board.read(REGISTERS[event["reg"]] + 4 * (event["ch"] or 0)))  # type: ignore[arg-type]
        if not same(event["reg"], int(event["value"], 16), got):
            self.differ(event, hex(got))

    def do_poll(self, event: dict[str, Any]) -> None:
        if "dt_us" not in event:
            self.do_r(event)
            return
        tries = round((event["dt_us"] - 0.22) / POLL_US)
        first = self.written + event["dt_us"] - tries * POLL_US
        k = max(0, tries - 40)
        self.advance(first + k * POLL_US)
        while self.board.read(REGISTERS["command"]) and k < tries + 40:
            k += 1
            self.advance(first + k * POLL_US)
        took = self.board.now_us - self.written
        if self.board.read(REGISTERS["command"]) or abs(took - event["dt_us"]) > TOLERANCE_US:
            self.differ(event, f"{took:.2f} us")
        self.late = self.board.now_us - event["t_us"]

    # -- the remotes

    def remote(self, event: dict[str, Any]) -> EmulatedRemote:
        channel = event["ch"]
        if channel not in self.remotes:
            name, unit = STAND_INS.get(channel, ("", 0))
            model = [e["value"] for e in self.events if e.get("knob") == "model" and e["ch"] == channel]
            offset = [e["value"] for e in self.events if e.get("knob") == "mem_offset" and e["ch"] == channel]
            first = offset[0] if offset else 0
            memory = {
                address - first: value for address, value in image(self.trace).items() if address >= first
            }
            remote = EmulatedRemote(
                name, unit, memory=memory, turnaround_us=6.0, model=MODELS[model[0] if model else 0]
            )
            remote.alive = False
            self.remotes[channel] = remote
            self.port.attach(channel, remote)
        return self.remotes[channel]

    def do_set(self, event: dict[str, Any]) -> None:
        self.at(event)
        remote, knob, value = self.remote(event), event["knob"], event["value"]
        if knob in NUMBERS:
            setattr(remote, NUMBERS[knob], value)
        elif knob in FLAGS:
            setattr(remote, FLAGS[knob], bool(value))
        elif knob in INJECTIONS:
            remote.inject(**{INJECTIONS[knob]: value})
        elif knob == "input_bytes":
            remote.inputs = bytes(int(byte, 16) for byte in value)
        elif knob == "reply_delay_ns":
            remote.turnaround_us = value / 1000
        elif knob == "name_le":
            remote.name = value.to_bytes(4, "little").decode()
        else:
            assert knob in ("model", "mem_offset"), knob

    def do_remote_out(self, event: dict[str, Any]) -> None:
        self.at(event)
        expected = bytes(int(byte, 16) for byte in event["bytes"])
        got = self.remote(event).outputs[: len(expected)]
        if got != expected:
            self.differ(event, got.hex())

    def do_remote_write(self, event: dict[str, Any]) -> None:
        event["late"] = self.late

    do_remote_mode = do_remote_write

    def do_watch(self, event: dict[str, Any]) -> None:
        event["late"] = self.late

    # -- what was collected

    def check_writes(self) -> None:
        for channel, remote in self.remotes.items():
            expected = [e for e in self.events if e["op"] == "remote_write" and e["ch"] == channel]
            got = remote.writes
            if len(got) != len(expected):
                self.differences.append(f"{len(expected)} remote writes, but {len(got)}")
            for event, write in zip(expected, got, strict=False):
                data = bytes(int(byte, 16) for byte in event.get("bytes", [])) or write.data
                same_time = abs(write.time_us - event["t_us"] - event["late"]) <= TOLERANCE_US
                size = event.get("size", len(data))
                if (write.address, len(write.data)) != (int(event["addr"], 16), size) or not same_time:
                    self.differ(event, write)
                if write.data != data:
                    self.differ(event, write)

    def check_modes(self) -> None:
        got = [(f[0], f[1], f[3]) for f in self.frames() if f[2] and f[3][0] == 0xE6 and len(f[3]) == 3]
        if len(got) != len(self.modes):
            self.differences.append(f"{len(self.modes)} software modes, but {len(got)}")
        for event, (channel, start, frame) in zip(self.modes, got, strict=False):
            time = start + 2 * 4.03 + 3.8
            if (channel, frame[1]) != (event["ch"], int(event["value"], 16)):
                self.differ(event, frame)
            if abs(time - event["t_us"] - event["late"]) > TOLERANCE_US:
                self.differ(event, time)

    def check_watched(self) -> None:
        for channel in self.watched:
            history = self.shown[channel]
            position = 0
            for event in self.events:
                if event["op"] != "watch" or event["ch"] != channel:
                    continue
                expected, time = int(event["value"], 16), event["t_us"] + event["late"]
                while position < len(history) and not (
                    history[position][1] == expected
                    and (
                        position + 1 == len(history)
                        or history[position + 1][0] > time - WATCH_US - TOLERANCE_US
                    )
                ):
                    position += 1
                if position == len(history) or history[position][0] > time + TOLERANCE_US:
                    self.differ(event, "never seen then")
                    break

    def frames(self) -> list[tuple[int, float, bool, bytes]]:
        """Channel, start, whether to the remote, bytes. A pause of more than half a byte ends a frame."""
        out: list[tuple[int, float, bool, bytearray]] = []
        last: dict[tuple[int, bool], float] = {}
        for byte in sorted(self.line, key=lambda b: b.start_us):
            key = (byte.channel, byte.to_remote)
            if byte.start_us - last.get(key, -100.0) > 15 * byte.bit_us:
                out.append((byte.channel, byte.start_us, byte.to_remote, bytearray()))
            next(f for f in reversed(out) if (f[0], f[2]) == key)[3].append(byte.value)
            last[key] = byte.start_us
        return [(c, start, to, bytes(data)) for c, start, to, data in out]

    def check_wire(self) -> None:
        recorded = lines(GOLDEN / "wire" / f"{self.trace}.jsonl")
        for channel in range(self.port.channels):
            expected = [f for f in recorded if f["ch"] == channel]
            got = [f for f in self.frames() if f[0] == channel]
            if len(expected) > len(got):
                self.differences.append(f"channel {channel}: {len(expected)} frames, but {len(got)}")
            for event, (_, start, to_remote, data) in zip(expected, got, strict=False):
                if (event["dir"], event["hex"]) != (
                    "fw->remote" if to_remote else "remote->fw",
                    data.hex(" "),
                ):
                    self.differ(event, data.hex(" "))
                    break
                if abs(start - event["t_us"]) > TOLERANCE_US + abs(self.late):
                    self.differ(event, f"at {start:.2f}")
                    break


def same(register: str, expected: int, got: int) -> bool:
    """Equal, or both somewhere in a chatter exchange."""
    if register == "cs" and (expected >> 16 & 0xFF) in (0x3A, 0x3B) and (got >> 16 & 0xFF) in (0x3A, 0x3B):
        return expected & 0xFF00FFFF == got & 0xFF00FFFF
    return expected == got
