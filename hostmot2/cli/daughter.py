"""A daughter card's connectors, jumpers, LEDs and limits, as text or as a picture: `hm2 pins 7i77`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from hostmot2.cli.session import Session, rows
from hostmot2.wiring import WIRING, CardFacts
from hostmot2.wiring.drawing import draw, range_text


def show(session: Session, card: str, connector: str | None, svg: Path | None) -> None:
    """Report a daughter card's facts, or draw them. Raises click.UsageError for an unknown connector."""
    facts = WIRING[card.lower()]
    if svg is not None:
        svg.write_text(draw(facts), encoding="utf-8")
        session.report({"file": str(svg)}, f"{svg}: {facts.title}")
        return
    if connector is not None and connector.upper() not in {each.name.upper() for each in facts.connectors}:
        names = ", ".join(each.name for each in facts.connectors)
        raise click.UsageError(f"{facts.name.upper()} has no connector {connector}; it has {names}")
    session.report(asdict(facts), rows(("where", "what", "meaning", ""), _lines(facts, connector)))


def _lines(facts: CardFacts, only: str | None) -> list[tuple[object, ...]]:
    lines: list[tuple[object, ...]] = []
    for connector in facts.connectors:
        if only is None or connector.name.upper() == only.upper():
            lines.append((connector.name, connector.purpose, connector.kind, ""))
            lines += [(f"  {t.pin}", t.signal, t.direction, t.note) for t in connector.terminals]
    if only is not None:
        return lines
    for jumper in facts.jumpers:
        for position, meaning in jumper.positions:
            default = "default" if position == jumper.default else ""
            lines.append((", ".join(jumper.names), f"{jumper.purpose}: {position}", meaning, default))
    lines += [(led.name, f"{led.colour}, {led.place}", led.shows, led.normal) for led in facts.leds]
    lines += [
        ("limit", each.what, range_text(each.minimum, each.maximum), each.unit) for each in facts.limits
    ]
    lines += [("check", text, "", "") for text in facts.power_checklist]
    return lines
