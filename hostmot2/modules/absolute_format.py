"""What the bits of an absolute encoder mean: a format string, and the values in a reading."""

from __future__ import annotations

import re
from dataclasses import dataclass

_FIELD = re.compile(r"(?P<name>[A-Za-z_][\w-]*)?%(?P<bits>\d+)(?P<kind>[pbusfehl])(?P<modifiers>[gm]*)")


@dataclass(frozen=True, slots=True)
class AbsoluteField:
    """A run of bits. `shift` counts from the last bit sent.

    kind: p padding, b true or false, u unsigned, s signed, f bit field, e encoder, h and l its upper and
    lower part. gray: in Gray code. multi_turn: the position counts whole turns, too.
    """

    name: str
    bits: int
    kind: str
    shift: int
    gray: bool = False
    multi_turn: bool = False

    def value(self, data: int) -> int | bool:
        """What the reading says of this field."""
        raw = data >> self.shift & (1 << self.bits) - 1
        if self.gray:
            for step in (1, 2, 4, 8, 16, 32):
                raw ^= raw >> step
        if self.kind == "b":
            return raw != 0
        if self.kind == "s" and raw >> self.bits - 1:
            return raw - (1 << self.bits)
        return raw


def parse_format(text: str, limit: int) -> tuple[AbsoluteField, ...]:
    """The fields of a format string, in the order in which the encoder sends them.

    Each is `name%<bits><kind><modifiers>`, padding needs no name: "%4pposition%24eg" is four bits of nothing,
    then 24 bits of position in Gray code. limit: the most bits a reading can have. Raises ValueError.
    """
    matches = list(_FIELD.finditer(text))
    if not matches or "".join(match[0] for match in matches) != text:
        raise ValueError(f"not an encoder format: {text!r}")
    left = total = sum(int(match["bits"]) for match in matches)
    if not 0 < total <= limit:
        raise ValueError(f"{text!r} has {total} bits, there are 1 to {limit}")
    fields = []
    for match in matches:
        bits = int(match["bits"])
        if not bits or (match["kind"] != "p" and not match["name"]):
            raise ValueError(f"{match[0]!r} in {text!r} has no {'name' if bits else 'bits'}")
        left -= bits
        modifiers = match["modifiers"]
        fields.append(
            AbsoluteField(match["name"] or "", bits, match["kind"], left, "g" in modifiers, "m" in modifiers)
        )
    _check_parts(text, fields)
    return tuple(fields)


def _check_parts(text: str, fields: list[AbsoluteField]) -> None:
    names = [field.name for field in fields if field.name]
    if len(set(names)) != len(names):
        raise ValueError(f"a name is used twice in {text!r}")
    kinds = [field.kind for field in fields]
    if kinds.count("e") + kinds.count("l") > 1 or kinds.count("h") != kinds.count("l"):
        raise ValueError(f"{text!r} must have one position at most: one e, or one h and one l")
    parts = [field for field in fields if field.kind in "hl"]
    if len({field.gray for field in parts}) > 1:
        raise ValueError(f"both parts of the position in {text!r} must be in Gray code, or none")
