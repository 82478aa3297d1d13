"""Packing, scaling, clamping and counting, against the tables of sserial.md 6 and a plain packer."""

import math
import struct

import numpy as np
import pytest
import reference_packer as reference
from hypothesis import given
from hypothesis import strategies as st

from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.process_data import Bits, Layout, ProcessData

IN, OUT, BOTH = Direction.INPUT, Direction.OUTPUT, Direction.BIDIRECTIONAL
FORMULA_KINDS = ("BOOLEAN", "UNSIGNED", "SIGNED", "FLOAT")


def single(kind, bits, direction, minimum=0.0, maximum=1.0, words=3):
    layout = Layout([Field("x", FieldKind[kind], bits, direction, minimum, maximum)])
    return ProcessData({0: layout}, words=words)


def written(data, value):
    data.outputs[0]["x"] = value
    data.pack()
    return reference.get_bits([int(w) for w in data.output_image[0]], 0, data.outputs[0].field("x").bits)


def read(data, raw):
    bits = data.inputs[0].field("x").bits
    data.input_image[0] = reference.put_bits([0] * data.input_image.shape[1], 0, bits, raw)
    data.unpack()
    return data.inputs[0]["x"]


# ---- the tables of sserial.md 6 ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "raw"),
    [
        (10, 0x0FFF),
        (5, 0x07FF),
        (2.5, 0x03FF),
        (1, 0x0199),
        (0.0025, 0x0001),
        (0.001, 0x0000),
        (0, 0x0000),
        (-0.001, 0x1FFF),
        (-0.0025, 0x1FFE),
        (-1, 0x1E66),
        (-5, 0x1800),
        (-10, 0x1000),
        (12, 0x0FFF),
        (-12, 0x1000),
    ],
)
def test_signed_13_bits_of_10_volts(value, raw):
    assert written(single("SIGNED", 13, OUT, -10, 10), value) == raw


@pytest.mark.parametrize(("raw", "value"), [(0x0FFF, 9.99756), (0x1000, -10.0), (0x0199, 0.998535)])
def test_signed_13_bits_read_back(raw, value):
    assert read(single("SIGNED", 13, IN, -10, 10), raw) == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize(("value", "raw"), [(7.5, 0x7FFF), (1, 0x1111), (0, 0), (-1, 0xEEEE), (-7.5, 0x8000)])
def test_8i20_current(value, raw):
    assert written(single("SIGNED", 16, OUT, -7.5, 7.5), value) == raw


@pytest.mark.parametrize(("value", "raw"), [(0.25, 0x3FFF), (0.5, 0x7FFF), (0.75, 0xBFFF), (1, 0xFFFF)])
def test_8i20_angle(value, raw):
    assert written(single("UNSIGNED", 16, OUT), value) == raw


@pytest.mark.parametrize(
    ("value", "raw"), [(12.5, 0x1FFF), (50, 0x7FFF), (99.99, 0xFFF8), (100, 0xFFFF), (-3, 0), (250, 0xFFFF)]
)
def test_unsigned_16_bits_of_100(value, raw):
    assert written(single("UNSIGNED", 16, OUT, 0, 100), value) == raw


@pytest.mark.parametrize(
    ("raw", "value"), [(0x01, 0.14235), (0x80, 18.2212), (0xA4, 23.3459), (0xFF, 36.3), (0x00, 0.0)]
)
def test_unsigned_8_bits_of_36_3_volts(raw, value):
    assert read(single("UNSIGNED", 8, IN, 0, 36.3), raw) == pytest.approx(value, rel=3e-5)


def test_unsigned_16_bits_of_36_3_volts():
    assert read(single("UNSIGNED", 16, IN, 0, 36.3), 0xA4C0) == pytest.approx(23.3614, abs=5e-5)


def analog_7i77():
    volts = [Field(f"analogout{i}", FieldKind.SIGNED, 13, OUT, -10, 10, "V") for i in range(6)]
    enables = [Field(name, FieldKind.BITS, 1, OUT) for name in ("analogena", "spinena")]
    return Layout(volts + enables)


@pytest.mark.parametrize(
    ("volts", "analogena", "spinena", "words"),
    [
        ((1, 2, 3, 4, 5, -10), 1, 0, (0x30666199, 0x7FF33313, 0x00006000)),
        ((10, -10, 0, 5, -5, 2.5), 1, 1, (0x02000FFF, 0x8003FF80, 0x0000C7FF)),
    ],
)
def test_7i77_analog_registers(volts, analogena, spinena, words):
    data = ProcessData({1: analog_7i77()})
    data.outputs[1].update({f"analogout{i}": v for i, v in enumerate(volts)})
    data.outputs[1]["analogena"] = analogena
    data.outputs[1]["spinena"] = spinena
    data.pack()
    assert tuple(data.output_image[1]) == words


def test_encoder_counts_through_its_wrap():
    data = single("ENCODER", 8, IN)
    readings = [0, 10, 60, 120, 130, 190, 250, 4, 0, 250]
    assert [read(data, raw) for raw in readings] == [0, 10, 60, 120, 130, 190, 250, 260, 256, 250]


def test_encoder_may_move_half_its_range_in_a_cycle():
    data = single("ENCODER", 8, IN)
    assert [read(data, raw) for raw in (100, 227, 98, 99)] == [100, 227, 354, 355]


# ---- rules at the edges ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["SIGNED", "UNSIGNED"])
@pytest.mark.parametrize("bits", [1, 8, 13, 31, 32, 33, 64])
@pytest.mark.parametrize("scale", [0.0, -0.0, math.nan])
def test_without_a_scale_an_output_rests(kind, bits, scale):
    data = single(kind, bits, OUT, -10, 10)
    data.outputs[0].configure("x", scale=scale)
    assert written(data, 5.0) == 0


@pytest.mark.parametrize("kind", ["SIGNED", "UNSIGNED", "BOOLEAN"])
@pytest.mark.parametrize("bits", [1, 13, 32, 64])
def test_not_a_number_rests(kind, bits):
    assert written(single(kind, bits, OUT, -10, 10), math.nan) == 0


def test_a_float_carries_nan_and_infinity():
    data = single("FLOAT", 32, OUT, 0, 0)
    assert written(data, math.inf) == 0x7F800000
    assert written(data, -math.inf) == 0xFF800000
    assert written(data, math.nan) & 0x7FC00000 == 0x7FC00000


def test_a_float_without_stated_limits_is_not_clamped():
    assert written(single("FLOAT", 32, OUT, 0, 0), -1e9) == struct.unpack("<I", struct.pack("<f", -1e9))[0]


def test_a_float_keeps_to_its_stated_limits():
    assert written(single("FLOAT", 32, OUT, -2, 2), 5.0) == 0x40000000


@pytest.mark.parametrize(("value", "raw"), [(10, 0x0FFF), (-10, 0x1000)])
def test_limits_beyond_full_scale_saturate(value, raw):
    data = single("SIGNED", 13, OUT, -10, 10)
    data.outputs[0].configure("x", scale=5.0)
    assert written(data, value) == raw


def test_unsigned_beyond_full_scale_saturates():
    data = single("UNSIGNED", 16, OUT, 0, 10)
    data.outputs[0].configure("x", scale=5.0, low=-10)
    assert written(data, 10) == 0xFFFF
    assert written(data, -10) == 0


@pytest.mark.parametrize("bits", [1, 2, 31, 32, 33, 53, 54, 63, 64])
def test_full_scale_is_the_largest_raw_value_at_every_width(bits):
    assert written(single("UNSIGNED", bits, OUT, 0, 10), 10) == (1 << bits) - 1
    assert written(single("SIGNED", bits, OUT, -10, 10), 10) == (1 << bits - 1) - 1
    data = single("SIGNED", bits, OUT, -20, 20)
    data.outputs[0].configure("x", scale=10.0)
    assert written(data, 20) == (1 << bits - 1) - 1
    assert written(data, -20) == 1 << bits - 1


def test_limits_come_before_scaling():
    data = single("SIGNED", 13, OUT, -10, 10)
    data.outputs[0].configure("x", low=-2.5, high=2.5)
    assert written(data, 10) == 0x03FF
    assert data.outputs[0]["x"] == 10  # what was commanded stays visible


@pytest.mark.parametrize("bits", [1, 3, 32, 64])
def test_boolean_is_written_as_all_ones_and_read_as_any(bits):
    data = single("BOOLEAN", bits, BOTH)
    assert written(data, True) == (1 << bits) - 1
    assert written(data, False) == 0
    assert read(data, 1 << (bits - 1)) is True
    assert read(data, 0) is False


def test_inverted_outputs():
    data = single("BITS", 8, OUT)
    data.outputs[0].configure("x", invert=0b1010)
    assert written(data, 0b0110) == 0b1100
    assert data.outputs[0]["x"] == 0b0110
    data = single("BOOLEAN", 4, OUT)
    data.outputs[0].configure("x", invert=1)
    assert written(data, False) == 0b1111
    assert written(data, True) == 0


def test_min_equal_max_stands_for_one():
    assert written(single("UNSIGNED", 8, OUT, 0, 0), 1.0) == 0xFF


def test_counter_position_is_count_by_scale():
    data = single("ENCODER", 16, IN, 0, 0)
    data.inputs[0].configure("x", scale=4.0)
    assert read(data, 10) == 2.5
    assert data.inputs[0].raw("x") == 10


def test_counter_zeroed_counts_from_there():
    data = single("ENCODER", 8, IN)
    read(data, 100)
    data.inputs[0].zero("x")
    assert read(data, 90) == -10
    data.restart(0)
    assert read(data, 90) == 90


def test_parts_of_a_counter_belong_to_their_channel():
    """Two channels with the parts in different order do not disturb each other."""
    low, high = Field("angle", FieldKind.ENCODER_L, 12, IN), Field("turns", FieldKind.ENCODER_H, 8, IN)
    data = ProcessData({0: Layout([high, low]), 1: Layout([low, high])})
    for turns, angle in [(0, 4000), (1, 5), (0, 4090), (255, 4095)]:
        data.input_image[0, 0] = turns | angle << 8
        data.input_image[1, 0] = angle | ((turns + 1) & 255) << 12
        data.unpack()
        whole = (turns << 12 | angle) - (1 << 20 if turns == 255 else 0)
        assert data.inputs[0]["angle"] == data.inputs[0]["turns"] == whole
        assert data.inputs[1]["angle"] == data.inputs[1]["turns"] == whole + 4096


def test_an_unpaired_part_counts_by_itself():
    data = ProcessData({0: Layout([Field("turns", FieldKind.ENCODER_H, 4, IN)])})
    data.input_image[0, 0] = 0xF
    data.unpack()
    assert data.inputs[0]["turns"] == -1


def test_bidirectional_takes_room_both_ways_and_pad_in_its_own():
    layout = Layout(
        [
            Field("pad", FieldKind.PAD, 2, IN),
            Field("index", FieldKind.BOOLEAN, 1, BOTH),
            Field("pad", FieldKind.PAD, 3, OUT),
            Field("fault", FieldKind.BOOLEAN, 1, IN),
            Field("enable", FieldKind.BOOLEAN, 1, OUT),
        ]
    )
    data = ProcessData({0: layout})
    data.outputs[0].update({"index": True, "enable": True})
    data.pack()
    assert data.output_image[0, 0] == 0b10001
    data.input_image[0, 0] = 0b1100
    data.unpack()
    assert dict(data.inputs[0]) == {"index": True, "fault": True}
    assert (layout.input_bits, layout.output_bits) == (4, 5)


# ---- against the plain packer -------------------------------------------------------------------------


@st.composite
def fields(draw, max_bits=224):
    """Fields of one channel in one direction, with gaps, that fit into max_bits."""
    chosen, used = [], 0
    for i in range(draw(st.integers(1, 12))):
        kind = draw(st.sampled_from(["PAD", "BITS", "STREAM", *FORMULA_KINDS]))
        bits = draw(st.sampled_from([32, 64])) if kind == "FLOAT" else draw(st.integers(1, 64))
        if used + bits > max_bits:
            break
        chosen.append((f"{kind.lower()}{i}", kind, bits, used))
        used += bits
    return chosen or [("bits0", "BITS", 5, 0)]


def declared(chosen, direction, minimum, maximum):
    return Layout([Field(n, FieldKind[k], bits, direction, minimum, maximum) for n, k, bits, _ in chosen])


finite = st.floats(-1e6, 1e6, allow_nan=False)
images = st.lists(st.integers(0, 2**32 - 1), min_size=7, max_size=7)


@given(fields(), images, st.floats(allow_nan=True))
def test_unpack_agrees_with_the_plain_packer(chosen, words, scale):
    data = ProcessData({0: declared(chosen, IN, 0, 1)}, words=7)
    for name, kind, _, _ in chosen:
        if kind != "PAD":
            data.inputs[0].configure(name, scale=scale)
    data.input_image[0] = words
    data.unpack()
    for name, kind, bits, offset in chosen:
        if kind == "PAD":
            continue
        raw = reference.get_bits(words, offset, bits)
        expected = raw if kind in ("BITS", "STREAM") else reference.read(kind, bits, raw, scale)
        value = data.inputs[0][name]
        assert value == expected or (math.isnan(value) and math.isnan(expected))
        assert data.inputs[0].raw(name) == raw


@given(fields(), images, st.data())
def test_pack_agrees_with_the_plain_packer_and_touches_nothing_else(chosen, words, draw):
    low, high = sorted(draw.draw(st.tuples(finite, finite)))
    scale = draw.draw(st.one_of(finite, st.sampled_from([0.0, math.nan, math.inf, -1.0, 1e-300])))
    data = ProcessData({0: declared(chosen, OUT, low, high)}, words=7)
    data.output_image[0] = words
    expected = words
    for name, kind, bits, offset in chosen:
        if kind == "PAD":
            continue
        data.outputs[0].configure(name, scale=scale, low=low, high=high)
        if kind in ("BITS", "STREAM"):
            value = raw = draw.draw(st.integers(0, 2**bits - 1))
        else:
            value = draw.draw(st.booleans() if kind == "BOOLEAN" else finite)
            raw = reference.write(kind, bits, value, scale, low, high)
        data.outputs[0][name] = value
        expected = reference.put_bits(expected, offset, bits, raw)
    data.pack()
    assert [int(word) for word in data.output_image[0]] == expected


@given(st.integers(1, 64), st.data())
def test_counting_agrees_with_the_plain_packer(bits, draw):
    readings = draw.draw(st.lists(st.integers(0, 2**bits - 1), max_size=20))
    data = single("ENCODER", bits, IN)
    counts = []
    for raw in readings:
        read(data, raw)
        counts.append(data.inputs[0].raw("x"))
    assert counts == list(reference.count(readings, bits))


# ---- shapes, names and mistakes -------------------------------------------------------------------------


def test_images_may_be_strided_views_of_a_transfer():
    """Registers of one number lie together on the bus, the channels side by side."""
    transfer = np.zeros((3, 8), np.uint32)
    layout = Layout([Field("a", FieldKind.BITS, 20, OUT), Field("b", FieldKind.BITS, 64, OUT)])
    data = ProcessData({5: layout}, output_image=transfer.T)
    data.outputs[5].update({"a": 0xABCDE, "b": 0x0123456789ABCDEF})
    data.pack()
    assert list(transfer[:, 5]) == [0xDEFABCDE, 0x56789ABC, 0x01234]
    assert not transfer[:, [0, 1, 2, 3, 4, 6, 7]].any()


def test_plan_outlives_its_owner():
    data = single("BITS", 8, OUT)
    data.outputs[0]["x"] = 0x5A
    pack, image = data.pack, data.output_image
    del data
    pack()
    assert image[0, 0] == 0x5A


def test_single_bits_are_read_and_assigned():
    data = single("BITS", 16, BOTH)
    data.outputs[0]["x"][3] = True
    data.outputs[0]["x"][-1] = True
    data.outputs[0]["x"][0] = False
    assert data.outputs[0]["x"] == 0x8008
    word = data.outputs[0]["x"]
    assert [bit for bit, on in enumerate(word) if on] == [3, 15]
    assert repr(word) == "0x8008"
    assert len(word) == 16
    with pytest.raises(IndexError):
        word[16]
    with pytest.raises(TypeError, match="input"):
        data.inputs[0]["x"][0] = True
    assert isinstance(data.inputs[0]["x"], Bits)


def test_mistakes_of_the_caller():
    data = single("BITS", 4, OUT)
    with pytest.raises(ValueError, match="does not fit"):
        data.outputs[0]["x"] = 16
    with pytest.raises(TypeError, match="takes an int of 4 bits"):
        data.outputs[0]["x"] = 1.5
    with pytest.raises(TypeError, match="number"):
        data.outputs[0]["x"] = "5"
    with pytest.raises(KeyError):
        data.outputs[0]["y"] = 1
    with pytest.raises(KeyError):
        data.outputs[0].update({"x": 1, "y": 1})
    assert data.outputs[0]["x"] == 0
    with pytest.raises(ValueError, match="limits"):
        data.outputs[0].configure("x", low=1, high=0)
    with pytest.raises(ValueError, match="limits"):
        data.outputs[0].configure("x", low=math.nan)


@pytest.mark.parametrize("bad", [16, "5", 1.5])
def test_of_several_elements_none_is_assigned_if_one_cannot_be(bad):
    layout = Layout([Field(name, FieldKind.BITS, 4, OUT) for name in ("x", "y")])
    data = ProcessData({0: layout}, words=3)
    with pytest.raises((TypeError, ValueError)):
        data.outputs[0].update({"x": 1, "y": bad})
    assert data.outputs[0]["x"] == 0


@pytest.mark.parametrize(
    ("kind", "bits"),
    [("FLOAT", 16), ("SIGNED", 0), ("SIGNED", 65), ("ENCODER", 65), ("NONVOL_SIGNED", 8), ("PAD", 256)],
)
def test_layouts_that_cannot_be(kind, bits):
    with pytest.raises(ValueError, match="x:"):
        Layout([Field("x", FieldKind[kind], bits, IN)])


def test_two_elements_of_one_name_are_refused():
    with pytest.raises(ValueError, match="two inputs"):
        Layout([Field("x", FieldKind.BITS, 1, IN), Field("x", FieldKind.BITS, 1, IN)])


def test_a_layout_must_fit_its_registers():
    layout = Layout([Field("a", FieldKind.BITS, 60, IN), Field("b", FieldKind.SIGNED, 40, IN)])
    assert layout.words == 4
    with pytest.raises(ValueError, match="channel 2, b: SIGNED of 40 bits at bit 60 does not fit: limit 96"):
        ProcessData({2: layout})
    ProcessData({2: layout}, words=7)


def test_tables_name_every_element():
    data = ProcessData({1: analog_7i77()})
    assert "analogout3  0      V     0    SIGNED  13" in repr(data.outputs[1])
    assert "spinena     BITS    1     output     79" in repr(data.layouts[1])


def test_off_puts_everything_to_rest():
    data = ProcessData({1: analog_7i77()})
    data.outputs[1].update({"analogout0": 10, "analogena": 1})
    data.outputs[1].off()
    data.pack()
    assert not data.output_image.any()
