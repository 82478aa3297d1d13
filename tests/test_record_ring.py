import threading

import numpy as np
import pytest

from hostmot2._core import ffi, lib
from hostmot2.record_ring import STAGES, RecordRing, record_dtype

DTYPE = record_dtype(words=5, inputs=2, outputs=1)


def record(cycle):
    made = np.zeros(1, DTYPE)
    made["cycle"] = cycle
    made["words"][0, 4] = cycle ^ 0xFFFFFFFF
    return made


def test_the_python_type_is_the_c_struct():
    header = record_dtype()
    assert header.itemsize == ffi.sizeof("hm2_record")
    for field in ("cycle", "start_ns", "stage_ns", "status", "flags", "image_words", "fresh"):
        assert header.fields[field][1] == ffi.offsetof("hm2_record", field)
    assert header.fields["outputs_number"][1] == ffi.offsetof("hm2_record", "outputs")
    assert len(STAGES) == lib.HM2_STAGES


def test_values_lie_on_multiples_of_eight_bytes():
    for words in range(8):
        dtype = record_dtype(words=words, inputs=3, outputs=2)
        assert dtype.fields["inputs"][1] % 8 == 0
        assert dtype.itemsize % 8 == 0


def test_records_come_out_whole_in_the_order_they_went_in():
    ring = RecordRing(DTYPE, 8)
    for cycle in range(5):
        assert ring.push(record(cycle))
    assert ring.pop(3)["cycle"].tolist() == [0, 1, 2]
    for cycle in range(5, 11):
        assert ring.push(record(cycle))
    taken = ring.pop()
    assert taken["cycle"].tolist() == list(range(3, 11))
    assert taken["words"][:, 4].tolist() == [cycle ^ 0xFFFFFFFF for cycle in range(3, 11)]
    assert ring.pop().size == 0


def test_what_finds_no_room_is_dropped_and_counted_exactly():
    ring = RecordRing(DTYPE, 4)
    assert [ring.push(record(cycle)) for cycle in range(7)] == [True] * 4 + [False] * 3
    assert ring.counters == (4, 3, 0)
    assert ring.pop()["cycle"].tolist() == [0, 1, 2, 3]
    assert ring.push(record(7))
    assert ring.pop()["cycle"].tolist() == [7]
    assert ring.counters == (5, 3, 5)


def test_one_thread_pushes_while_another_pops_nothing_is_lost_uncounted():
    ring, total, seen = RecordRing(DTYPE, 16), 3000, []
    done = threading.Event()

    def drain():
        while True:
            last = done.is_set()
            taken = ring.pop()
            seen.extend(taken["cycle"].tolist())
            if last and not taken.size:
                return

    thread = threading.Thread(target=drain)
    thread.start()
    for cycle in range(total):
        ring.push(record(cycle))
    done.set()
    thread.join()
    counters = ring.counters
    assert counters.pushed + counters.dropped == total
    assert counters.popped == counters.pushed == len(seen)
    assert seen == sorted(seen)


@pytest.mark.parametrize("slots", [0, 1, 3, 1000, 1 << 25])
def test_slots_are_a_power_of_two(slots):
    with pytest.raises(ValueError, match="power of two"):
        RecordRing(DTYPE, slots)


@pytest.mark.parametrize("words", [-1, lib.HM2_RECORD_WORDS + 1])
def test_an_image_has_bounds(words):
    with pytest.raises(ValueError, match=f"{words} words are outside 0.."):
        record_dtype(words=words)


def test_only_whole_single_records_go_in_and_into_arrays_of_their_own_kind():
    ring = RecordRing(DTYPE, 8)
    for count in (0, 2):
        with pytest.raises(ValueError, match=f"{count} records instead of one"):
            ring.push(np.zeros(count, DTYPE))
    ring.push(record(7))
    for array in (np.zeros(4, record_dtype(words=9)), np.zeros(8, DTYPE)[::2]):
        with pytest.raises(ValueError, match="not a contiguous one"):
            ring.pop_into(array)
    assert ring.pop(8)["cycle"].tolist() == [7], "nothing was taken by what was refused"
