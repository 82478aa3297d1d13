"""What is in a recording: topics, how a record lies in memory, and how that is written down.

Everything that describes the file is JSON with a fixed form, read into the structures below and nowhere else;
nothing in a file is ever executed.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import msgspec
import numpy as np

from hostmot2.record_ring import STAGES
from hostmot2.recording.errors import BrokenRecording

T = TypeVar("T")

RECORDS = "/hm2/records"
IMAGE = "/hm2/image"
RECORDER = "/hm2/recorder"
INPUTS = "/hm2/inputs"
OUTPUTS = "/hm2/outputs"
CYCLE = "/hm2/cycle"
LOG = "/hm2/log"

RECORDS_SCHEMA = "hm2.records"
RECORDS_ENCODING = "x-hm2-records"
FORMAT = "hm2 records 1"

DESCRIPTORS_NAME = "descriptors.json"
DUMP_NAME = "board.hm2dump"
LAYOUT_NAME = "layout.foxglove.json"
RUN = "hm2.run"
HOST = "hm2.host"

LARGEST_RECORD = 1 << 16  # bytes; 256 words and 512 + 512 signals take less
_TYPES = {"<u8", "<i8", "<u4", "<i4", "<f8"}
_ABOUT = {
    "cycle": "number of the cycle; a gap is a dropped record",
    "start_ns": "when the cycle was due, ns on the board's clock",
    "stage_ns": "ns from start_ns until each stage was over: " + ", ".join(STAGES),
    "outputs_number": "number of the output vector that was in use",
    "status": "of the cycle's exchanges, 0: good (hm2_status)",
    "flags": "why outputs are off (HM2_OFF_*) and HM2_ENGINE_*",
    "image_words": "words of the register image in use",
    "fresh": "bit n: word n was moved by this cycle",
    "words": "register image; /hm2/image says which register each word is",
    "inputs": "input values in engineering units",
    "outputs": "output values in engineering units; in pipelined style the next cycle's words have them",
}


@dataclass(frozen=True, slots=True)
class Signal:
    """One number of the input or output vector: its name, its unit ("" for none), a sentence about it."""

    name: str
    unit: str = ""
    description: str = ""


class FieldText(msgspec.Struct, forbid_unknown_fields=True):
    """A member of a record."""

    name: str
    type: str
    offset: int
    count: int  # 0: a single number
    about: str = ""


class SignalText(msgspec.Struct, forbid_unknown_fields=True):
    """A signal as written down."""

    name: str
    unit: str = ""
    description: str = ""


class RecordsText(msgspec.Struct, forbid_unknown_fields=True):
    """The schema of /hm2/records: how a record lies in a message's bytes."""

    format: str
    about: str
    size: int
    fields: list[FieldText]
    inputs: list[SignalText]
    outputs: list[SignalText]


class ImageText(msgspec.Struct):
    """A message of /hm2/image: the register of each word; bit 0 of an address: written, else read."""

    registers: list[int]


class CountersText(msgspec.Struct):
    """A message of /hm2/recorder: records written to the file and dropped for want of room, so far."""

    records: int
    dropped: int


@dataclass(frozen=True)
class RecordsSchema:
    """A records schema, read and found sound."""

    dtype: np.dtype[Any]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]


def records_schema(dtype: np.dtype[Any], inputs: Sequence[Signal], outputs: Sequence[Signal]) -> bytes:
    """The text that says how records of `dtype` are to be read."""
    fields = []
    for name in dtype.names or ():
        if name in ("pad", "reserved"):
            continue
        field, offset = dtype.fields[name][:2]  # type: ignore[index]
        count = field.shape[0] if field.shape else 0
        fields.append(FieldText(name, field.base.str, offset, count, _ABOUT.get(name, "")))
    text = RecordsText(
        format=FORMAT,
        about="A message is whole records one behind the other, little endian, `size` bytes each.",
        size=dtype.itemsize,
        fields=fields,
        inputs=[SignalText(each.name, each.unit, each.description) for each in inputs],
        outputs=[SignalText(each.name, each.unit, each.description) for each in outputs],
    )
    return msgspec.json.encode(text)


def decoded(data: bytes, kind: type[T], what: str) -> T:
    """A JSON text of a recording. Raises BrokenRecording, which says that `what` cannot be read."""
    try:
        return msgspec.json.decode(data, type=kind)
    except (ValueError, RecursionError) as problem:  # no JSON, no UTF-8, another shape, too deep
        raise BrokenRecording(f"{what} cannot be read: {problem}") from problem


def parse_records_schema(data: bytes) -> RecordsSchema:
    """The schema back. Raises BrokenRecording for anything `records_schema` would not have written."""
    text = decoded(data, RecordsText, "the description of the records")
    if text.format != FORMAT:
        raise BrokenRecording(f"records of format {text.format!r}; this version reads {FORMAT!r}")
    if not 8 <= text.size <= LARGEST_RECORD or len({field.name for field in text.fields}) < len(text.fields):
        raise BrokenRecording(f"records of {text.size} bytes with {len(text.fields)} fields cannot be")
    dtype = _dtype(text)
    for name, signals in (("inputs", text.inputs), ("outputs", text.outputs)):
        if dtype[name].shape != (len(signals),):
            raise BrokenRecording(f"{len(signals)} {name} are named, the records have {dtype[name].shape}")
    return RecordsSchema(dtype, _signals(text.inputs), _signals(text.outputs))


def _signals(texts: list[SignalText]) -> tuple[Signal, ...]:
    return tuple(Signal(text.name, text.unit, text.description) for text in texts)


def _dtype(text: RecordsText) -> np.dtype[Any]:
    formats: list[Any] = []
    for field in text.fields:
        if field.type not in _TYPES or field.count < 0 or field.offset < 0:
            raise BrokenRecording(f"field {field.name!r} of the records cannot be")
        vector = field.name in _VECTORS or field.count > 0
        if field.offset + int(field.type[-1]) * (field.count if vector else 1) > text.size:
            raise BrokenRecording(f"field {field.name!r} lies outside the records")
        formats.append((field.type, (field.count,)) if vector else field.type)
    names = [field.name for field in text.fields]
    missing = _NEEDED - set(names)
    if missing:
        raise BrokenRecording(f"the records have no {', '.join(sorted(missing))}")
    offsets = [field.offset for field in text.fields]
    dtype = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": text.size})
    for name, form in _FORMS.items():
        if dtype[name].base.str != form or bool(dtype[name].shape) != (name in _VECTORS):
            raise BrokenRecording(f"field {name!r} of the records is {dtype[name]}, not {form}")
    if dtype["stage_ns"].shape[0] < len(STAGES) or 32 * dtype["fresh"].shape[0] < dtype["words"].shape[0]:
        raise BrokenRecording("the records have not all stages, or too few bits for what was moved")
    return dtype


_VECTORS = ("words", "inputs", "outputs", "stage_ns", "fresh")
_FORMS = {
    "cycle": "<u8",
    "start_ns": "<i8",
    "stage_ns": "<u4",
    "status": "<i4",
    "flags": "<u4",
    "fresh": "<u4",
    "words": "<u4",
    "inputs": "<f8",
    "outputs": "<f8",
}
_NEEDED = set(_FORMS)


def json_names(signals: Sequence[Signal]) -> list[str]:
    """A plain name per signal for JSON messages, as plot paths take them without quotes; all different."""
    taken = {"cycle"}
    names = []
    for signal in signals:
        plain = re.sub(r"\W+", "_", signal.name, flags=re.ASCII).strip("_") or "signal"
        plain = f"_{plain}" if plain[0].isdigit() else plain
        name, number = plain, 2
        while name in taken:
            name, number = f"{plain}_{number}", number + 1
        taken.add(name)
        names.append(name)
    return names


def signals_schema(title: str, signals: Sequence[Signal]) -> bytes:
    """JSON Schema of a flat message with one number per signal; units are in the descriptions."""
    properties: dict[str, Any] = {"cycle": {"type": "integer", "description": "number of the cycle"}}
    for name, signal in zip(json_names(signals), signals, strict=True):
        unit = f" [{signal.unit}]" if signal.unit else ""
        about = f": {signal.description}" if signal.description else ""
        properties[name] = {"type": "number", "description": f"{signal.name}{unit}{about}"}
    return _object(title, properties)


CYCLE_NAMES = [*(f"{stage}_us" for stage in STAGES), "total_us"]


def cycle_schema() -> bytes:
    """JSON Schema of /hm2/cycle."""
    properties: dict[str, Any] = {"cycle": {"type": "integer", "description": "number of the cycle"}}
    for name, stage in zip(CYCLE_NAMES, STAGES, strict=False):
        properties[name] = {"type": "number", "description": f"how long the stage {stage} took [us]"}
    properties["wake_us"]["description"] = "how late the cycle began [us]"
    properties["total_us"] = {"type": "number", "description": "from when it was due to its end [us]"}
    properties["status"] = {"type": "integer", "description": "of the exchanges, 0: good"}
    properties["flags"] = {"type": "integer", "description": "why outputs are off, and engine flags"}
    return _object("hm2.cycle", properties)


def object_schema(title: str, **properties: str) -> bytes:
    """JSON Schema of a flat message: property -> description, all integers."""
    return _object(title, {k: {"type": "integer", "description": v} for k, v in properties.items()})


def image_schema() -> bytes:
    """JSON Schema of /hm2/image."""
    about = "byte address of each word of the register image; bit 0 set: written, else read"
    return _object(
        "hm2.image", {"registers": {"type": "array", "items": {"type": "integer"}, "description": about}}
    )


def log_schema() -> bytes:
    """JSON Schema of foxglove.Log."""
    time = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
    texts = {name: {"type": "string"} for name in ("message", "name", "file")}
    numbers = {name: {"type": "integer"} for name in ("level", "line")}
    return _object("foxglove.Log", {"timestamp": time, **numbers, **texts})


def _object(title: str, properties: dict[str, Any]) -> bytes:
    return msgspec.json.encode({"type": "object", "title": title, "properties": properties})
