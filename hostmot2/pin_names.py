"""What a secondary pin number means, by module, from the register description."""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import IntEnum

from hostmot2 import registers
from hostmot2.registers import Gtag

_PINS: Mapping[int, type[IntEnum]] = {
    **registers.PINS,
    Gtag.MUXED_ENCODER: registers.EncoderPin,
    Gtag.MUXED_ENCODER_MIM_SELECT: registers.MuxedEncoderSelectPin,
    Gtag.DBSPI: registers.BspiPin,
    Gtag.SSERIAL_B: registers.SserialPin,
}
"""What the description has, and modules whose pins are another's."""


def pin_function(gtag: int, code: int) -> str:
    """The function's name in its module, such as "step" or "tx 2"; "" for none, "pin 0x9F" if unknown."""
    if not gtag:
        return ""
    names = {int(member): member.name.lower() for member in _PINS.get(gtag, ())}
    if code in names:
        # _a marks numbers of register generation A that generation B has elsewhere
        return re.sub(r"_(\d+)$", r" \1", names[code]).removesuffix("_a")
    return _of_a_series(names, code) or f"pin 0x{code:02X}"


def _of_a_series(names: Mapping[int, str], code: int) -> str:
    """Members called x_0 without an x_1 stand for as many as fit before the next member."""
    below = [base for base in names if base < code]
    if not below:
        return ""
    base = max(below)
    name, is_first, _ = names[base].rpartition("_0")
    if not is_first or base & 0x80 != code & 0x80 or f"{name}_1" in names.values():
        return ""
    return f"{name} {code - base}"
