"""`Bits`: a word of independent bits, bit 0 first."""

import pytest

from hostmot2.elements import Bits


def test_bit_n_is_the_bit_of_weight_2_to_the_n():
    word = Bits(0b0000_0110_0000_0001, 16)
    assert [n for n in range(16) if word[n]] == [0, 9, 10]
    assert word[-1] is word[15] is False
    assert word[-16] is word[0] is True


def test_iteration_begins_with_bit_0():
    assert list(Bits(0b0001, 4)) == [True, False, False, False]
    assert len(Bits(0b0001, 4)) == 4
    assert sum(bit << n for n, bit in enumerate(Bits(0xA5C3, 16))) == 0xA5C3


@pytest.mark.parametrize("bit", [4, -5])
def test_a_bit_that_is_not_there(bit):
    with pytest.raises(IndexError):
        Bits(0, 4)[bit]


def test_assignment_goes_to_its_owner():
    assigned = []
    word = Bits(0, 4, lambda bit, value: assigned.append((bit, value)))
    word[1] = True
    word[-1] = 0
    assert assigned == [(1, True), (3, False)]
    assert word == 0  # what was read stays what was read
    with pytest.raises(TypeError, match="True or False"):
        word[0] = "off"
    with pytest.raises(TypeError, match="input"):
        Bits(0, 4)[0] = True


def test_shown_as_wide_as_it_is():
    assert repr(Bits(0x2A, 16)) == "0x002A"
