"""What stands at an address: on the card the user names, else on cards with either register map."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import hostmot2
from hostmot2.address_map import RegisterAt, describe
from hostmot2.cli.session import Session, rows
from hostmot2.default import BOARD_VARIABLE
from hostmot2.register_map import BitField

_MAPS = {
    "PCI cards (5I25 with a 7I77)": "emu://5i25+7i77?clock=virtual",
    "Ethernet cards (7I92 with a 7I77)": "emu://7i92+7i77?clock=virtual",
}
"""Where nobody names a card: one for each generation of the register map."""


@dataclass(frozen=True)
class Meaning:
    """A register at an address, on `card`."""

    card: str
    at: RegisterAt

    @property
    def title(self) -> str:
        """Its name and what it is for."""
        register = self.at.register
        told = f": {register.description}" if register.description else ""
        return f"{self.at.name} ({register.access}) on {self.card}{told}"

    @property
    def register_name(self) -> str:
        """MODULE.REGISTER."""
        return f"{self.at.module}.{self.at.register.name}"

    def lines(self, value: int) -> list[Any]:
        """Fields, and what reading or writing does, as lines and a table."""
        register = self.at.register
        effects = {"reading": register.read_effect, "writing": register.write_effect}
        lines: list[Any] = [f"  {what} it: {effect}" for what, effect in effects.items() if effect]
        cells = [_cells(field, value) for field in register.fields]
        return [*lines, rows(("  bits", "field", "value", "meaning"), cells)] if cells else lines

    def document(self, value: int) -> dict[str, Any]:
        """As JSON takes it."""
        register = self.at.register
        return {
            "address": self.at.address,
            "value": value,
            "card": self.card,
            "register": self.at.name,
            "access": register.access,
            "description": register.description,
            "fields": {field.name: field.get(value) for field in register.fields},
        }


def _cells(field: BitField, value: int) -> tuple[str, ...]:
    bits = str(field.lsb) if field.width == 1 else f"{field.lsb + field.width - 1}:{field.lsb}"
    found = field.get(value)
    shown = str(found) if found < 10 else f"{found} (0x{found:X})"
    access = "" if field.readable and field.writable else "read" if field.readable else "write"
    return (
        f"  {bits}",
        field.name,
        shown,
        " ".join(filter(None, (access and f"[{access}]", field.description))),
    )


def meanings(session: Session, address: int) -> list[Meaning]:
    """Every register known at `address`; a card that is named is opened to ask which modules it has."""
    named = session.url or os.environ.get(BOARD_VARIABLE)
    found: dict[str, Meaning] = {}
    for card, url in ({named: named} if named else _MAPS).items():
        with hostmot2.open(url) as board:
            for at in describe(board.inventory, address):
                same = found.get(at.name)
                found[at.name] = Meaning(f"{same.card} and {card}" if same else card, at)
    return list(found.values())
