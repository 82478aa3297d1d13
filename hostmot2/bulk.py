"""Recorded cycles to numpy columns, one per element.

The formulas and results are those of `ProcessData.unpack`, to the last bit; only the shape of the work
differs. Columns can be handed back as `out` to be filled again: memory already in use is several times
faster than fresh pages.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hostmot2._core import ffi, lib
from hostmot2.errors import check, new_error
from hostmot2.fields import Direction, FieldKind
from hostmot2.layout import COUNTERS, Element, Scaling

Columns = dict[str, npt.NDArray[Any]]
Records = npt.NDArray[np.uint32] | bytes | bytearray | memoryview

_SCALED = (FieldKind.UNSIGNED, FieldKind.SIGNED, FieldKind.FLOAT)
_INVERTIBLE = (FieldKind.BITS, FieldKind.STREAM, FieldKind.BOOLEAN)
_TYPES: dict[Any, int] = {
    np.dtype(np.float64): lib.HM2_COLUMN_F64,
    np.dtype(np.float32): lib.HM2_COLUMN_F32,
    np.dtype(np.uint32): lib.HM2_COLUMN_U32,
    np.dtype(np.uint64): lib.HM2_COLUMN_U64,
    np.dtype(np.bool_): lib.HM2_COLUMN_U8,
}


@dataclass(frozen=True, slots=True)
class Source:
    """An element to be decoded: the key of its column, its channel's row in a record, its scaling."""

    key: str
    row: int
    element: Element
    scaling: Scaling
    partner: str | None = None  # key of the other part of a counter in two parts


def decode(
    sources: Sequence[Source],
    records: Records,
    shape: tuple[int, int],
    dtype: npt.DTypeLike = np.float64,
    out: Mapping[str, npt.NDArray[Any]] | None = None,
) -> Columns:
    """One column per source.

    `records` holds images of `shape` (channels, registers): bytes in little-endian order, or a uint32 array
    whose first axis counts the records and whose strides may be anything. UNSIGNED, SIGNED and FLOAT become
    `dtype` (float64 or float32), BOOLEAN bool, BITS and STREAM uint32 or uint64, counters float64 positions
    that count from 0 before the first record. Raises ValueError when the sizes do not agree.
    """
    words = _records(records, shape)
    floating = np.dtype(dtype)
    if floating not in (np.dtype(np.float64), np.dtype(np.float32)):
        raise ValueError(f"columns are float64 or float32, not {floating}")
    count = len(words)
    columns: Columns = {}
    compiled = ffi.new("hm2_column[]", max(1, len(sources)))
    for column, source in zip(compiled, sources, strict=False):
        kind = _column_dtype(source.element, floating)
        old = None if out is None or source.element.field.kind in COUNTERS else out.get(source.key)
        usable = old is not None and old.shape == (count,) and old.dtype == kind and old.flags.carray
        array = old if old is not None and usable else np.empty(count, kind)
        columns[source.key] = array
        _fill_column(column, source, array, words)
    if count and sources:
        _run(words, compiled, len(sources))
    return _finish(sources, columns)


def _column_dtype(element: Element, floating: np.dtype[Any]) -> np.dtype[Any]:
    kind, bits = element.field.kind, element.field.bits
    if kind in _SCALED:
        return floating
    if kind is FieldKind.BOOLEAN:
        return np.dtype(np.bool_)
    return np.dtype(np.uint32 if bits <= 32 and kind not in COUNTERS else np.uint64)


def _records(records: Records, shape: tuple[int, int]) -> npt.NDArray[np.uint32]:
    """Records as an array [record, channel, register] without copying."""
    if not isinstance(records, np.ndarray):
        size = 4 * shape[0] * shape[1]
        if size == 0 or len(records) % size:
            raise ValueError(f"{len(records)} bytes are not whole records of {size}")
        records = np.frombuffer(records, np.dtype("<u4"))
        return records.reshape(-1, *shape)
    if records.dtype != np.uint32 or records.ndim < 1:
        raise ValueError("records are an array of uint32")
    words = records if records.ndim == 3 else records.reshape(records.shape[0], *shape)
    if words.shape[1:] != shape:
        raise ValueError(f"records of shape {records.shape[1:]} where {shape} is needed")
    return words


def _fill_column(column: Any, source: Source, array: npt.NDArray[Any], words: npt.NDArray[np.uint32]) -> None:
    _, channel_stride, word_stride = words.strides
    if channel_stride % 4 or word_stride % 4 or channel_stride < 0 or word_stride < 0:
        raise ValueError("the registers of a record lie whole words apart, in ascending order")
    column.data = ffi.cast("void *", array.ctypes.data)
    column.type = _TYPES[array.dtype]
    column.kind = source.element.field.kind
    column.bits = source.element.field.bits
    column.offset = source.element.offset
    column.first_word = source.row * channel_stride // 4
    column.word_stride = word_stride // 4
    column.scale = source.scaling.scale


def _run(words: npt.NDArray[np.uint32], compiled: Any, count: int) -> None:
    stride, channel_stride, word_stride = words.strides
    if stride < 0:
        raise ValueError("records in descending order")
    _, channels, registers = words.shape
    span = ((channels - 1) * channel_stride + (registers - 1) * word_stride) // 4 + 1
    error = new_error()
    records = ffi.cast("uint8_t *", words.ctypes.data)
    check(lib.hm2_bulk_decode(records, stride, span, len(words), compiled, count, error), error)


def _finish(sources: Sequence[Source], columns: Columns) -> Columns:
    """Readings of counters to positions, and inversion of outputs taken back."""
    result = dict(columns)
    for source in sources:
        field, scaling = source.element.field, source.scaling
        if field.kind in COUNTERS:
            result[source.key] = _positions(source, sources, columns)
        elif source.element.direction is Direction.OUTPUT and scaling.invert and field.kind in _INVERTIBLE:
            result[source.key] ^= np.array(scaling.invert, result[source.key].dtype)
    return result


def _positions(source: Source, sources: Sequence[Source], columns: Columns) -> npt.NDArray[np.float64]:
    readings, bits = columns[source.key], source.element.field.bits
    if source.partner is not None:
        other = next(each for each in sources if each.key == source.partner)
        upper, lower = (
            (source, other) if source.element.field.kind is FieldKind.ENCODER_H else (other, source)
        )
        low_bits = lower.element.field.bits
        readings = columns[upper.key] << np.uint64(low_bits) | columns[lower.key]
        bits = low_bits + upper.element.field.bits
    unused = np.uint64(64 - bits)
    moves = np.diff(readings, prepend=np.uint64(0)) << unused
    counts = np.cumsum(moves.view(np.int64) >> unused.astype(np.int64))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return counts / source.scaling.scale
