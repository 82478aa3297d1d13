"""Every kind of field at every offset and width within a channel's seven registers, with all corner values.

A plan takes many channels of one field each, so that C does thousands of placements in a call. What has to be
there is written down by the plain packer.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest
import reference_packer as reference

from hostmot2._core import ffi, lib

WORDS, WIDEST = 7, 64
ROOM = 32 * WORDS
ALL = (1 << ROOM) - 1
BATCH = 1024
"""Channels of one plan; compiling one looks at each word of each field."""
INPUT, OUTPUT = lib.HM2_FIELD_INPUT, lib.HM2_FIELD_OUTPUT
KINDS = ("BITS", "STREAM", "BOOLEAN", "UNSIGNED", "SIGNED", "FLOAT", "ENCODER", "ENCODER_H", "ENCODER_L")
COUNTERS = ("ENCODER", "ENCODER_H", "ENCODER_L")
RAW = ("BITS", "STREAM")
BACKGROUNDS = (0, ALL, int.from_bytes(bytes(range(0x35, 0x35 + 7 * ROOM // 8, 7)), "little"))
INF, NAN = math.inf, math.nan

Places = Sequence[tuple[int, int]]


def places(widths: Sequence[int] = range(1, WIDEST + 1)) -> Iterator[Places]:
    """All (offset, bits), in batches."""
    found = [(offset, bits) for bits in widths for offset in range(ROOM - bits + 1)]
    for first in range(0, len(found), BATCH):
        yield found[first : first + BATCH]


def widths_of(kind: str) -> Sequence[int]:
    return (32, 64) if kind == "FLOAT" else range(1, WIDEST + 1)


class Plan:
    """Process data on the C core itself; a field is its channel, kind, bits, offset and partner."""

    def __init__(self, fields: Sequence[tuple[int, str, int, int, int]], direction: int) -> None:
        channels = fields[-1][0] + 1
        array = ffi.new("hm2_field[]", len(fields))
        for i, (channel, kind, bits, offset, partner) in enumerate(fields):
            number = getattr(lib, f"HM2_FIELD_{kind}")
            array[i] = (channel, number, direction, partner, bits, offset, 1.0, -INF, INF, 0)
        self.image = np.zeros((channels, WORDS), np.uint32)
        self.values, self.raw = np.zeros(len(fields)), np.zeros(len(fields), np.uint64)
        words = ffi.cast("uint32_t *", self.image.ctypes.data)
        image = ffi.new("hm2_image *", (words, channels * WORDS, channels, WORDS, WORDS, 1))
        none = ffi.new("hm2_image *")
        both = (image, none) if direction == INPUT else (none, image)
        values = ffi.cast("double *", self.values.ctypes.data)
        raw = ffi.cast("uint64_t *", self.raw.ctypes.data)
        made = ffi.new("struct hm2_process_data **")
        assert lib.hm2_process_data_new(array, len(fields), *both, values, raw, made, ffi.NULL) == 0
        self.handle = ffi.gc(made[0], lib.hm2_process_data_free)

    def configure(self, index: int, scale: float, low: float = -INF, high: float = INF, inv: int = 0) -> None:
        assert lib.hm2_process_data_configure(self.handle, index, scale, low, high, inv, ffi.NULL) == 0

    def set_images(self, images: Sequence[int]) -> None:
        self.image[:] = np.frombuffer(as_bytes(images), np.uint32).reshape(self.image.shape)


def singles(kind: str, batch: Places, direction: int) -> Plan:
    return Plan([(i, kind, bits, offset, -1) for i, (offset, bits) in enumerate(batch)], direction)


def as_bytes(images: Sequence[int]) -> bytes:
    return b"".join(image.to_bytes(ROOM // 8, "little") for image in images)


def put(image: int, offset: int, bits: int, raw: int) -> int:
    """As reference.put_bits, on the image as one number."""
    mask = (1 << bits) - 1
    return image & ~(mask << offset) | raw << offset


def test_the_quick_way_to_put_bits_is_the_plain_one() -> None:
    for offset, bits in [(0, 1), (31, 2), (30, 64), (160, 64), (223, 1), (95, 33)]:
        for background in BACKGROUNDS:
            words = list(struct.unpack(f"<{WORDS}I", as_bytes([background])))
            for raw in (0, 1, (1 << bits) - 1):
                plain = reference.put_bits(words, offset, bits, raw)
                assert struct.pack(f"<{WORDS}I", *plain) == as_bytes([put(background, offset, bits, raw)])


# ---- outputs -----------------------------------------------------------------------------------------


@cache
def corner_values(kind: str, bits: int) -> tuple[float, ...]:
    """Values that lie at an edge of what fits, when full scale stands for the largest raw value."""
    if kind == "FLOAT":
        most = float(np.finfo(np.float32 if bits == 32 else np.float64).max)
        least = 1.401298464324817e-45 if bits == 32 else 5e-324
        return (0.0, -0.0, 1.0, -1.0, most, -most, least, -least, 0.1, 1e300, INF, -INF, NAN)
    top, bottom = (1 << bits) - 1, 0
    if kind == "SIGNED":
        top, bottom = (1 << bits - 1) - 1, -(1 << bits - 1)
    whole = (0, 1, -1, top, top + 1, top - 1, bottom, bottom - 1, bottom + 1, 2 * top + 2)
    return (*map(float, whole), 0.5, -0.5, 1e300, -1e300, INF, -INF, NAN)


@cache
def settings(kind: str, bits: int) -> tuple[tuple[float, float, float], ...]:
    """Scale and limits: full scale, upside down, narrower limits, none to divide by."""
    full = float((1 << bits - 1) if kind == "SIGNED" else (1 << bits) - 1)
    return (
        (full, -INF, INF),
        (-full, -INF, INF),
        (full, -1.0, 1.0),
        (full, -full / 2, full / 3),
        (10.0, -10.0, 10.0),
        (0.0, -INF, INF),
        (NAN, -INF, INF),
        (INF, -INF, INF),
    )


@cache
def expected_raw(kind: str, bits: int, setting: int, corner: int) -> int:
    scale, low, high = settings(kind, bits)[setting]
    return int(reference.write(kind, bits, corner_values(kind, bits)[corner], scale, low, high))


@pytest.mark.parametrize("kind", ["UNSIGNED", "SIGNED", "FLOAT"])
def test_a_scaled_output_lies_in_its_bits_alone_with_every_corner_value(kind: str) -> None:
    for batch in places(widths_of(kind)):
        plan = singles(kind, batch, OUTPUT)
        for setting in range(len(settings(kind, 32))):
            for i, (_, bits) in enumerate(batch):
                plan.configure(i, *settings(kind, bits)[setting])
            for corner in range(len(corner_values(kind, 32))):
                background = BACKGROUNDS[(setting + corner) % len(BACKGROUNDS)]
                plan.set_images([background] * len(batch))
                plan.values[:] = [corner_values(kind, bits)[corner] for _, bits in batch]
                lib.hm2_process_data_pack(plan.handle)
                wanted = [
                    put(background, offset, bits, expected_raw(kind, bits, setting, corner))
                    for offset, bits in batch
                ]
                check_images(plan, batch, wanted)


def check_images(plan: Plan, batch: Places, wanted: Sequence[int]) -> None:
    """Names the first place that differs."""
    there = plan.image.tobytes()
    if there == as_bytes(wanted):
        return
    size = ROOM // 8
    for i, image in enumerate(wanted):
        found = int.from_bytes(there[i * size : (i + 1) * size], "little")
        assert found == image, f"(offset, bits) {batch[i]}, {plan.values[i]}: {found:056x}, not {image:056x}"


@pytest.mark.parametrize("kind", ["BITS", "STREAM", "BOOLEAN"])
@pytest.mark.parametrize("inverted", [False, True])
def test_bits_lie_in_their_place_alone_inverted_or_not(kind: str, inverted: bool) -> None:
    for batch in places():
        plan = singles(kind, batch, OUTPUT)
        for i, (_, bits) in enumerate(batch):
            plan.configure(i, 1.0, inv=(1 << bits) - 1 if inverted else 0)
        for corner in range(len(corner_bits(1))):
            background = BACKGROUNDS[corner % len(BACKGROUNDS)]
            raws = [corner_bits(bits)[corner] for _, bits in batch]
            plan.set_images([background] * len(batch))
            plan.raw[:], plan.values[:] = raws, [float(raw != 0) for raw in raws]
            lib.hm2_process_data_pack(plan.handle)
            wanted = []
            for (offset, bits), raw in zip(batch, raws, strict=True):
                shown = raw if kind in RAW else reference.write("BOOLEAN", bits, raw != 0, 1.0, 0.0, 0.0)
                shown ^= (1 << bits) - 1 if inverted else 0
                wanted.append(put(background, offset, bits, shown))
            check_images(plan, batch, wanted)


@pytest.mark.parametrize("value", [NAN, INF, -INF, -1.0, 5e-324])
def test_a_boolean_output_is_on_for_what_is_neither_zero_nor_nothing(value: float) -> None:
    (batch,) = [batch[:BATCH] for batch in places((33,))]
    plan = singles("BOOLEAN", batch, OUTPUT)
    plan.values[:] = value
    lib.hm2_process_data_pack(plan.handle)
    shown = 0 if math.isnan(value) else (1 << 33) - 1
    check_images(plan, batch, [shown << offset for offset, _ in batch])


@pytest.mark.parametrize("kind", COUNTERS)
def test_a_counter_is_never_written(kind: str) -> None:
    for batch in places():
        plan = singles(kind, batch, OUTPUT)
        plan.set_images([BACKGROUNDS[2]] * len(batch))
        plan.values[:], plan.raw[:] = -1.0, (1 << 64) - 1
        lib.hm2_process_data_pack(plan.handle)
        check_images(plan, batch, [BACKGROUNDS[2]] * len(batch))


# ---- inputs ------------------------------------------------------------------------------------------


@cache
def corner_bits(bits: int) -> tuple[int, ...]:
    """Raw values: none, one, all, the signed ends, and what shows a bit in the wrong place."""
    full, half = (1 << bits) - 1, 1 << bits - 1
    alternate = int("10" * 32, 2)
    return (0, 1, full, half, half - 1, full - 1, half | 1, alternate & full, alternate >> 1 & full)


@cache
def float_bits(bits: int) -> tuple[int, ...]:
    """Raw values of floats: those of the corner values, and of a NaN that signals."""
    code, top = ("<f", 0x7F800001) if bits == 32 else ("<d", 0x7FF0000000000001)
    finite = [value for value in corner_values("FLOAT", bits) if bits == 64 or value != 1e300]
    return (top, *(int.from_bytes(struct.pack(code, value), "little") for value in finite[:11]))


def raws_of(kind: str, bits: int) -> tuple[int, ...]:
    return float_bits(bits) if kind == "FLOAT" else corner_bits(bits)


SCALES = (1.0, -10.0, 36.3, 0.0, 1e300, INF, NAN)


@cache
def expected_value(kind: str, bits: int, corner: int, scale: float) -> float:
    return float(reference.read(kind, bits, raws_of(kind, bits)[corner], scale))


@pytest.mark.parametrize("kind", ["BITS", "STREAM", "BOOLEAN", "UNSIGNED", "SIGNED", "FLOAT"])
def test_an_input_is_what_lies_in_its_bits_with_every_corner_value(kind: str) -> None:
    scales = SCALES if kind in ("UNSIGNED", "SIGNED") else (1.0,)
    for batch in places(widths_of(kind)):
        plan = singles(kind, batch, INPUT)
        for scale in scales:
            for i in range(len(batch)):
                plan.configure(i, scale)
            for corner in range(len(raws_of(kind, 32))):
                background = BACKGROUNDS[corner % len(BACKGROUNDS)]
                raws = [raws_of(kind, bits)[corner] for _, bits in batch]
                plan.set_images(
                    [put(background, *place, raw) for place, raw in zip(batch, raws, strict=True)]
                )
                lib.hm2_process_data_unpack(plan.handle)
                assert plan.raw.tolist() == raws
                if kind in RAW:
                    continue
                wanted = np.array([expected_value(kind, bits, corner, scale) for _, bits in batch])
                same = (plan.values == wanted) | (np.isnan(plan.values) & np.isnan(wanted))
                wrong = np.flatnonzero(~same)
                assert not wrong.size, (batch[wrong[0]], scale, plan.values[wrong[0]], wanted[wrong[0]])


@cache
def readings(bits: int) -> tuple[int, ...]:
    """A counter's way: small steps over both ends, the longest steps either way, and its corners."""
    full, half = (1 << bits) - 1, 1 << bits - 1
    steps = (0, 1, -1, -1, 1, half - 1, half - 1, 1, -half, -half, half - 1, -1, 1, -half, half - 1)
    place, way = 0, []
    for step in steps:
        place = (place + step) & full
        way.append(place)
    return tuple(way)


@cache
def counts(bits: int) -> tuple[int, ...]:
    return tuple(reference.count(readings(bits), bits))


@pytest.mark.parametrize("kind", COUNTERS)
@pytest.mark.parametrize("scale", [1.0, -4000.0])
def test_a_counter_follows_every_movement_at_every_place(kind: str, scale: float) -> None:
    for batch in places():
        plan = singles(kind, batch, INPUT)
        for i in range(len(batch)):
            plan.configure(i, scale)
        for step in range(len(readings(8))):
            background = BACKGROUNDS[step % len(BACKGROUNDS)]
            plan.set_images([put(background, o, bits, readings(bits)[step]) for o, bits in batch])
            lib.hm2_process_data_unpack(plan.handle)
            wanted = [counts(bits)[step] for _, bits in batch]
            assert plan.raw.view(np.int64).tolist() == wanted
            assert plan.values.tolist() == [float(count) / scale for count in wanted]


def halves(batch: Places, low_first: bool) -> list[tuple[int, str, int, int, int]]:
    """A counter in two parts at each place, one part right above the other."""
    fields = []
    for channel, (offset, bits) in enumerate(batch):
        low = bits // 2
        at = (offset, offset + low) if low_first else (offset + bits - low, offset)
        fields.append((channel, "ENCODER_L", low, at[0], 2 * channel + 1))
        fields.append((channel, "ENCODER_H", bits - low, at[1], 2 * channel))
    return fields


@pytest.mark.parametrize("low_first", [True, False])
def test_a_counter_in_two_parts_is_one_counter(low_first: bool) -> None:
    for batch in places(range(2, WIDEST + 1)):
        fields: Any = halves(batch, low_first)
        plan = Plan(fields, INPUT)
        for step in range(len(readings(8))):
            background = BACKGROUNDS[step % len(BACKGROUNDS)]
            images = []
            for i, (_, bits) in enumerate(batch):
                reading, (_, _, low, low_at, _), (_, _, high, high_at, _) = (
                    readings(bits)[step],
                    *fields[2 * i : 2 * i + 2],
                )
                image = put(background, low_at, low, reading & (1 << low) - 1)
                images.append(put(image, high_at, high, reading >> low))
            plan.set_images(images)
            lib.hm2_process_data_unpack(plan.handle)
            wanted = [counts(bits)[step] for _, bits in batch for _ in range(2)]
            assert plan.raw.view(np.int64).tolist() == wanted


def test_every_kind_that_has_a_value_is_tried() -> None:
    names = {name.removeprefix("HM2_FIELD_") for name in dir(lib) if name.startswith("HM2_FIELD_")}
    assert set(KINDS) | {"PAD", "INPUT", "OUTPUT"} == names
    assert sum(len(batch) for batch in places()) == sum(ROOM - bits + 1 for bits in range(1, WIDEST + 1))
