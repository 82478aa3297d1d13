"""Recordings for other programs: CSV and Parquet."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from hostmot2.recording.recording import Recording
from hostmot2.whole_file import whole_file

ROWS_AT_ONCE = 4096


def columns_of(recording: Recording, names: Sequence[str] = ()) -> list[str]:
    """The columns meant: `names`, or all, spelled as in the file. KeyError for one that is not there."""
    return [recording.spelled(name) for name in names] or list(recording)


def to_csv(recording: Recording, path: str | Path, names: Sequence[str] = ()) -> None:
    """A row per cycle, `time_ns` (since 1970) first; the header has units in brackets.

    Numbers are written so that reading gives the same double. KeyError for a name that is not there.
    """
    chosen = columns_of(recording, names)
    units = recording.units
    with whole_file(path) as place, place.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["time_ns", *(f"{n} [{units[n]}]" if n in units else n for n in chosen)])
        arrays = [recording.time_ns, *(recording[name] for name in chosen)]
        for first in range(0, len(recording.records), ROWS_AT_ONCE):
            block = [array[first : first + ROWS_AT_ONCE].tolist() for array in arrays]
            writer.writerows(zip(*block, strict=True))


def to_parquet(recording: Recording, path: str | Path, names: Sequence[str] = ()) -> None:
    """A column per name with its unit as metadata of the field, `time` as timestamps of ns in UTC.

    Raises ImportError with advice if pyarrow is missing (`pip install hostmot2[parquet]`).
    """
    arrow, parquet = _arrow()
    chosen = columns_of(recording, names)
    arrays = [arrow.array(recording.time_ns).cast(arrow.timestamp("ns", tz="UTC"))]
    fields = [arrow.field("time", arrays[0].type)]
    for name in chosen:
        arrays.append(arrow.array(recording[name].copy()))
        unit = {"unit": recording.units[name]} if name in recording.units else None
        fields.append(arrow.field(name, arrays[-1].type, metadata=unit))
    with whole_file(path) as place:
        parquet.write_table(arrow.Table.from_arrays(arrays, schema=arrow.schema(fields)), place)


def _arrow() -> tuple[Any, Any]:
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as problem:
        raise ImportError("Parquet needs pyarrow: pip install 'hostmot2[parquet]'") from problem
