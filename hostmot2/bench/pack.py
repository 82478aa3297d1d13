"""Process data beside other packages: one message, all channels of a port, a million records."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial
from typing import Any, cast

import numpy as np

from hostmot2.bench import peers
from hostmot2.bench.report import Goal, Report, Section
from hostmot2.bench.rounds import ROUNDS, Candidate, Timing, measure
from hostmot2.process_data import ProcessData

FAIR = "cbitstruct + reorder + scaling"
RECORDS = 1_000_000


def run(count: int | None = None) -> Report:
    """Rounds: `count`, or 15. ImportError if a peer is missing (`pip install --group bench`)."""
    rounds = count or ROUNDS
    report = Report("pack")
    _unpack(report, rounds)
    _pack(report, rounds)
    for stride in (12, 16):
        _bulk(report, rounds, stride)
    report.notes.append("every candidate's result was checked against ours before it was timed")
    report.notes.append("in-place calls keep the interpreter lock: they take less time than handing it over")
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


def _unpack(report: Report, rounds: int) -> None:
    one, eight = _port(1), _port(8)
    message = one.input_image[0].tobytes()
    one.unpack()
    expected = [one.inputs[0][name] for name in peers.INPUTS]
    values, index = one.values.data, one.inputs[0].index("fieldvoltage")
    message_in, _ = peers.cantools_messages()
    decode = partial(message_in.decode, message, decode_choices=False)
    _agree(expected, [decode()[name] for name in peers.INPUTS], 1e-9)
    _agree(expected, peers.by_hand(message), 1e-9)

    def unpack_and_read() -> float:
        one.unpack()
        return values[index]

    candidates = [
        Candidate("ours, in place", one.unpack),
        Candidate("ours, in place + one value read", unpack_and_read),
        Candidate("ours, 8 channels in one call, per channel", eight.unpack, 8),
        Candidate("struct, bytes only, no scaling", partial(struct.Struct("<IBBBBBBH").unpack, message)),
        Candidate("int.from_bytes by hand", partial(peers.by_hand, message)),
        Candidate("cantools decode", decode),
    ]
    for name, (scaled, _, integers) in peers.bit_packers().items():
        _agree(expected, scaled(message), 1e-9)
        if name != "bitstruct":
            candidates.append(Candidate(f"{name}, integers", partial(integers, message)))
        candidates.append(Candidate(f"{name} + reorder + scaling", partial(scaled, message)))
    timings = measure(candidates, rounds)
    report.sections.append(Section("unpack of one 12-byte message, ns", timings, FAIR))
    fair, single = timings[FAIR], timings["ours, in place"]
    port = timings["ours, 8 channels in one call, per channel"]
    report.goals += [
        Goal("unpack one channel, times cbitstruct with scaling", single.times_faster_than(fair), 5),
        Goal("unpack 8 channels, times the same per channel", port.times_faster_than(fair), 20),
    ]


def _pack(report: Report, rounds: int) -> None:
    one, eight = _port(1), _port(8)
    one.pack()
    expected = one.output_image[0].tobytes()
    values = cast("memoryview[float]", one.values.data)
    index = one.outputs[0].index("analogout0")
    _, message_out = peers.cantools_messages()
    names = [name for name in one.outputs[0]]
    encode = partial(message_out.encode, dict(zip(names, peers.VALUES_OUT, strict=True)), strict=False)
    decoded = message_out.decode(encode())
    _agree(peers.VALUES_OUT, [decoded[name] for name in names], 0.0025)  # cantools rounds: one step

    def set_and_pack() -> None:
        values[index] = 2.5
        one.pack()

    candidates = [
        Candidate("ours, in place", one.pack),
        Candidate("ours, one value set + in place", set_and_pack),
        Candidate("ours, 8 channels in one call, per channel", eight.pack, 8),
        Candidate("cantools encode", encode),
    ]
    for name, (_, scaled, _) in peers.bit_packers().items():
        if scaled(*peers.VALUES_OUT) != expected:
            raise AssertionError(f"{name} packs something else")
        candidates.append(Candidate(f"{name} + reorder + scaling", partial(scaled, *peers.VALUES_OUT)))
    timings = measure(candidates, rounds)
    report.sections.append(Section("pack of one 12-byte message, ns", timings, FAIR))
    single = timings["ours, in place"]
    report.goals.append(
        Goal("pack, times cbitstruct with scaling", single.times_faster_than(timings[FAIR]), 10)
    )


def _loop(call: Callable[[bytes], object], messages: list[bytes]) -> None:
    for message in messages:
        call(message)


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
    messages = [bytes(row[:12]) for row in stored[:500]]
    message_in, _ = peers.cantools_messages()
    scaled, _, _ = peers.bit_packers()["cbitstruct"]
    memcpy = f"memcpy of the output ({size // RECORDS} bytes per record)"
    candidates = [
        Candidate("ours, float64 columns", partial(data.decode, records, out=doubles), RECORDS),
        Candidate(
            "ours, float32 columns", partial(data.decode, records, dtype=np.float32, out=singles), RECORDS
        ),
        Candidate(memcpy, partial(np.copyto, target, source), RECORDS),
        Candidate("numpy by hand for this message", partial(peers.numpy_columns, stored[:100_000]), 100_000),
        Candidate("cbitstruct loop + scaling", partial(_loop, scaled, messages), len(messages)),
        Candidate("cantools loop", partial(_loop, message_in.decode, messages), len(messages)),
    ]
    _judge_bulk(report, measure(candidates, rounds), memcpy, stride)


def _judge_bulk(report: Report, timings: dict[str, Timing], memcpy: str, stride: int) -> None:
    title = f"bulk decode of {RECORDS} records of {stride} bytes, ns per record"
    report.sections.append(Section(title, timings, "ours, float64 columns"))
    ours = timings["ours, float64 columns"]
    where = f"({stride} byte records)"
    report.goals += [
        Goal(
            f"bulk decode, times memcpy of its output {where}",
            timings[memcpy].times_faster_than(ours),
            1.5,
            False,
        ),
        Goal(
            f"bulk decode, times a cantools loop {where}",
            ours.times_faster_than(timings["cantools loop"]),
            500,
        ),
    ]
