"""Draws docs/pictures/encoder_multiplexing.svg: two encoders on three wires, as the emulated card has them.

python docs/generate_timing.py [--check]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field

from generating import main

import hostmot2
from hostmot2.emulator import EmulatedBoard
from hostmot2.registers import Gtag

CLOCKS = 64
EDGES = {0: 10, 1: 26}  # encoder: the clock at which its A rises
SELECT, WIRE_A = 7, 8  # I/O numbers on the first connector of a 5I25 with a 7I77

LEFT, WIDTH, STEP, HIGH, ROW = 150, 13, 34, 20, 46
TRACES = (
    "Sel0",
    "A of encoder 0",
    "A of encoder 1",
    "the shared wire A",
    "count of encoder 0",
    "count of encoder 1",
)
STYLE = (
    "text{font:13px sans-serif;fill:#222}.small{font-size:11px;fill:#555}"
    ".line{fill:none;stroke:#1b6ca8;stroke-width:2}"
    ".edge{stroke:#ccc;stroke-dasharray:3 3}.count{stroke:#2f7d32}.even{fill:#b5492a}.odd{fill:#6a3d9a}"
)


@dataclass
class Traces:
    """One list of levels per trace, a value per clock; ns: the length of a clock."""

    ns: float
    levels: list[list[int]] = field(default_factory=lambda: [[] for _ in TRACES])


def observe() -> Traces:
    """The card clock by clock, from the moment at which Sel0 has just gone to 0."""
    card = EmulatedBoard("5i25+7i77", clock="virtual")
    with hostmot2.open(card) as hm2:
        for encoder in hm2.encoders[:2]:
            encoder.filter = False  # 3 samples instead of 15
        for number in EDGES:
            card.encoder_input(number).set(a=0, b=0, z=0)
        card.advance_clocks(400)
        counts = hm2.module(Gtag.MUXED_ENCODER).base
        for level in "101":
            while card.pin(SELECT).level == level:
                card.advance_clocks(1)
        traces = Traces(1e9 / hm2.idrom.clock_low)
        for clock in range(CLOCKS):
            for number, edge in EDGES.items():
                if clock == edge:
                    card.encoder_input(number).set(a=1, b=0, z=0)
            driven = [int(clock >= edge) for edge in EDGES.values()]
            pads = [int(card.pin(pin).level) for pin in (SELECT, WIRE_A)]
            counted = [card.read(counts + 4 * number) & 1 for number in EDGES]
            for trace, level in zip(traces.levels, (pads[0], *driven, pads[1], *counted), strict=True):
                trace.append(level)
            card.advance_clocks(1)
    return traces


def draw(traces: Traces) -> str:
    """The picture."""
    width, height = LEFT + CLOCKS * WIDTH + 20, STEP + len(TRACES) * ROW + 70
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}">'
        f"<title>Two encoders on three wires</title><style>{STYLE}</style>"
        f'<rect width="{width}" height="{height}" fill="white"/>'
    ]
    select = traces.levels[0]
    bottom = STEP + len(TRACES) * ROW
    for clock in range(1, CLOCKS):
        if select[clock] != select[clock - 1]:
            parts.append(sample(clock, bottom, even=bool(select[clock])))
    for row, (name, levels) in enumerate(zip(TRACES, traces.levels, strict=True)):
        parts.append(line(row, name, levels, "count" if name.startswith("count") else ""))
    parts += legend(traces, bottom)
    return "".join(parts) + "</svg>\n"


def line(row: int, name: str, levels: list[int], kind: str) -> str:
    """One trace."""
    base = STEP + row * ROW + HIGH
    points = []
    for clock, level in enumerate(levels):
        y = base - HIGH * level
        points += [f"{LEFT + clock * WIDTH},{y}", f"{LEFT + (clock + 1) * WIDTH},{y}"]
    return (
        f'<text x="{LEFT - 10}" y="{base - 4}" text-anchor="end">{name}</text>'
        f'<polyline class="line {kind}" points="{" ".join(points)}"/>'
    )


def sample(clock: int, bottom: int, *, even: bool) -> str:
    """Where the wires are looked at: the end of each half cycle."""
    x = LEFT + clock * WIDTH
    kind, number = ("even", 0) if even else ("odd", 1)
    return (
        f'<line class="edge" x1="{x}" x2="{x}" y1="{STEP - 8}" y2="{bottom}"/>'
        f'<path class="{kind}" d="M{x - 5},{STEP - 18}h10l-5,9z"/>'
        f'<text class="small" x="{x}" y="{STEP - 21}" text-anchor="middle">{number}</text>'
    )


def legend(traces: Traces, bottom: int) -> list[str]:
    """The axis and what the marks mean."""
    y = bottom + 14
    parts = [f'<line stroke="#222" x1="{LEFT}" x2="{LEFT + CLOCKS * WIDTH}" y1="{y - 10}" y2="{y - 10}"/>']
    for clock in range(0, CLOCKS + 1, 16):
        x = LEFT + clock * WIDTH
        parts.append(
            f'<text class="small" x="{x}" y="{y + 5}" text-anchor="middle">{clock * traces.ns:.0f} ns</text>'
        )
    lines = (
        "marks: end of a half cycle, when the wires are taken for encoder 0 or 1;",
        "each counter believes a level after three of its samples",
    )
    return parts + [
        f'<text class="small" x="{LEFT}" y="{y + 24 + 15 * number}">{text}</text>'
        for number, text in enumerate(lines)
    ]


def pages() -> dict[str, str]:
    """The picture."""
    return {"pictures/encoder_multiplexing.svg": draw(observe())}


if __name__ == "__main__":
    sys.exit(main(__doc__, pages))
