"""One parameter of every kind in a memory of bytes: its bits, its limits, and what is refused unwritten."""

from __future__ import annotations

import math
import struct
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from hostmot2 import lbp
from hostmot2.fields import Direction, Field, FieldKind, ParameterField
from hostmot2.remotes.errors import VerifyFailed
from hostmot2.remotes.parameters import Parameters
from wire.lines import connect, emulated

AT = 0x40
BOTH = Direction.BIDIRECTIONAL


class Memory:
    """RAM and EEPROM of 256 bytes; writes are counted."""

    label = "remote under test"

    def __init__(self) -> None:
        self.spaces = {space: bytearray(256) for space in (0, 1)}
        self.writes = 0
        self.keeps = True

    def read_remote(self, address: int, size: int = 1, *, space: int = 0) -> int:
        return int.from_bytes(self.spaces[space][address : address + size], "little")

    def write_remote(self, address: int, value: int, size: int = 1, *, space: int = 0) -> None:
        self.writes += 1
        if self.keeps:
            self.spaces[space][address : address + size] = value.to_bytes(size, "little")


def one(kind: FieldKind, bits: int, low: float = 0.0, high: float = 0.0) -> tuple[Memory, Parameters]:
    memory = Memory()
    return memory, Parameters(
        memory, [Field("Gain", kind, bits, Direction.BIDIRECTIONAL, low, high, "V", AT)]
    )


@pytest.mark.parametrize(
    ("kind", "bits", "name", "value", "raw"),
    [
        (FieldKind.FLOAT, 32, "FLOAT", -2.5, struct.pack("<f", -2.5)),
        (FieldKind.NONVOL_FLOAT, 64, "FLOAT64", 1e300, struct.pack("<d", 1e300)),
        (FieldKind.NONVOL_SIGNED, 16, "INT", -2, b"\xfe\xff"),
        (FieldKind.SIGNED, 24, "BITS24", -1, b"\xff\xff\xff"),
        (FieldKind.UNSIGNED, 32, "ULONG", 0x12345678, b"\x78\x56\x34\x12"),
        (FieldKind.BITS, 16, "FLAG", 0x8001, b"\x01\x80"),
    ],
)
def test_a_value_is_these_bytes(kind: FieldKind, bits: int, name: str, value: float, raw: bytes) -> None:
    memory, parameters = one(kind, bits)
    parameter = parameters.parameter("gain")
    parameters["GAIN"] = value
    assert memory.spaces[int(parameter.nonvolatile)][AT : AT + len(raw)] == raw
    assert parameters["Gain"] == value
    assert parameter.type_name == name
    text = parameter.format(value, hexadecimal=True)
    assert text == raw[::-1].hex().upper()
    assert parameter.parse(text, hexadecimal=True) == value


@pytest.mark.parametrize(("value", "word"), [(True, 0xFFFF), (1, 0xFFFF), (0, 0), (0xFFFF, 0xFFFF)])
def test_true_is_all_bits(value: int, word: int) -> None:
    memory, parameters = one(FieldKind.BOOLEAN, 16)
    parameters["Gain"] = value
    assert memory.read_remote(AT, 2) == word


@pytest.mark.parametrize(
    ("kind", "bits", "limits", "value", "error"),
    [
        (FieldKind.FLOAT, 32, (0, 0), math.nan, ValueError),
        (FieldKind.FLOAT, 32, (0, 0), math.inf, ValueError),
        (FieldKind.FLOAT, 32, (0, 0), 3.5e38, ValueError),
        (FieldKind.FLOAT, 64, (0, 0), -math.inf, ValueError),
        (FieldKind.NONVOL_FLOAT, 32, (-1, 1), 1.5, ValueError),
        (FieldKind.NONVOL_FLOAT, 32, (-1, 1), math.nan, ValueError),
        (FieldKind.NONVOL_UNSIGNED, 16, (5, 100), 4, ValueError),
        (FieldKind.NONVOL_UNSIGNED, 16, (5, 100), 101, ValueError),
        (FieldKind.SIGNED, 8, (0, 0), 128, ValueError),
        (FieldKind.SIGNED, 8, (0, 0), -129, ValueError),
        (FieldKind.UNSIGNED, 8, (0, 0), -1, ValueError),
        (FieldKind.UNSIGNED, 8, (0, 0), 1.5, TypeError),
        (FieldKind.UNSIGNED, 8, (0, 0), math.nan, TypeError),
        (FieldKind.BOOLEAN, 8, (0, 0), 256, ValueError),
        (FieldKind.NONVOL_UNSIGNED, 16, (0, 0), np.float32(1.5), TypeError),
        (FieldKind.BITS, 24, (0, 0), Fraction(3, 2), TypeError),
        (FieldKind.UNSIGNED, 8, (0, 0), np.float16(math.inf), TypeError),
        (FieldKind.FLOAT, 32, (0, 0), np.float16(math.inf), ValueError),
    ],
)
def test_what_it_cannot_hold_or_may_not_be_is_refused_unwritten(
    kind: FieldKind, bits: int, limits: tuple[float, float], value: float, error: type[Exception]
) -> None:
    memory, parameters = one(kind, bits, *limits)
    with pytest.raises(error, match=f"Gain.*{float(value):.4g}".replace("+", r"\+")):
        parameters["Gain"] = value
    assert memory.writes == 0


@pytest.mark.parametrize("value", [np.uint8(3), np.int64(3), np.float32(3), np.float16(3), Fraction(3)])
def test_numbers_of_every_type_are_taken(value: Any) -> None:
    for kind in (FieldKind.NONVOL_UNSIGNED, FieldKind.FLOAT):
        memory, parameters = one(kind, 32)
        parameters["Gain"] = value
        assert (parameters["Gain"], memory.writes) == (3, 1)


@pytest.mark.parametrize(
    ("kind", "text", "options", "said"),
    [
        (FieldKind.FLOAT, "fast", {}, "Gain takes numbers, not 'fast'"),
        (FieldKind.FLOAT, "nan", {}, "Gain: nan is outside"),
        (FieldKind.FLOAT, "7F800000", {"hexadecimal": True}, "Gain: inf is outside"),
        (FieldKind.UNSIGNED, "1.5", {}, "Gain takes whole numbers, not '1.5'"),
        (FieldKind.UNSIGNED, "100000000", {"hexadecimal": True}, "has 32 bits, 100000000 does not fit"),
        (FieldKind.SIGNED, "0x80000000", {}, "Gain: 2147483648 is outside"),
    ],
)
def test_what_a_person_mistypes_is_named(kind: FieldKind, text: str, options: Any, said: str) -> None:
    _, parameters = one(kind, 32)
    with pytest.raises(ValueError, match=said):
        parameters.parameter("Gain").parse(text, **options)


@pytest.mark.parametrize(
    ("kind", "limits", "value", "scaled"),
    [
        (FieldKind.SIGNED, (-10, 10), -127, -10.0),
        (FieldKind.UNSIGNED, (-10, 10), 0, -10.0),
        (FieldKind.UNSIGNED, (-10, 10), 255, 10.0),
        (FieldKind.UNSIGNED, (0, 0), 7, 7.0),
        (FieldKind.NONVOL_UNSIGNED, (0, 10), 7, 7.0),
    ],
)
def test_the_value_in_its_unit(
    kind: FieldKind, limits: tuple[float, float], value: int, scaled: float
) -> None:
    memory, parameters = one(kind, 8, *limits)
    memory.spaces[int(kind is FieldKind.NONVOL_UNSIGNED)][AT] = value & 0xFF
    assert parameters.parameter("Gain").scaled == pytest.approx(scaled)


@pytest.mark.parametrize(("reads", "cleared"), [(3, True), (10_000, False)])
def test_a_command_that_clears_itself_is_waited_for(
    monkeypatch: pytest.MonkeyPatch, reads: int, cleared: bool
) -> None:
    memory = Memory()
    field = ParameterField("Go", FieldKind.BITS, 8, BOTH, 0, 255, "", AT, clears_itself=True)
    left = reads
    real = memory.read_remote

    def read(address: int, size: int = 1, *, space: int = 0) -> int:
        nonlocal left
        left -= 1
        return real(address, size, space=space) if left > 0 else 0

    monkeypatch.setattr(memory, "read_remote", read)
    parameters = Parameters(memory, [field])
    if cleared:
        parameters["Go"] = 1
        assert left == 0
    else:
        with pytest.raises(VerifyFailed) as caught:
            parameters["Go"] = 1
        assert (caught.value.expected, caught.value.received) == (0, 1)


def test_a_value_that_is_not_kept_is_an_error() -> None:
    memory, parameters = one(FieldKind.FLOAT, 32)
    memory.keeps = False
    with pytest.raises(VerifyFailed, match=r"Gain was written as 2\.5, reads 0\.0"):
        parameters["Gain"] = 2.5


def test_they_print_names_places_and_units() -> None:
    _, parameters = one(FieldKind.UNSIGNED, 16)
    assert repr(parameters) == "<Parameters of remote under test: Gain>"
    assert repr(Parameters(Memory(), [])) == "<Parameters of remote under test: none>"
    assert repr(parameters.parameter("Gain")) == "<Parameter Gain unsigned 16 bits at 0x0040 V>"


def test_a_servo_drives_scale_takes_any_number_but_none_that_is_none() -> None:
    drive = emulated("stmbl")
    parameters = lbp.parameters(connect(drive))
    parameters["scale"] = -0.25
    drive.clear_writes()
    for wrong in (math.nan, math.inf, 1e39):
        with pytest.raises(ValueError, match="scale"):
            parameters["scale"] = wrong
    assert (drive.write_count, parameters["scale"]) == (0, -0.25)
