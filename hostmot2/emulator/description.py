"""A remote in Python: its elements, software modes and parameters, compiled to a memory image.

The image holds what a real remote's memory would: process data and working parameters in RAM, non-volatile
parameters in EEPROM, and the self-description (records, PTOC and GTOC) that a driver discovers. Addresses
that a description leaves open are chosen here and mean nothing on real hardware. Source: sserial.md 5.1, 5.2.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from hostmot2.fields import Direction, Field, FieldKind

RECORD_PROCESS_DATA = 0xA0
RECORD_MODE = 0xB0
HARDWARE_MODE = 0
SOFTWARE_MODE = 1

NONVOLATILE = (FieldKind.NONVOL_UNSIGNED, FieldKind.NONVOL_SIGNED, FieldKind.NONVOL_FLOAT)
PARAMETER_KINDS = (FieldKind.UNSIGNED, FieldKind.SIGNED, FieldKind.FLOAT)
PARAMETER_BITS = (8, 16, 32, 64)


@dataclass(frozen=True, slots=True)
class SoftwareMode:
    """A software mode: the process data, in packing order, that the remote exchanges in it.

    The sizes follow from the fields; give them where the remote moves more bytes than that (receive_size with
    the fault byte).
    """

    index: int
    name: str
    fields: tuple[Field, ...]
    receive_size: int | None = None
    transmit_size: int | None = None


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter and the raw value it has when the remote leaves the factory.

    Non-volatile kinds live in EEPROM. `working` names the parameter in RAM that takes the value over at
    power-up. `listed` False keeps it out of the GTOC.
    """

    field: Field
    value: int = 0
    working: str | None = None
    listed: bool = True


@dataclass(frozen=True, slots=True)
class RemoteDescription:
    """Everything that makes a remote.

    Parameters of these names have their effect, in any capitals: WatchDogTime (RAM, units of
    `watchdog_unit_us`, 0 is off), UnitNumber (RAM, 32 bits), NVUnitNumber, NVBaudRate (baud index, EEPROM),
    NVCrcEnable (EEPROM, 0: no CRC), NVPwmRate (EEPROM, Hz, the watchdog's unit), Fault (RAM, 16 bits).

    Attributes:
        name: card name, up to four ASCII characters.
        unit_number: 32 bits; its top byte is a device code on Mesa's newer cards.
        modes: at least one; the first is the one after power-up. Any other index is illegal (fault 0x40).
        parameters: what the GTOC lists besides the process data.
        hardware_mode: index and name.
        gated: outputs stay off while there is a fault, and there is one (0x01) after power-up.
        watchdog_us: the watchdog's time without a WatchDogTime parameter; 0 is off.
        model: "8i20" or "7i64" for the two that predate discovery.
        ptoc, gtoc, tables_at, ram_at: where to put things; None leaves it open.
        modes_in_ptoc: whether the PTOC begins with the current hardware and software mode.
        globals_listed: whether the GTOC lists anything at all.
        flash: size in bytes, log2 of the erase block and of the write block; None: no flash.
        readable: RAM that can be read through the line, first and last address; None: what is used.
        invented: what of this description is ours because no source tells.
    """

    name: str
    unit_number: int
    modes: tuple[SoftwareMode, ...]
    parameters: tuple[Parameter, ...] = ()
    hardware_mode: tuple[int, str] = (0, "Standard")
    revision: int = 0
    gated: bool = True
    watchdog_us: float = 0.0
    watchdog_unit_us: float = 1000.0
    model: str | None = None
    ptoc: int | None = None
    gtoc: int | None = None
    tables_at: int = 0x0800
    ram_at: int = 0x0010
    modes_in_ptoc: bool = True
    globals_listed: bool = True
    flash: tuple[int, int, int] | None = (0x20000, 10, 8)
    readable: tuple[int, int] | None = None
    invented: str = ""


@dataclass(frozen=True, slots=True)
class CompiledMode:
    """A software mode with every address in place."""

    index: int
    receive_size: int
    transmit_size: int
    ptoc: int
    gtoc: int
    fields: tuple[Field, ...]


@dataclass(slots=True)
class Image:
    """A description as the remote's memory."""

    ram: dict[int, bytes] = field(default_factory=dict)
    eeprom: bytearray = field(default_factory=bytearray)
    modes: list[CompiledMode] = field(default_factory=list)
    parameters: dict[str, Field] = field(default_factory=dict)
    copies: list[tuple[int, int, int]] = field(default_factory=list)
    records: dict[str, int] = field(default_factory=dict)
    ram_end: int = 0

    def store(self, address: int, data: bytes) -> None:
        """Put bytes into RAM."""
        self.ram[address] = data
        self.ram_end = max(self.ram_end, address + len(data))


def byte_count(bits: int) -> int:
    """Bytes an element or parameter of that many bits takes in the remote's memory."""
    return (bits + 7) // 8


def process_record(element: Field) -> bytes:
    """The descriptor of an element or parameter as it lies in a remote's memory."""
    head = struct.pack(
        "<BBBBffH",
        RECORD_PROCESS_DATA,
        element.bits,
        element.kind,
        element.direction,
        element.minimum,
        element.maximum,
        element.address,
    )
    return head + element.unit.encode("ascii") + b"\0" + element.name.encode("ascii") + b"\0"


def mode_record(index: int, kind: int, name: str) -> bytes:
    """The descriptor of a hardware or software mode as it lies in a remote's memory."""
    return bytes([RECORD_MODE, index, kind, 0]) + name.encode("ascii") + b"\0"


class _Allocator:
    """Hands out addresses upwards, aligned to the size of what is stored (8 at most)."""

    def __init__(self, start: int) -> None:
        self.next = start

    def take(self, size: int) -> int:
        alignment = 1 << (min(size, 8) - 1).bit_length() if size > 1 else 1
        self.next = -(-self.next // alignment) * alignment
        address = self.next
        self.next += size
        return address


def compile_description(description: RemoteDescription) -> Image:
    """Lay a remote out in memory.

    Raises ValueError when it does not fit: more than 255 bytes a way, tables over 64 KiB, EEPROM over 4 KiB.
    """
    image = Image()
    _place_parameters(description, image)
    modes = _place_elements(description, image)
    if description.model is None:
        _write_tables(description, image, modes)
    else:
        image.modes = [_sized(description, mode, 0, 0) for mode in modes]
    if image.ram_end > 0x10000 or len(image.eeprom) > 4096:
        raise ValueError(f"{description.name}: the description does not fit into the remote's memory")
    return image


def _place_parameters(description: RemoteDescription, image: Image) -> None:
    ram, eeprom = _Allocator(description.ram_at), _Allocator(0)
    for parameter in description.parameters:
        size = byte_count(parameter.field.bits)
        nonvolatile = parameter.field.kind in NONVOLATILE
        address = parameter.field.address
        if nonvolatile:
            # 0 is a good EEPROM address; only the first parameter can ask for it.
            address = address or eeprom.take(size)
            eeprom.next = max(eeprom.next, address + size)
            image.eeprom.extend(bytes(max(0, address + size - len(image.eeprom))))
            image.eeprom[address : address + size] = parameter.value.to_bytes(size, "little")
        else:
            address = address or ram.take(size)
            image.store(address, parameter.value.to_bytes(size, "little"))
        image.parameters[parameter.field.name.lower()] = replace(parameter.field, address=address)
    for parameter in description.parameters:
        if parameter.working:
            source = image.parameters[parameter.field.name.lower()]
            target = image.parameters[parameter.working.lower()]
            image.copies.append((source.address, target.address, byte_count(source.bits)))
    image.ram_end = max(image.ram_end, ram.next)


def _place_elements(description: RemoteDescription, image: Image) -> list[SoftwareMode]:
    """Elements of one name share their place in all modes; narrower ones are its low bits."""
    ram = _Allocator(image.ram_end)
    widest: dict[tuple[str, Direction], int] = {}
    for element in _elements(description):
        key = (element.name.lower(), element.direction)
        widest[key] = max(widest.get(key, 0), element.bits)
    places: dict[tuple[str, Direction], int] = {}
    for element in _elements(description):
        key = (element.name.lower(), element.direction)
        if element.kind is FieldKind.PAD or key in places:
            continue
        parameter = image.parameters.get(element.name.lower())
        if element.address:
            places[key] = element.address
        elif parameter is not None and parameter.bits >= element.bits:
            # The parameter shows more of the same value: the element is its upper bytes.
            places[key] = parameter.address + byte_count(parameter.bits) - byte_count(element.bits)
        else:
            places[key] = ram.take(byte_count(widest[key]))
    image.ram_end = max([image.ram_end, ram.next])
    return [
        replace(
            mode,
            fields=tuple(
                replace(element, address=places.get((element.name.lower(), element.direction), 0))
                if element.kind is not FieldKind.PAD
                else element
                for element in mode.fields
            ),
        )
        for mode in description.modes
    ]


def _elements(description: RemoteDescription) -> Iterable[Field]:
    return (element for mode in description.modes for element in mode.fields)


def _sized(description: RemoteDescription, mode: SoftwareMode, ptoc: int, gtoc: int) -> CompiledMode:
    input_bits = sum(e.bits for e in mode.fields if e.direction != Direction.OUTPUT)
    output_bits = sum(e.bits for e in mode.fields if e.direction != Direction.INPUT)
    fault_bytes = 0 if description.model else 1
    receive = mode.receive_size if mode.receive_size is not None else byte_count(input_bits) + fault_bytes
    transmit = mode.transmit_size if mode.transmit_size is not None else byte_count(output_bits)
    if receive > 255 or transmit > 255:
        raise ValueError(f"{description.name} mode {mode.index}: more than 255 bytes of process data")
    return CompiledMode(mode.index, receive, transmit, ptoc, gtoc, mode.fields)


def _write_tables(description: RemoteDescription, image: Image, modes: list[SoftwareMode]) -> None:
    """Records first, then a PTOC and a GTOC for every software mode."""
    tables = _Allocator(max(description.tables_at, image.ram_end + image.ram_end % 2))
    known: dict[bytes, int] = {}

    def record(name: str, data: bytes) -> int:
        if data not in known:
            known[data] = tables.take(len(data) + len(data) % 2)
            image.store(known[data], data)
            image.records.setdefault(name.lower(), known[data])
        return known[data]

    hardware = record(
        "hardware mode", mode_record(description.hardware_mode[0], 0, description.hardware_mode[1])
    )
    software = [
        record(f"software mode {mode.index}", mode_record(mode.index, SOFTWARE_MODE, mode.name))
        for mode in modes
    ]
    contents = []
    for number, mode in enumerate(modes):
        own = [record(element.name, process_record(element)) for element in mode.fields]
        ptoc = [hardware, software[number], *own] if description.modes_in_ptoc else own
        gtoc = [
            record(element.name, process_record(element))
            for element in _globals(description, image, modes, mode)
        ]
        contents.append((ptoc, [*gtoc, *own, *software] if description.globals_listed else []))
    single = len(modes) == 1
    for (ptoc, gtoc), mode in zip(contents, modes, strict=True):
        places = []
        for fixed, pointers in ((description.ptoc, ptoc), (description.gtoc, gtoc)):
            data = struct.pack(f"<{len(pointers) + 1}H", *pointers, 0)
            places.append(fixed if fixed is not None and single else tables.take(len(data) + len(data) % 2))
            image.store(places[-1], data)
        image.modes.append(_sized(description, mode, *places))


def _globals(
    description: RemoteDescription, image: Image, modes: list[SoftwareMode], current: SoftwareMode
) -> list[Field]:
    """Parameters, and the elements of other modes that can be read like one; none that is in the PTOC."""
    taken = {element.name.lower() for element in current.fields}
    found = []
    listed = [image.parameters[p.field.name.lower()] for p in description.parameters if p.listed]
    for candidate in [*listed, *(element for mode in modes for element in mode.fields)]:
        is_parameter = any(candidate is parameter for parameter in listed)
        readable = candidate.kind in PARAMETER_KINDS and candidate.bits in PARAMETER_BITS
        if candidate.name.lower() not in taken and (is_parameter or readable):
            taken.add(candidate.name.lower())
            found.append(candidate)
    return found
