"""Records and recordings for tests."""

import numpy as np

from hostmot2.record_ring import RecordRing, record_dtype
from hostmot2.recording import Recorder, Signal

INPUTS = (Signal("enc0.position", "mm", "where the axis is"), Signal("enc0.velocity", "mm/s"))
OUTPUTS = (Signal("analog0", "V"),)
IMAGE = (0x5B00, 0x5C00, 0x5B01)
DTYPE = record_dtype(words=len(IMAGE), inputs=len(INPUTS), outputs=len(OUTPUTS))
PERIOD_NS = 250_000


def records(first, count, dtype=DTYPE):
    """Records of consecutive cycles at 4 kHz whose contents follow from their numbers."""
    made = np.zeros(count, dtype)
    cycle = np.arange(first, first + count)
    made["cycle"] = cycle
    made["start_ns"] = 10**12 + cycle * PERIOD_NS
    made["stage_ns"] = np.arange(1, 9) * 1000
    made["stage_ns"][:, 7] = 0
    made["image_words"] = made["words"].shape[1]
    made["fresh"][:, 0] = 0b101
    made["words"] = (cycle[:, None] * 2654435761 + np.arange(made["words"].shape[1])) & 0xFFFFFFFF
    made["inputs"] = cycle[:, None] / 7 + np.arange(made["inputs"].shape[1])
    made["outputs"] = -cycle[:, None] / 3
    return made


def push_all(ring, made):
    """How many found room."""
    return sum(ring.push(made[i : i + 1]) for i in range(len(made)))


def record_file(path, made, *, slots=8192, parts=1, **options):
    """A recording of these records, in `parts` flushed separately."""
    ring = RecordRing(made.dtype, slots)
    recorder = Recorder(ring, path, INPUTS, OUTPUTS, image=IMAGE, clock=lambda: 10**12, **options)
    for part in np.array_split(made, parts):
        assert push_all(ring, part) == len(part)
        recorder._drain()
        recorder._flush()
    recorder.close()
    return path
