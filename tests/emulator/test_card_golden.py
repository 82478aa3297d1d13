"""The emulated card against the recorded answers of the published card HDL, clock for clock.

The format is described in tests/golden/card/README.md. A write acts as taken by the edge last advanced
to; a read shows the state behind the edge before its own.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import pytest

from hostmot2.emulator import EmulatedBoard

GOLDEN = Path(__file__).parent.parent / "golden" / "card"
BUILD_B = {"1b_id_idrom_5i25_7i77_7i76"}
ENCODERS = {"4a_mux_basic", "4d_mux_timestamp"}
TRACES = sorted(path.stem for path in GOLDEN.glob("*.jsonl"))


def events(trace: str) -> Iterator[dict[str, str]]:
    with (GOLDEN / f"{trace}.jsonl").open() as lines:
        for line in lines:
            yield json.loads(line)


def words(trace: str) -> dict[int, int]:
    with (GOLDEN / f"{trace}.hex").open() as lines:
        return {int(address, 16): int(value, 16) for address, value in (line.split() for line in lines)}


class Replay:
    """Steps a board through a trace; collects every difference."""

    def __init__(self, trace: str) -> None:
        self.board = EmulatedBoard(
            "5i25+7i77+7i76" if trace in BUILD_B else "5i25+7i77x2", clock="virtual", strict=False
        )
        self.trace = trace
        self.differences: list[str] = []
        if trace in ENCODERS:
            for n in range(12):
                self.board.encoder_input(n).set(a=0, b=0, z=0)

    def to(self, clock: int) -> None:
        self.board.advance_clocks(max(0, clock - self.board.clocks))

    def run(self) -> list[str]:
        """Reads show the state before their clock's edge; what else has that clock comes with it."""
        for clock, group in groupby(events(self.trace), key=lambda event: int(event["clk"])):
            events_now = list(group)
            pins = [event for event in events_now if event["op"] == "pin"]
            self.to(clock - 1)
            for event in events_now:
                if event["op"] == "r":
                    self.read(event)
            for event in pins:  # a change comes with its edge, not before
                at_edge = round(float(event["t_us"]) * 1000) % 30 == 15  # else a monitor is switched on
                if at_edge and self.level(event["addr"]) == event["value"]:
                    self.differences.append(f"{clock} pin {event['addr']}: {event['value']} too early")
            self.to(clock)
            for event in events_now:
                if event["op"] == "w":
                    self.board.write(int(event["addr"], 16), int(event["value"], 16))
            for event in pins:
                self.expect(event, self.level(event["addr"]))
            for event in events_now:
                if event["op"] == "set":
                    self.stimulate(event)
        return self.differences

    def expect(self, event: dict[str, str], got: str) -> None:
        if got != event["value"]:
            self.differences.append(
                f"{event['clk']} {event['op']} {event['addr']}: {event['value']} but {got}"
            )

    def read(self, event: dict[str, str]) -> None:
        mask = ~int(event.get("undriven", "0"), 16) & 0xFFFFFFFF
        value = self.board.read(int(event["addr"], 16))
        self.expect(event, f"0x{value & mask:08x}")

    def level(self, name: str) -> str:
        if name == "LEDS":  # lit is low, the first LED is leds(1)
            return "".join("10"[lit] for lit in self.board.leds)
        if name == "INT":
            return "10"[self.board.interrupt]
        return self.board.pin(int(name.removeprefix("IO"))).level

    def stimulate(self, event: dict[str, str]) -> None:
        if match := re.fullmatch(r"pin(\d+)", event["addr"]):
            pin = self.board.pin(int(match[1]))
            pin.drive({"0": 0, "1": 1, "Z": None}[event["value"]])
        elif match := re.fullmatch(r"enc(\d+)_run", event["addr"]):
            period, counts = map(int, re.findall(r"-?\d+", event["value"]))
            self.board.encoder_input(int(match[1])).run(edge_period_ns=period / 1000, counts=counts)


@pytest.mark.parametrize("trace", TRACES)
def test_card_answers_as_the_hdl_did(trace: str) -> None:
    assert Replay(trace).run() == []


@pytest.mark.parametrize(
    ("card", "image"), [("5i25+7i77x2", "idrom_5i25_7i77x2"), ("5i25+7i77+7i76", "idrom_5i25_7i77_7i76")]
)
def test_idrom_is_word_for_word_that_of_the_hdl(card: str, image: str) -> None:
    board = EmulatedBoard(card, clock="virtual")
    assert {address: board.read(address) for address in words(image)} == words(image)
