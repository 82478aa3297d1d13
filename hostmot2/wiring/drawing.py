"""A daughter card's connectors, jumpers and LEDs as an SVG picture."""

from __future__ import annotations

from xml.sax.saxutils import escape

from hostmot2.wiring.facts import CardFacts, Connector

_ROW, _COLUMN, _MARGIN, _PER_ROW = 16, 370, 16, 4
_COLOURS = {"in": "#1b6ca8", "out": "#b5492a", "power": "#2f7d32", "both": "#6a3d9a", "": "#888888"}
_STYLE = (
    "text{font:11px sans-serif}"
    ".title{font:bold 16px sans-serif}.head{font:bold 12px sans-serif}.note{fill:#777;font-size:9px}"
    ".box{fill:#fafafa;stroke:#bbb}"
)


def draw(card: CardFacts) -> str:
    """The picture as text. Pins are coloured by direction, seen from the card."""
    blocks = [_connector(connector) for connector in card.connectors]
    blocks += [_list("jumpers", _jumper_lines(card)), _list("limits", _limit_lines(card))]
    if card.leds:
        blocks.append(_list("LEDs", _led_lines(card)))
    parts, height = _place(blocks)
    width = 2 * _MARGIN + _PER_ROW * _COLUMN
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}"><title>{escape(card.title)}</title><style>{_STYLE}</style>'
        f'<rect width="{width}" height="{height}" fill="white"/>'
        f'<text class="title" x="{_MARGIN}" y="24">{escape(card.title)}</text>'
        f'<text class="note" x="{_MARGIN}" y="40">directions seen from the card: {_legend()}</text>'
    )
    return head + "".join(parts) + "</svg>\n"


def _legend() -> str:
    names = {"in": "input", "out": "output", "power": "power"}
    return ", ".join(f'<tspan fill="{_COLOURS[key]}">{name}</tspan>' for key, name in names.items())


Block = tuple[str, list[tuple[str, str, str]]]
"""Head, and lines of (text, colour, note)."""


def _connector(connector: Connector) -> Block:
    lines = [
        (f"{terminal.pin:>2}  {terminal.signal}", _COLOURS[terminal.direction], terminal.note)
        for terminal in connector.terminals
    ]
    return f"{connector.name}: {connector.purpose}", lines


def _list(head: str, lines: list[str]) -> Block:
    return head, [(line, "#222222", "") for line in lines]


def _jumper_lines(card: CardFacts) -> list[str]:
    lines = []
    for jumper in card.jumpers:
        lines.append(f"{', '.join(jumper.names)}: {jumper.purpose}")
        for position, meaning in jumper.positions:
            default = " (default)" if position == jumper.default else ""
            lines.append(f"    {position}: {meaning}{default}")
    return lines


def _limit_lines(card: CardFacts) -> list[str]:
    return [f"{limit.what}: {range_text(limit.minimum, limit.maximum)} {limit.unit}" for limit in card.limits]


def range_text(minimum: float | None, maximum: float | None) -> str:
    """A range in words."""
    if minimum is None:
        return f"at most {maximum:g}"
    if maximum is None:
        return f"at least {minimum:g}"
    return f"{minimum:g} to {maximum:g}"


def _led_lines(card: CardFacts) -> list[str]:
    return [f"{led.name} {led.colour}, {led.place}: {led.shows}; {led.normal}" for led in card.leds]


def _place(blocks: list[Block]) -> tuple[list[str], int]:
    """Rows of columns, each row as high as its longest block."""
    parts: list[str] = []
    top = 52
    for start in range(0, len(blocks), _PER_ROW):
        row = blocks[start : start + _PER_ROW]
        for column, block in enumerate(row):
            parts += _block(_MARGIN + column * _COLUMN, top, block)
        top += (max(len(lines) for _, lines in row) + 3) * _ROW
    return parts, top + _MARGIN


def _block(x: int, y: int, block: Block) -> list[str]:
    head, lines = block
    height = (len(lines) + 2) * _ROW
    parts = [
        f'<rect class="box" x="{x}" y="{y}" width="{_COLUMN - 10}" height="{height}" rx="4"/>',
        f'<text class="head" x="{x + 8}" y="{y + 17}">{escape(_cut(head, 46))}</text>',
    ]
    for number, (text, colour, note) in enumerate(lines):
        line = y + 36 + number * _ROW
        style = f'fill="{colour}" xml:space="preserve"'
        parts.append(f'<text x="{x + 8}" y="{line}" {style}>{escape(_cut(text, 66))}</text>')
        if note:
            parts.append(f'<text class="note" x="{x + 120}" y="{line}">{escape(_cut(note, 52))}</text>')
    return parts


def _cut(text: str, length: int) -> str:
    return text if len(text) <= length else text[: length - 1] + "…"
