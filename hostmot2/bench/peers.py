"""The same messages done with other packages, each as its users would write it for speed.

In: 32 bits, five 8-bit voltages of 36.3 V full scale, two SIGNED of 12 bits and 10 V: 12 bytes.
Out: 16 bits, six SIGNED of 13 bits and 10 V, two enables: 12 bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.layout import Layout

_IN, _OUT = Direction.INPUT, Direction.OUTPUT

LAYOUT = Layout(
    [Field("input", FieldKind.BITS, 32, _IN)]
    + [Field(f"analogin{i}", FieldKind.UNSIGNED, 8, _IN, 0, 36.3, "V") for i in range(4)]
    + [Field("fieldvoltage", FieldKind.UNSIGNED, 8, _IN, 0, 36.3, "V")]
    + [Field(f"feedback{i}", FieldKind.SIGNED, 12, _IN, -10, 10, "V") for i in range(2)]
    + [Field("output", FieldKind.BITS, 16, _OUT)]
    + [Field(f"analogout{i}", FieldKind.SIGNED, 13, _OUT, -10, 10, "V") for i in range(6)]
    + [Field(name, FieldKind.BOOLEAN, 1, _OUT) for name in ("analogena", "spinena")]
)
INPUTS = [element.name for element in LAYOUT.elements if element.direction is _IN]
VALUES_OUT = (0x5AA5, 1.0, -2.0, 3.25, -4.5, 5.0, -10.0, 1, 0)

_VOLT = 36.3 / 255
_SIGNED_12 = 10.0 * 2**20 / 2147483647
_FULL = 2147483647.0

_DBC = """VERSION ""
BU_: X
BO_ 1 IN: 12 X
 SG_ input : 0|32@1+ (1,0) [0|0] "" X
 SG_ analogin0 : 32|8@1+ (0.1423529411764706,0) [0|0] "V" X
 SG_ analogin1 : 40|8@1+ (0.1423529411764706,0) [0|0] "V" X
 SG_ analogin2 : 48|8@1+ (0.1423529411764706,0) [0|0] "V" X
 SG_ analogin3 : 56|8@1+ (0.1423529411764706,0) [0|0] "V" X
 SG_ fieldvoltage : 64|8@1+ (0.1423529411764706,0) [0|0] "V" X
 SG_ feedback0 : 72|12@1- (0.0048828125022737368,0) [0|0] "V" X
 SG_ feedback1 : 84|12@1- (0.0048828125022737368,0) [0|0] "V" X
BO_ 2 OUT: 12 X
 SG_ output : 0|16@1+ (1,0) [0|0] "" X
 SG_ analogout0 : 16|13@1- (0.00244140625113687,0) [0|0] "V" X
 SG_ analogout1 : 29|13@1- (0.00244140625113687,0) [0|0] "V" X
 SG_ analogout2 : 42|13@1- (0.00244140625113687,0) [0|0] "V" X
 SG_ analogout3 : 55|13@1- (0.00244140625113687,0) [0|0] "V" X
 SG_ analogout4 : 68|13@1- (0.00244140625113687,0) [0|0] "V" X
 SG_ analogout5 : 81|13@1- (0.00244140625113687,0) [0|0] "V" X
 SG_ analogena : 94|1@1+ (1,0) [0|0] "" X
 SG_ spinena : 95|1@1+ (1,0) [0|0] "" X
"""

Unpack = Callable[[bytes], Any]
Pack = Callable[..., Any]


def installed(name: str) -> bool:
    """Whether a peer can be imported."""
    try:
        import_module(name)
    except ImportError:
        return False
    return True


def bit_packers() -> dict[str, tuple[Unpack, Pack, Unpack]]:
    """name: (unpack with scaling, pack with scaling, unpack to plain integers), of those installed.

    These packages count bits from the most significant; register words from the least. Reversing the
    bytes and the order of the fields turns one into the other.
    """
    found = {}
    for name in ("cbitstruct", "bitstruct.c", "bitstruct"):
        if not installed(name):
            continue
        compiler = import_module(name)
        unpacker = compiler.compile("s12s12u8u8u8u8u8u32")
        packer = compiler.compile("u1u1s13s13s13s13s13s13u16")
        scaled, integers = _unpack_with(unpacker.unpack), _integers_with(unpacker.unpack)
        found[name] = (scaled, _pack_with(packer.pack), integers)
    return found


def _integers_with(unpack: Any) -> Unpack:
    return lambda message: unpack(message[::-1])


def _unpack_with(unpack: Any) -> Unpack:
    def call(message: bytes) -> tuple[float, ...]:
        f1, f0, volts, a3, a2, a1, a0, bits = unpack(message[::-1])
        return (
            bits,
            a0 * _VOLT,
            a1 * _VOLT,
            a2 * _VOLT,
            a3 * _VOLT,
            volts * _VOLT,
            f0 * _SIGNED_12,
            f1 * _SIGNED_12,
        )

    return call


def _pack_with(pack: Any) -> Pack:
    # No clamping here, which ours does: the peer gets the benefit.
    def call(
        bits: int, a0: float, a1: float, a2: float, a3: float, a4: float, a5: float, e: int, s: int
    ) -> Any:
        return pack(
            s,
            e,
            int(a5 / 10.0 * _FULL) >> 19,
            int(a4 / 10.0 * _FULL) >> 19,
            int(a3 / 10.0 * _FULL) >> 19,
            int(a2 / 10.0 * _FULL) >> 19,
            int(a1 / 10.0 * _FULL) >> 19,
            int(a0 / 10.0 * _FULL) >> 19,
            bits,
        )[::-1]

    return call


def by_hand(message: bytes) -> tuple[float, ...]:
    """int.from_bytes, shifts and masks."""
    image = int.from_bytes(message, "little")
    f0, f1 = image >> 72 & 0xFFF, image >> 84 & 0xFFF
    return (
        image & 0xFFFFFFFF,
        (image >> 32 & 0xFF) * _VOLT,
        (image >> 40 & 0xFF) * _VOLT,
        (image >> 48 & 0xFF) * _VOLT,
        (image >> 56 & 0xFF) * _VOLT,
        (image >> 64 & 0xFF) * _VOLT,
        (f0 - ((f0 & 0x800) << 1)) * _SIGNED_12,
        (f1 - ((f1 & 0x800) << 1)) * _SIGNED_12,
    )


def cantools_messages() -> tuple[Any, Any] | None:
    """The same two messages as a CAN database; None without cantools."""
    if not installed("cantools"):
        return None
    database = import_module("cantools").database.load_string(_DBC, "dbc", strict=False)
    return database.get_message_by_name("IN"), database.get_message_by_name("OUT")


def numpy_columns(records: npt.NDArray[np.uint8]) -> list[npt.NDArray[Any]]:
    """Bulk decode written by hand for this very message, [record, byte]."""
    low, middle, high = (records[:, 9 + i].astype(np.int16) for i in range(3))
    feedback0 = (low | middle << 8) << 4 >> 4
    feedback1 = (middle | high << 8).astype(np.int16) >> 4
    return [
        records[:, :4].copy().view("<u4")[:, 0],
        *(records[:, 4 + i] * _VOLT for i in range(5)),
        feedback0 * _SIGNED_12,
        feedback1 * _SIGNED_12,
    ]
