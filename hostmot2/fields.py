"""How one element of process data, or one parameter of a remote, is declared.

Declarations only: discovery fills them from a remote's tables, the emulator's catalogue writes them down,
`process_data` computes with them. Source: SSLBP process data descriptors (sserial.md 5.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class FieldKind(IntEnum):
    """The data type byte of a process data descriptor."""

    PAD = 0x00  # takes room, carries nothing
    BITS = 0x01  # independent bits
    UNSIGNED = 0x02  # 0 .. 2^n - 1 stands for 0 .. maximum
    SIGNED = 0x03  # two's complement, symmetric about 0, full scale stands for maximum
    NONVOL_UNSIGNED = 0x04  # parameters only
    NONVOL_SIGNED = 0x05  # parameters only
    STREAM = 0x06  # raw bits
    BOOLEAN = 0x07  # any width: not zero is true, written as all ones
    ENCODER = 0x08  # a counter that wraps
    FLOAT = 0x10  # IEEE 754, 32 or 64 bits
    NONVOL_FLOAT = 0x11  # parameters only
    ENCODER_H = 0x18  # upper part of a counter (turns)
    ENCODER_L = 0x28  # lower part of a counter (fraction of a turn)


class Direction(IntEnum):
    """The direction byte of a process data descriptor, seen from the host."""

    INPUT = 0x00  # remote to host
    BIDIRECTIONAL = 0x40  # takes room in both directions
    OUTPUT = 0x80  # host to remote


@dataclass(frozen=True, slots=True)
class Field:
    """One process data descriptor as the remote states it; nothing is checked or corrected here.

    `minimum` and `maximum` are in `unit`; equal limits mean the remote states none. `address` is where the
    element lies in the remote's memory (0: unknown).
    """

    name: str
    kind: FieldKind
    bits: int
    direction: Direction
    minimum: float = 0.0
    maximum: float = 1.0
    unit: str = ""
    address: int = 0


@dataclass(frozen=True, slots=True)
class ParameterField(Field):
    """A parameter of which more is known than a remote's own tables would say.

    minimum and maximum are limits of the value itself, not of what it stands for. `scale`: what one count is
    in `unit` (0.0: nothing). `default`: as it leaves the factory. `derived`: the address was derived from the
    order of the remote's variables and not confirmed independently. `working`: the parameter in RAM that
    takes a non-volatile one over at power-up. `clears_itself`: a write starts something, 0 says that it is
    done.
    """

    scale: float = 0.0
    default: int | None = None
    derived: bool = False
    working: str = ""
    clears_itself: bool = False
