"""What elements of process data, images and commands cannot be: refused by name, and nothing is changed."""

import numpy as np
import pytest

from hostmot2 import lbp16
from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.process_data import Layout, ProcessData
from hostmot2.registers import Lbp16Space

IN, OUT = Direction.INPUT, Direction.OUTPUT


def of(kind, bits, direction, **images):
    layout = Layout([Field("x", FieldKind[kind], bits, direction, 0.0, 1.0)])
    return ProcessData({0: layout}, **(images or {"words": 3}))


@pytest.mark.parametrize("invert", [16, -1])
def test_an_inversion_must_fit_its_element(invert):
    outputs = of("BITS", 4, OUT).outputs[0]
    with pytest.raises(ValueError, match=f"x has 4 bits, inversion {invert} does not fit"):
        outputs.configure("x", invert=invert)
    assert outputs.scaling("x").invert == 0


@pytest.mark.parametrize(
    "image", [np.zeros(3, np.uint32), np.zeros((1, 3), np.int64), np.zeros((1, 3), np.uint32)[:, ::-1]]
)
def test_an_image_is_words_by_channel_and_register(image):
    with pytest.raises(ValueError, match="two-dimensional array of uint32"):
        of("BITS", 4, IN, input_image=image)


def test_an_image_without_registers_moves_nothing():
    data = ProcessData({0: Layout([])}, input_image=np.zeros((1, 0), np.uint32))
    data.unpack()
    assert dict(data.inputs[0]) == {}


def test_only_counters_are_zeroed():
    inputs = of("BITS", 4, IN).inputs[0]
    with pytest.raises(TypeError, match="x is not a counter"):
        inputs.zero("x")


def test_a_command_of_more_elements_than_a_packet_names():
    with pytest.raises(ValueError, match="space 0, 128 elements: out of range"):
        lbp16.read(Lbp16Space.HOSTMOT2, 0x100, 128)
    assert lbp16.read(Lbp16Space.HOSTMOT2, 0x100, 127)
