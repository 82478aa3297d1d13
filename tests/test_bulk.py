"""Decoding recorded cycles gives what unpacking each of them gives, to the last bit."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.process_data import Layout, ProcessData

IN, OUT = Direction.INPUT, Direction.OUTPUT
KINDS = ["PAD", "BITS", "STREAM", "BOOLEAN", "UNSIGNED", "SIGNED", "FLOAT", "ENCODER"]


@st.composite
def layouts(draw, max_bits=224):
    fields, used = [], 0
    for i in range(draw(st.integers(1, 10))):
        kind = draw(st.sampled_from(KINDS))
        bits = draw(st.sampled_from([32, 64])) if kind == "FLOAT" else draw(st.integers(1, 64))
        maximum = draw(st.sampled_from([1.0, 10.0, 36.3, 655.35, -7.5, 1e-300, 1e300, 0.0]))
        if used + bits <= max_bits:
            fields.append(Field(f"e{i}", FieldKind[kind], bits, IN, -1.5, maximum))
            used += bits
    return Layout(fields)


def same(one, other):
    return one == other or (math.isnan(one) and math.isnan(other))


def unpacked(data, images):
    """The slow way: one unpack per record."""
    rows = []
    for image in images:
        data.input_image[:] = image
        data.unpack()
        rows.append({f"{c}.{name}": value for c, each in data.inputs.items() for name, value in each.items()})
    return rows


@given(layouts(), layouts(), st.integers(0, 1100), st.integers(0, 2**32 - 1))
def test_decode_agrees_with_unpack(first, second, count, seed):
    data = ProcessData({0: first, 2: second}, words=7)
    images = np.random.default_rng(seed).integers(0, 2**32, (count, 3, 7), dtype=np.uint32)
    columns = data.decode(images)
    checked = [i for i in range(count) if i < 5 or i > count - 5 or 510 < i < 515]
    if any(field.kind is FieldKind.ENCODER for layout in (first, second) for field in layout.fields):
        checked = list(range(min(count, 20)))  # counters depend on every reading before
    for i, row in zip(checked, unpacked(data, images[checked]), strict=True):
        assert all(same(columns[key][i], value) for key, value in row.items())


@pytest.mark.parametrize(("kind", "bits"), [(k, b) for k in ("UNSIGNED", "SIGNED") for b in range(1, 17)])
@pytest.mark.parametrize("scale", [36.3, 10.0, 655.35, 0.1])
def test_every_raw_value_is_scaled_by_the_written_formula(kind, bits, scale):
    raw = np.arange(1 << bits, dtype=np.uint32)
    data = ProcessData({0: Layout([Field("x", FieldKind[kind], bits, IN, 0, scale)])}, words=1)
    column = data.decode(raw)["x"]
    if kind == "UNSIGNED":
        assert np.array_equal(column, raw * scale / ((1 << bits) - 1))
    else:
        assert np.array_equal(column, (raw << (32 - bits)).view(np.int32) / 2147483647 * scale)


@pytest.mark.parametrize("bits", [17, 24, 31, 32])
@pytest.mark.parametrize("scale", [36.3, 1e300, -1e300, 1e-300, 5e-324])
def test_wide_raw_values_are_scaled_by_the_written_formula(bits, scale):
    raw = np.random.default_rng(7).integers(0, 1 << bits, 20_000, dtype=np.uint32)
    data = ProcessData({0: Layout([Field("x", FieldKind.UNSIGNED, bits, IN, -1, scale)])}, words=1)
    with np.errstate(over="ignore"):
        assert np.array_equal(data.decode(raw)["x"], raw * scale / ((1 << bits) - 1))


def field_io():
    analog = [Field(f"analogin{i}", FieldKind.UNSIGNED, 8, IN, 0, 36.3, "V") for i in range(4)]
    return Layout([Field("input", FieldKind.BITS, 32, IN), *analog, Field("fault", FieldKind.BOOLEAN, 1, IN)])


def test_types_of_columns():
    data = ProcessData({0: field_io()})
    records = np.array([[0x80000001, 0xFF, 0], [5, 0, 1]], np.uint32)
    columns = data.decode(records)
    assert columns["input"].dtype == np.uint32
    assert columns["fault"].dtype == np.bool_
    assert list(columns["fault"]) == [False, True]
    assert list(columns["input"]) == [0x80000001, 5]
    assert columns["analogin0"][0] == pytest.approx(36.3)
    rounded = data.decode(records, dtype=np.float32)["analogin0"]
    assert rounded.dtype == np.float32
    assert np.array_equal(rounded, columns["analogin0"].astype(np.float32))


def test_bytes_are_little_endian_words():
    data = ProcessData({0: field_io()})
    columns = data.decode(bytes.fromhex("78563412 ff000000 01000000"))
    assert columns["input"][0] == 0x12345678
    assert columns["fault"][0]


def test_records_may_be_part_of_something_larger():
    """A column of a structured array, unaligned, decodes in place."""
    dtype = np.dtype([("stamp", "u1"), ("image", "<u4", (3,)), ("status", "<u2")])
    recording = np.zeros(700, dtype)
    recording["image"][:, 0] = np.arange(700)
    data = ProcessData({0: field_io()})
    assert np.array_equal(data.decode(recording["image"])["input"], np.arange(700))


def test_records_may_lie_register_by_register():
    data = ProcessData({0: field_io(), 1: field_io()})
    images = np.random.default_rng(3).integers(0, 2**32, (50, 2, 3), dtype=np.uint32)
    transfers = np.ascontiguousarray(images.transpose(0, 2, 1))
    one, other = data.decode(images), data.decode(transfers.transpose(0, 2, 1))
    assert one.keys() == other.keys()
    assert all(np.array_equal(one[key], other[key]) for key in one)
    assert np.array_equal(data.inputs[1].decode(images[:, 1])["input"], one["1.input"])


def test_columns_are_filled_again():
    data = ProcessData({0: field_io()})
    records = np.zeros((1000, 3), np.uint32)
    columns = data.decode(records)
    records[:, 0] = 7
    again = data.decode(records, out=columns)
    assert all(again[key] is columns[key] for key in columns)
    assert (columns["input"] == 7).all()


def test_large_output_is_whole():
    """Beyond the size of a cache the columns are written another way."""
    count = 300_001
    records = np.random.default_rng(5).integers(0, 2**32, (count, 3), dtype=np.uint32)
    data = ProcessData({0: field_io()})
    columns = data.decode(records)
    assert np.array_equal(columns["input"], records[:, 0])
    for i in range(4):
        assert np.array_equal(columns[f"analogin{i}"], (records[:, 1] >> (8 * i) & 255) * 36.3 / 255)
    assert np.array_equal(columns["fault"], records[:, 2] & 1 == 1)
    singles = data.decode(records, dtype=np.float32)
    assert np.array_equal(singles["analogin3"], columns["analogin3"].astype(np.float32))
    room = np.zeros(count + 2)  # somewhere every alignment of a double
    for start in (0, 1):
        guarded = room[start : start + count]
        assert data.decode(records, out={"analogin1": guarded})["analogin1"] is guarded
        assert np.array_equal(guarded, columns["analogin1"])
    assert room[-1] == 0


def test_counters_count_through_a_recording():
    low, high = Field("angle", FieldKind.ENCODER_L, 12, IN), Field("turns", FieldKind.ENCODER_H, 8, IN)
    data = ProcessData({0: Layout([high, low, Field("mpg", FieldKind.ENCODER, 8, IN)])})
    mpg = [0, 10, 60, 120, 130, 190, 250, 4, 0, 250]
    records = np.zeros((10, 3), np.uint32)
    records[:, 0] = [turn | 4000 << 8 | reading << 20 for turn, reading in enumerate(mpg)]
    columns = data.decode(records)
    assert list(columns["mpg"]) == [0, 10, 60, 120, 130, 190, 250, 260, 256, 250]
    assert list(columns["angle"]) == list(columns["turns"]) == [turn * 4096 + 4000 for turn in range(10)]


def test_outputs_decode_to_what_was_commanded():
    layout = Layout([Field("output", FieldKind.BITS, 16, OUT), Field("on", FieldKind.BOOLEAN, 4, OUT)])
    data = ProcessData({0: layout})
    data.outputs[0].configure("output", invert=0xFF)
    data.outputs[0].configure("on", invert=1)
    data.outputs[0].update({"output": 0x1234, "on": True})
    data.pack()
    columns = data.decode(data.output_image[np.newaxis], OUT)
    assert columns["output"][0] == 0x1234
    assert columns["on"][0]


def test_sizes_must_agree():
    data = ProcessData({0: field_io()})
    with pytest.raises(ValueError, match="whole records"):
        data.decode(bytes(13))
    with pytest.raises(ValueError, match="reshape"):
        data.decode(np.zeros((4, 2), np.uint32))
    with pytest.raises(ValueError, match="uint32"):
        data.decode(np.zeros((4, 3), np.int64))
    with pytest.raises(ValueError, match="float64 or float32"):
        data.decode(np.zeros((4, 3), np.uint32), dtype=np.int32)
    assert len(data.decode(b"")["input"]) == 0


def test_records_that_do_not_lie_as_they_must():
    data = ProcessData({0: Layout([Field("x", FieldKind.UNSIGNED, 8, IN, 0, 1)])}, words=2)
    whole = np.zeros((4, 1, 2), np.uint32)
    assert data.decode(whole)["x"].shape == (4,)
    with pytest.raises(ValueError, match=r"records of shape \(1, 3\) where \(1, 2\) is needed"):
        data.decode(np.zeros((4, 1, 3), np.uint32))
    with pytest.raises(ValueError, match="in ascending order"):
        data.decode(whole[:, :, ::-1])
    with pytest.raises(ValueError, match="records in descending order"):
        data.decode(whole[::-1])


def test_what_may_not_be_written_is_not_filled_again():
    data = ProcessData({0: field_io()})
    columns = data.decode(np.zeros((9, 3), np.uint32))
    for column in columns.values():
        column.setflags(write=False)
    again = data.decode(np.full((9, 3), 7, np.uint32), out=columns)
    assert not any(column.any() for column in columns.values())
    assert all(again[key] is not columns[key] for key in columns)
