"""DescribedRemote: an emulated remote made from a description, spoken to by element name.

The remotes of the catalogue are of this kind, and so is any other that a test author writes down.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping

from hostmot2._core import lib
from hostmot2.emulator.description import (
    NONVOLATILE,
    CompiledMode,
    Image,
    RemoteDescription,
    byte_count,
    compile_description,
)
from hostmot2.emulator.remote import EEPROM, FLASH, RAM, EmulatedRemote
from hostmot2.fields import Direction, Field, FieldKind

Value = int | float | bool

WATCHDOG_FAULT = 0x01
TABLE_PAGE = 0x800
CRC_CAPABLE, EEPROM_CAPABLE, FLASH_CAPABLE = 0x01, 0x04, 0x08


class DescribedRemote(EmulatedRemote):
    """A remote that behaves like a card: watchdog, faults, modes, EEPROM, self-description.

    Freshly powered it reports fault 0x01 and keeps its outputs off until the fault is cleared, as Mesa's
    cards do. Time for its watchdog is the time of the board it is attached to.

    Args:
        description: what it is.
        unit_number: 32 bits instead of the description's.
        setup_jumper: the card's set-up jumper: fixed 115200 baud, frames end after 25.5 characters of
            silence instead of 4.
        turnaround_us: middle of the command's last stop bit to the start bit of the answer.

    Raises:
        ValueError: the description does not fit into a remote's memory.
    """

    def __init__(
        self,
        description: RemoteDescription,
        *,
        unit_number: int | None = None,
        setup_jumper: bool = False,
        turnaround_us: float = 3.0,
    ) -> None:
        self.description = description
        self.image: Image = compile_description(description)
        first = self.image.modes[0]
        unit = description.unit_number if unit_number is None else unit_number
        super().__init__(
            name=description.name,
            unit_number=unit,
            receive_size=first.receive_size,
            transmit_size=first.transmit_size,
            ptoc=first.ptoc,
            gtoc=first.gtoc,
            turnaround_us=turnaround_us,
            model=description.model,
        )
        self.revision = description.revision
        self.hardware_mode = description.hardware_mode[0]
        self._fill_memory(unit)
        self._wire_parameters()
        self._add_modes()
        self._set(lib.HM2_REMOTE_FAULT_GATES, int(description.gated))
        self._set(lib.HM2_REMOTE_FAULT_AT_RESET, WATCHDOG_FAULT if description.gated else 0)
        self._set(lib.HM2_REMOTE_SETUP_MODE, int(setup_jumper))
        self.power_cycle()

    # -- construction

    def _fill_memory(self, unit: int) -> None:
        for address, data in self.image.ram.items():
            self._check(lib.hm2_remote_load(self._remote, address, data, len(data)))
        if self.image.eeprom:
            self._check(lib.hm2_remote_add_eeprom(self._remote, len(self.image.eeprom)))
            self.poke(0, bytes(self.image.eeprom), space=EEPROM)
            self._allow(EEPROM, 0, len(self.image.eeprom) - 1)
        for source, target, size in self.image.copies:
            self._check(lib.hm2_remote_add_copy(self._remote, source, target, size))
        for name in ("nvunitnumber", "unitnumber"):
            parameter = self.image.parameters.get(name)
            if parameter is not None:
                data = unit.to_bytes(4, "little")
                if parameter.kind in NONVOLATILE:
                    self.poke(parameter.address, data, space=EEPROM)
                else:
                    self._check(lib.hm2_remote_load(self._remote, parameter.address, data, 4))
        self._limit_ram()

    def _allow(self, space: int, first: int, last: int, writable: bool = True) -> None:
        self._check(lib.hm2_remote_allow(self._remote, space, first, last, writable))

    def _limit_ram(self) -> None:
        """Tables can be read, not written; behind the last page there is nothing."""
        if self.description.readable is not None:
            self._allow(RAM, *self.description.readable)
            return
        tables = min(self.image.records.values(), default=self.image.ram_end)
        end = min(-(-(self.image.ram_end + 8) // TABLE_PAGE) * TABLE_PAGE, 0x10000)
        if tables >= 1:
            self._allow(RAM, 0, min(tables, end) - 1)
        self._allow(RAM, 0, end - 1, writable=not self.image.records)

    def _wire_parameters(self) -> None:
        described, parameters = self.description, self.image.parameters
        self._set(lib.HM2_REMOTE_WATCHDOG_PS, round(described.watchdog_us * 1e6))
        self._set(lib.HM2_REMOTE_WATCHDOG_UNIT_PS, round(described.watchdog_unit_us * 1e6))
        for name, knob in (
            ("watchdogtime", lib.HM2_REMOTE_WATCHDOG_ADDRESS),
            ("unitnumber", lib.HM2_REMOTE_UNIT_ADDRESS),
            ("nvbaudrate", lib.HM2_REMOTE_BAUD_ADDRESS),
            ("nvcrcenable", lib.HM2_REMOTE_CRC_ADDRESS),
            ("nvpwmrate", lib.HM2_REMOTE_PWM_ADDRESS),
            ("fault", lib.HM2_REMOTE_FAULT_ADDRESS),
        ):
            if name in parameters and not (name == "fault" and described.model == "8i20"):
                self._set(knob, parameters[name].address)
        self._set(lib.HM2_REMOTE_SUPERVISED, int(described.model == "8i20"))
        capability = CRC_CAPABLE | (EEPROM_CAPABLE if self.image.eeprom else 0)
        if described.flash is not None:
            self._check(lib.hm2_remote_add_flash(self._remote, *described.flash))
            capability |= FLASH_CAPABLE
        self._set(lib.HM2_REMOTE_CAPABILITY, capability)

    def _add_modes(self) -> None:
        for mode in self.image.modes:
            self._check(
                lib.hm2_remote_add_mode(
                    self._remote, mode.index, mode.receive_size, mode.transmit_size, mode.ptoc, mode.gtoc
                )
            )
            for element in mode.fields:
                self._check(
                    lib.hm2_remote_add_element(
                        self._remote, mode.index, element.bits, element.direction, element.address
                    )
                )

    @property
    def setup_jumper(self) -> bool:
        """The card's set-up jumper; a change takes effect at the next power cycle."""
        return bool(self._get(lib.HM2_REMOTE_SETUP_MODE))

    @setup_jumper.setter
    def setup_jumper(self, in_place: bool) -> None:
        self._set(lib.HM2_REMOTE_SETUP_MODE, int(in_place))

    # -- process data and parameters by name

    @property
    def mode(self) -> CompiledMode:
        """The software mode in force: the last legal one."""
        wanted = self.software_mode
        for mode in self.image.modes:
            if mode.index == wanted:
                return mode
        return self.image.modes[0]

    @property
    def elements(self) -> dict[str, Field]:
        """The elements of the software mode in force, in packing order, by name as the tables spell it."""
        return {field.name: field for field in self.mode.fields if field.kind is not FieldKind.PAD}

    @property
    def parameters(self) -> dict[str, Field]:
        """All parameters by name as the tables spell it; non-volatile kinds live in EEPROM."""
        return {field.name: field for field in self.image.parameters.values()}

    def field(self, name: str) -> Field:
        """The declaration of an element or parameter, by name in any capitals. KeyError: no such name."""
        wanted = name.lower()
        if wanted in self.image.parameters:
            return self.image.parameters[wanted]
        for mode in (self.mode, *self.image.modes):
            for field in mode.fields:
                if field.name.lower() == wanted and field.kind is not FieldKind.PAD:
                    return field
        known = ", ".join([*self.elements, *self.parameters])
        raise KeyError(f"{self.name} has no {name!r}; it has {known}")

    def get_raw(self, name: str) -> int:
        """The bits of an element or parameter as an unsigned integer. KeyError: no such name."""
        field = self.field(name)
        space = EEPROM if field.kind in NONVOLATILE else RAM
        return int.from_bytes(self.peek(field.address, byte_count(field.bits), space=space), "little")

    def set_raw(self, name: str, raw: int) -> None:
        """Set the bits of an input, a bidirectional element or a parameter.

        ValueError: an output (the host's), or bits beyond the element's width. KeyError: no such name.
        """
        field = self.field(name)
        if field.direction is Direction.OUTPUT and field.name.lower() not in self.image.parameters:
            raise ValueError(f"{self.name} {field.name} is an output: only the host sets it")
        if not 0 <= raw < 1 << field.bits:
            raise ValueError(f"{self.name} {field.name}: {raw:#x} has more than {field.bits} bits")
        space = EEPROM if field.kind in NONVOLATILE else RAM
        self.poke(field.address, raw.to_bytes(byte_count(field.bits), "little"), space=space)

    def get(self, name: str) -> Value:
        """An element or parameter in its unit: int for bits and counts, bool, or float.

        Names in any capitals. KeyError: no such name.
        """
        return decode(self.field(name), self.get_raw(name))

    def set(self, name: str, value: Value) -> None:
        """Set an input, a bidirectional element or a parameter, in its unit.

        Scaled values are rounded to the nearest raw value and limited to the element's range, counters wrap.
        ValueError: an output, NaN, or more bits than there are. KeyError: no such name.
        """
        self.set_raw(name, encode(self.field(name), value))

    # -- what outlives a power cycle

    @property
    def nonvolatile(self) -> dict[str, bytes]:
        """EEPROM and flash, under these names; assign to restore a saved state, effective at power-up.

        Raises ValueError for memory that this remote does not have or that has another size.
        """
        state = {"eeprom": self.peek(0, len(self.image.eeprom), space=EEPROM)} if self.image.eeprom else {}
        if self.description.flash is not None:
            state["flash"] = self.peek(0, self.description.flash[0], space=FLASH)
        return state

    @nonvolatile.setter
    def nonvolatile(self, state: Mapping[str, bytes]) -> None:
        have = self.nonvolatile
        for name, data in state.items():
            if name not in have or len(data) != len(have[name]):
                raise ValueError(f"{self.name}: no {name} of {len(data)} bytes")
        for name, data in state.items():
            self.poke(0, data, space=EEPROM if name == "eeprom" else FLASH)

    # -- faults of the device

    def corrupt(self, what: str) -> None:
        """Break the self-description until the next power cycle.

        what: "record_type", "bits", "data_type", "direction", "limits", "pointer" or "string" of the first
        element's record, "endless" (a PTOC that never ends), "loop" (a PTOC that lists one record for ever).
        ValueError: none of these, or a remote without tables.
        """
        if what not in CORRUPTIONS or not self.image.records:
            raise ValueError(f"corrupt({what!r}): not one of {', '.join(CORRUPTIONS)}, or no tables")
        CORRUPTIONS[what](self)

    def _first_record(self) -> int:
        return self.image.records[next(iter(self.elements)).lower()]


def decode(field: Field, raw: int) -> Value:
    """Raw bits to the value they stand for on the remote's side (sserial.md 6)."""
    kind, n = field.kind, field.bits
    if kind is FieldKind.BOOLEAN:
        return raw != 0
    if kind in (FieldKind.FLOAT, FieldKind.NONVOL_FLOAT):
        (value,) = struct.unpack("<f" if n == 32 else "<d", raw.to_bytes(byte_count(n), "little"))
        return float(value)
    if kind in (FieldKind.UNSIGNED, FieldKind.NONVOL_UNSIGNED) and _is_scaled(field, (1 << n) - 1):
        return raw * (field.maximum - field.minimum) / ((1 << n) - 1) + field.minimum
    if kind in (FieldKind.SIGNED, FieldKind.NONVOL_SIGNED):
        signed = raw - (1 << n) if raw >> (n - 1) else raw
        top = (1 << (n - 1)) - 1
        return max(field.minimum, signed * field.maximum / top) if _is_scaled(field, top) else signed
    return raw


def encode(field: Field, value: Value) -> int:
    """A value to the raw bits that stand for it on the remote's side (sserial.md 6)."""
    kind, n = field.kind, field.bits
    if kind is FieldKind.BOOLEAN:
        return (1 << n) - 1 if value else 0
    if kind in (FieldKind.FLOAT, FieldKind.NONVOL_FLOAT):
        return int.from_bytes(struct.pack("<f" if n == 32 else "<d", value), "little")
    if isinstance(value, float) and math.isnan(value):
        raise ValueError(f"{field.name}: not a number")
    if kind in (FieldKind.UNSIGNED, FieldKind.NONVOL_UNSIGNED) and _is_scaled(field, (1 << n) - 1):
        limited = min(max(value, field.minimum), field.maximum)
        return round((limited - field.minimum) * ((1 << n) - 1) / (field.maximum - field.minimum))
    if kind in (FieldKind.SIGNED, FieldKind.NONVOL_SIGNED):
        top = (1 << (n - 1)) - 1
        if _is_scaled(field, top):
            value = min(max(value, field.minimum), field.maximum) * top / field.maximum
        return round(min(max(value, -top - 1), top)) % (1 << n)
    if kind is FieldKind.ENCODER:
        return round(value) % (1 << n)
    return round(value)


def _is_scaled(field: Field, top: int) -> bool:
    """Whether raw and value differ: there are limits and they are not those of the integer itself."""
    return field.maximum != field.minimum and field.maximum != top


def _poke_record(offset: int, data: bytes) -> Callable[[DescribedRemote], None]:
    def corrupt(remote: DescribedRemote) -> None:
        remote.poke(remote._first_record() + offset, data)

    return corrupt


def _endless(remote: DescribedRemote) -> None:
    record = remote._first_record().to_bytes(2, "little")
    remote.poke(remote.mode.ptoc, record * ((0x10000 - remote.mode.ptoc) // 2))


def _loop(remote: DescribedRemote) -> None:
    remote.poke(remote.mode.ptoc, remote._first_record().to_bytes(2, "little") * 300)


CORRUPTIONS: dict[str, Callable[[DescribedRemote], None]] = {
    "record_type": _poke_record(0, b"\xa5"),
    "bits": _poke_record(1, b"\x00"),
    "data_type": _poke_record(2, b"\x77"),
    "direction": _poke_record(3, b"\x20"),
    "limits": _poke_record(4, b"\x00\x00\xc0\x7f"),
    "pointer": lambda remote: remote.poke(remote.mode.ptoc, b"\xff\xff"),
    "string": _poke_record(14, b"x" * 200),
    "endless": _endless,
    "loop": _loop,
}

__all__ = ["DescribedRemote", "Value", "decode", "encode"]
