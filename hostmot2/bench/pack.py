"""Process data beside other packages: one message, all channels of a port, a million records."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from hostmot2.bench import peers
from hostmot2.bench.report import Goal, Report, Section
from hostmot2.bench.rounds import ROUNDS, Candidate, Timing, measure
from hostmot2.process_data import ProcessData

ONE, PORT, SET = (
    "ours, in place",
    "ours, 8 channels in one call, per channel",
    "ours, one value set + in place",
)
FAIR = "cbitstruct + reorder + scaling"
BULK, CANTOOLS = "ours, float64 columns", "cantools loop"
RECORDS = 1_000_000
BULK_WHY = (
    "decoding waits for memory: it takes less than a memcpy of its output, while the peer waits for the "
    "processor; the ratio is that of the machine's two"
)


def run(count: int | None = None) -> Report:
    """Rounds: `count`, or 15. A peer that is not installed is left out, and said so."""
    rounds = count or ROUNDS
    report = Report("pack")
    _unpack(report, rounds)
    _pack(report, rounds)
    for stride in (12, 16):
        _bulk(report, rounds, stride)
    report.notes.append("every candidate's result was checked against ours before it was timed")
    report.notes.append("in-place calls keep the interpreter lock: they take less time than handing it over")
    missing = [name for name in ("cbitstruct", "bitstruct", "cantools") if not peers.installed(name)]
    if missing:
        report.notes.append(f"not installed: pip install {' '.join(missing)}")
    return report


def _port(channels: int) -> ProcessData:
    data = ProcessData(dict.fromkeys(range(channels), peers.LAYOUT))
    noise = np.random.default_rng(1)
    data.input_image[:] = noise.integers(0, 2**32, data.input_image.shape, dtype=np.uint32)
    for outputs in data.outputs.values():
        outputs.update(dict(zip(outputs, peers.VALUES_OUT, strict=True)))
    return data


def _agree(ours: Any, theirs: Any, tolerance: float) -> None:
    if not np.allclose(np.asarray(ours, float), np.asarray(theirs, float), rtol=0, atol=tolerance):
        raise AssertionError(f"a peer does something else: {theirs} where we have {ours}")


def _judge(
    report: Report,
    text: str,
    timings: Mapping[str, Timing],
    names: tuple[str, str],
    at_least: float,
    why: str = "",
) -> None:
    """A goal, if the peer was there: how many times faster the first is than the second."""
    if all(name in timings for name in names):
        faster, slower = (timings[name] for name in names)
        report.goals.append(Goal(text, faster.times_faster_than(slower), at_least, why=why))


def _unpack(report: Report, rounds: int) -> None:
    one, eight = _port(1), _port(8)
    message = one.input_image[0].tobytes()
    one.unpack()
    expected = [one.inputs[0][name] for name in peers.INPUTS]
    values, index = one.values.data, one.inputs[0].index("fieldvoltage")

    def unpack_and_read() -> float:
        one.unpack()
        return values[index]

    candidates = [
        Candidate(ONE, one.unpack),
        Candidate("ours, in place + one value read", unpack_and_read),
        Candidate(PORT, eight.unpack, 8),
        Candidate("struct, bytes only, no scaling", partial(struct.Struct("<IBBBBBBH").unpack, message)),
        Candidate("int.from_bytes by hand", partial(peers.by_hand, message)),
    ]
    _agree(expected, peers.by_hand(message), 1e-9)
    for name, (scaled, _, integers) in peers.bit_packers().items():
        _agree(expected, scaled(message), 1e-9)
        candidates.append(Candidate(f"{name}, integers", partial(integers, message)))
        candidates.append(Candidate(f"{name} + reorder + scaling", partial(scaled, message)))
    if messages := peers.cantools_messages():
        decode = partial(messages[0].decode, message)
        _agree(expected, [decode()[name] for name in peers.INPUTS], 1e-9)
        candidates.append(Candidate("cantools decode", decode))
    timings = measure(candidates, rounds)
    report.sections.append(
        Section("unpack of one 12-byte message, ns", timings, _reference(timings, FAIR, ONE))
    )
    _judge(report, "unpack one channel, times cbitstruct with scaling", timings, (ONE, FAIR), 5)
    _judge(report, "unpack 8 channels, times the same per channel", timings, (PORT, FAIR), 20)


def _pack(report: Report, rounds: int) -> None:
    one, eight = _port(1), _port(8)
    one.pack()
    expected = one.output_image[0].tobytes()
    values = cast("memoryview[float]", one.values.data)
    index = one.outputs[0].index("analogout0")

    def set_and_pack() -> None:
        values[index] = 2.5
        one.pack()

    candidates = [Candidate(ONE, one.pack), Candidate(SET, set_and_pack), Candidate(PORT, eight.pack, 8)]
    for name, (_, scaled, _) in peers.bit_packers().items():
        if scaled(*peers.VALUES_OUT) != expected:
            raise AssertionError(f"{name} packs something else")
        candidates.append(Candidate(f"{name} + reorder + scaling", partial(scaled, *peers.VALUES_OUT)))
    if messages := peers.cantools_messages():
        given = dict(zip(one.outputs[0], peers.VALUES_OUT, strict=True))
        encode = partial(messages[1].encode, given, strict=False)
        decoded = messages[1].decode(encode())
        _agree(peers.VALUES_OUT, [decoded[name] for name in given], 0.0025)  # cantools rounds: one step
        candidates.append(Candidate("cantools encode", encode))
    timings = measure(candidates, rounds)
    report.sections.append(
        Section("pack of one 12-byte message, ns", timings, _reference(timings, FAIR, ONE))
    )
    _judge(report, "pack, times cbitstruct with scaling", timings, (ONE, FAIR), 10)


def _reference(timings: Mapping[str, Timing], wanted: str, otherwise: str) -> str:
    return wanted if wanted in timings else otherwise


def _loop(call: Callable[[bytes], object], messages: list[bytes]) -> None:
    for message in messages:
        call(message)


def _loops(stored: npt.NDArray[np.uint8]) -> list[Candidate]:
    """Peers that take a message at a time, over a sample: their time per message does not depend on more."""
    sample = [bytes(row[:12]) for row in stored[:500]]
    calls: dict[str, Callable[[bytes], object]] = {}
    if "cbitstruct" in peers.bit_packers():
        calls["cbitstruct loop + scaling"] = peers.bit_packers()["cbitstruct"][0]
    if messages := peers.cantools_messages():
        calls[CANTOOLS] = messages[0].decode
    return [Candidate(name, partial(_loop, call, sample), len(sample)) for name, call in calls.items()]


def _bulk(report: Report, rounds: int, stride: int) -> None:
    data = _port(1)
    stored = np.random.default_rng(2).integers(0, 256, (RECORDS, stride), dtype=np.uint8)
    records = stored.view("<u4")[:, :3]
    doubles = data.decode(records)
    singles = data.decode(records, dtype=np.float32)
    for name, column in zip(peers.INPUTS, peers.numpy_columns(stored[:1000]), strict=True):
        _agree(doubles[name][:1000], column, 1e-9)
    size = sum(column.nbytes for column in doubles.values())
    source, target = np.ones(size, np.uint8), np.ones(size, np.uint8)
    memcpy = f"memcpy of the output ({size // RECORDS} bytes per record)"
    to_singles = partial(data.decode, records, dtype=np.float32, out=singles)
    candidates = [
        Candidate(BULK, partial(data.decode, records, out=doubles), RECORDS),
        Candidate("ours, float32 columns", to_singles, RECORDS),
        Candidate(memcpy, partial(np.copyto, target, source), RECORDS),
        Candidate("numpy by hand for this message", partial(peers.numpy_columns, stored[:100_000]), 100_000),
        *_loops(stored),
    ]
    timings = measure(candidates, rounds)
    title = f"bulk decode of {RECORDS} records of {stride} bytes, ns per record"
    report.sections.append(Section(title, timings, BULK))
    ratio = timings[memcpy].times_faster_than(timings[BULK])
    what = f"bulk decode of {stride}-byte records"
    report.goals.append(Goal(f"{what}, times memcpy of its output", ratio, 1.5, at_least=False))
    _judge(report, f"{what}, times a cantools loop", timings, (BULK, CANTOOLS), 500, BULK_WHY)
