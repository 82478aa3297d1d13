"""What a remote is: its process data, parameters and modes, from its own tables or from built-in facts.

The tables are parsed and checked by the core (csrc/discovery.c); here their records become fields.
Source: sserial.md 5; for the two remotes that predate discovery 7.2 and 7.3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.errors import new_error, text
from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.layout import Layout
from hostmot2.registers import ModeType, RecordType
from hostmot2.remotes.errors import BrokenTable, broken_table

ALIASES = {"NVWATCHDOGTIME": "NVWATCHDOGTIMEOUT", "NVWATCHDOGTIMEOUT": "NVWATCHDOGTIME"}
"""The 7I77 manual has both names for one parameter."""

BAUD_INDEX_MAX = 11
"""Of NVBAUDRATE; a wrong one makes a remote unreachable in operate mode (lbp_serial.md 5)."""

MEMORY_END = 0x10000
"""Addresses of a remote have 16 bits."""

_KINDS: Mapping[int, FieldKind] = FieldKind._value2member_map_  # type: ignore[assignment]

ReadTable = Callable[[int, int, Any, int, Any, int, Any, Any], int]
"""pointer, table, ptoc records, their count, records, capacity, count, error: a status of the core."""


@dataclass(frozen=True, slots=True)
class Mode:
    """A mode of a remote. Hardware modes are set by jumper or EEPROM, software modes at each start."""

    index: int
    hardware: bool
    name: str


@dataclass(frozen=True)
class RemoteDescription:
    """What a remote says of itself in one software mode.

    fields: its process data in packing order. parameters: what can be read and written in setup mode;
    parameters_error: why they are not known. modes: all software modes; hardware_mode, mode: the present
    ones. warnings: what was put right. receive_size and transmit_size are bytes of the process data
    exchange (0: not known), with the fault byte. fault_word: input register and mask of a fault word in
    the process data, fault_names its bits. aliases: other names of parameters. scaled_by_parameter: full
    scales are a parameter of the remote: the description holds as long as nobody writes that. scale_pending:
    its next power-up brings other ones.
    """

    name: str
    unit_number: int
    software_mode: int = 0
    toc: int = 0
    fields: tuple[Field, ...] = ()
    parameters: tuple[Field, ...] = ()
    parameters_error: BrokenTable | None = None
    modes: tuple[Mode, ...] = ()
    hardware_mode: Mode | None = None
    mode: Mode | None = None
    receive_size: int = 0
    transmit_size: int = 0
    warnings: tuple[str, ...] = ()
    fault_word: tuple[int, int] | None = None
    fault_names: tuple[str, ...] = ()
    scaled_by_parameter: bool = False
    scale_pending: bool = False
    aliases: Mapping[str, str] = field(default_factory=dict, compare=False)
    layout: Layout = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "layout", Layout(self.fields))

    @property
    def identity(self) -> tuple[int, str, int, int]:
        """What must be the same for this description to hold: unit number, name, tables, mode."""
        return self.unit_number, self.name, self.toc, self.software_mode

    def raise_for_parameters(self) -> None:
        """Raises BrokenTable when the parameters are not known."""
        if self.parameters_error is not None:
            raise self.parameters_error


@dataclass
class _Tables:
    """Both tables of one remote, read."""

    ptoc: Any
    ptoc_count: int
    gtoc: list[Any]
    gtoc_error: BrokenTable | None
    gtoc_memory: Any  # owns the records of the GTOC: an element of a cffi array does not keep its array
    warnings: list[str] = field(default_factory=list)


def read_tables(
    read_table: ReadTable,
    channel: int,
    toc: int,
    *,
    name: str,
    unit_number: int,
    software_mode: int = 0,
    registers: int = 3,
    sizes: tuple[int, int] = (0, 0),
) -> RemoteDescription:
    """The description of a remote whose table pointers are `toc` (GTOC << 16 | PTOC).

    sizes: receive and transmit size in bytes, (0, 0) if not known. Raises BrokenTable for a PTOC that
    cannot be right; a broken GTOC is kept in `parameters_error`. Errors of the reads pass through.
    """
    tables = _read_both(read_table, channel, toc)
    _check_sizes(tables, channel, sizes, registers)
    process = _process_fields(tables)
    parameters = _parameter_fields(tables)
    here, all_modes = _modes(tables)
    present = next((mode for mode in here if not mode.hardware), None)
    return RemoteDescription(
        name=name,
        unit_number=unit_number,
        software_mode=software_mode,
        toc=toc,
        fields=process,
        parameters=parameters,
        parameters_error=tables.gtoc_error,
        modes=all_modes,
        hardware_mode=next((mode for mode in here if mode.hardware), None),
        mode=present,
        receive_size=sizes[0],
        transmit_size=sizes[1],
        aliases=ALIASES,
        warnings=tuple(tables.warnings),
    )


def read_memory(memory: bytes, base: int, toc: int, **facts: Any) -> RemoteDescription:
    """The description from an image of a remote's memory that begins at address `base`.

    Same arguments and errors as `read_tables`; ValueError where the tables point outside the image.
    """
    buffer = ffi.from_buffer(memory)

    def read_table(pointer: int, table: int, *rest: Any) -> int:
        return int(lib.hm2_toc_read_buffer(buffer, len(memory), base, pointer, table, *rest))

    return read_tables(read_table, facts.pop("channel", 0), toc, **facts)


def _read_one(
    read_table: ReadTable, channel: int, pointer: int, table: int, ptoc: Any, ptoc_count: int
) -> tuple[Any, int, BrokenTable | None]:
    records = ffi.new("hm2_toc_record[]", lib.HM2_TOC_ENTRIES)
    count, error = ffi.new("size_t *"), new_error()
    status = read_table(pointer, table, ptoc, ptoc_count, records, lib.HM2_TOC_ENTRIES, count, error)
    if status == lib.HM2_ERR_FORMAT:
        return records, count[0], broken_table(channel, error)
    if status != lib.HM2_OK:
        raise ReadFailed(status, error)
    return records, count[0], None


class ReadFailed(Exception):
    """A read of remote memory failed; the caller knows what its status means."""

    def __init__(self, status: int, error: Any) -> None:
        super().__init__(status)
        self.status = status
        self.error = error


def _read_both(read_table: ReadTable, channel: int, toc: int) -> _Tables:
    ptoc, ptoc_count, broken = _read_one(read_table, channel, toc & 0xFFFF, lib.HM2_PTOC, ffi.NULL, 0)
    if broken is not None:
        raise broken
    gtoc, gtoc_count, gtoc_error = _read_one(read_table, channel, toc >> 16, lib.HM2_GTOC, ptoc, ptoc_count)
    return _Tables(ptoc, ptoc_count, [gtoc[i] for i in range(gtoc_count)], gtoc_error, gtoc)


def _check_sizes(tables: _Tables, channel: int, sizes: tuple[int, int], registers: int) -> None:
    bits, error = ffi.new("uint32_t[2]"), new_error()
    status = lib.hm2_toc_check_sizes(tables.ptoc, tables.ptoc_count, *sizes, registers, bits, bits + 1, error)
    if status != lib.HM2_OK:
        raise broken_table(channel, error)


def _process_fields(tables: _Tables) -> tuple[Field, ...]:
    taken: dict[str, set[str]] = {"in": set(), "out": set()}
    fields = []
    for i in range(tables.ptoc_count):
        record = tables.ptoc[i]
        if record.record_type != RecordType.PROCESS_DATA:
            continue
        kind = _KINDS.get(record.data_type, FieldKind.PAD)
        direction = Direction(record.direction)
        if kind is FieldKind.PAD:
            name = text(record.name)
        else:
            both = direction is Direction.BIDIRECTIONAL
            sides = ["in"] if direction is Direction.INPUT else ["out"]
            name = _unique(text(record.name), [taken[s] for s in (("in", "out") if both else sides)])
        _warn(tables, record, name)
        fields.append(_field(record, name, kind, direction))
    return tuple(fields)


def _parameter_fields(tables: _Tables) -> tuple[Field, ...]:
    """Parameters, and the process data elements as they lie in the remote's memory."""
    taken: set[str] = set()
    fields = []
    for record in tables.gtoc:
        if record.record_type != RecordType.PROCESS_DATA:
            continue
        name = text(record.name)
        if record.data_type not in _KINDS:
            _warn(tables, record, name)
            continue
        kind = _KINDS[record.data_type]
        if kind is FieldKind.PAD or record.bits % 8 or record.bits > 64:
            continue  # process data that no LBP accesses fit
        if record.parameter_address + record.bits // 8 > MEMORY_END:
            at = f"{name!r} at 0x{record.parameter_address:04X}"
            tables.warnings.append(f"record at 0x{record.address:04X}: {at} lies beyond the end of memory")
            continue
        name = _unique(name, [taken])
        _warn(tables, record, name)
        declared = _field(record, name, kind, Direction(record.direction))
        if name.casefold() == "nvbaudrate" and declared.maximum > BAUD_INDEX_MAX:
            declared = replace(declared, maximum=BAUD_INDEX_MAX)
        fields.append(declared)
    return tuple(fields)


def _field(record: Any, name: str, kind: FieldKind, direction: Direction) -> Field:
    return Field(
        name=name,
        kind=kind,
        bits=record.bits,
        direction=direction,
        minimum=record.minimum,
        maximum=record.maximum,
        unit=text(record.unit),
        address=record.parameter_address,
    )


def _unique(name: str, taken: Iterable[set[str]]) -> str:
    """The name, or with a number behind it if it is already there."""
    name = name or "unnamed"
    candidate, number = name, 1
    while any(candidate in names for names in taken):
        number += 1
        candidate = f"{name}_{number}"
    for names in taken:
        names.add(candidate)
    return candidate


def _warn(tables: _Tables, record: Any, name: str) -> None:
    at = f"record at 0x{record.address:04X}"
    original = text(record.name)
    if record.warnings & lib.HM2_TOC_UNKNOWN_TYPE:
        tables.warnings.append(f"{at}: unknown data type 0x{record.data_type:02X}, {original!r} left out")
    if record.warnings & lib.HM2_TOC_UNPRINTABLE:
        tables.warnings.append(f"{at}: unprintable characters in a name or unit, now {name!r}")
    elif name != original:
        tables.warnings.append(f"{at}: the name {original!r} is empty or there twice, now {name!r}")


def _modes(tables: _Tables) -> tuple[list[Mode], tuple[Mode, ...]]:
    """The modes in the PTOC, and all software modes of both tables by index."""
    process = [tables.ptoc[i] for i in range(tables.ptoc_count)]
    here = [_mode(record) for record in process if record.record_type == RecordType.MODE]
    every = here + [_mode(record) for record in tables.gtoc if record.record_type == RecordType.MODE]
    software = {mode.index: mode for mode in every if not mode.hardware}
    return here, tuple(software[index] for index in sorted(software))


def _mode(record: Any) -> Mode:
    return Mode(record.mode_index, record.mode_type == ModeType.HARDWARE, text(record.name))
