"""The two remotes that predate discovery, 8I20 and 7I64. Source: sserial.md 7.2, 7.3; 8I20 manual."""

from __future__ import annotations

from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.sserial.discovery import RemoteDescription

MAX_CURRENT_8I20 = 0x08E8
"""Address of the 8I20's working MAXCURRENT, a word of 10 mA."""

STATUS_8I20 = (
    "current limit",
    "brake on",
    "brake has been on",
    "bus under voltage",
    "watchdog reset",
    "software reset",
    "external reset",
    "",
    "not enabled",
    "PID on",
)
"""Bits of the 8I20's `status`, from bit 0."""

FAULTS_8I20 = (
    "watchdog bitten",
    "not enabled",
    "over temperature",
    "",
    "over current",
    "phase U over current",
    "phase V over current",
    "phase W over current",
    "bus under voltage",
    "bus voltage high",
    "bus over voltage",
    "module fault",
    "",
    "",
    "serial overrun",
    "serial framing",
)
"""Bits of the 8I20's `fault`, from bit 0."""

_IN, _OUT = Direction.INPUT, Direction.OUTPUT
_UNSIGNED, _NONVOL = FieldKind.UNSIGNED, FieldKind.NONVOL_UNSIGNED


def _nonvolatile(name: str, address: int, unit: str = "") -> Field:
    return Field(name, _NONVOL, 16, _OUT, 0, 65535, unit, address)


PARAMETERS_8I20 = (
    Field("swrevision", _UNSIGNED, 16, _IN, 0, 65535, "", 2164),
    Field("unitnumber", _UNSIGNED, 32, _IN, 0, 4294967295, "", 2344),
    _nonvolatile("nvmaxcurrent", 2, "10 mA"),
    _nonvolatile("nvrembaudrate", 6),
    _nonvolatile("nvkqp", 10),
    _nonvolatile("nvkqilo", 12),
    _nonvolatile("nvkqihi", 14),
    _nonvolatile("nvkqil", 16),
    _nonvolatile("nvkdp", 18),
    _nonvolatile("nvkdilo", 20),
    _nonvolatile("nvkdihi", 22),
    _nonvolatile("nvkdil", 24),
    _nonvolatile("nvbusundervmin", 34, "10 mV"),
    _nonvolatile("nvbusundervmax", 36, "10 mV"),
    _nonvolatile("nvbusoverv", 38, "10 mV"),
    _nonvolatile("nvbrakeonv", 40, "10 mV"),
    _nonvolatile("nvbrakeoffv", 42, "10 mV"),
)


def describe_8i20(unit_number: int, max_current: float, software_mode: int = 0) -> RemoteDescription:
    """An 8I20. max_current: its working full scale in A, which is what `current` is scaled by."""
    return RemoteDescription(
        name="8I20",
        unit_number=unit_number,
        software_mode=software_mode,
        fields=(
            Field("angle", _UNSIGNED, 16, _OUT, 0.0, 1.0, "rev"),
            Field("current", FieldKind.SIGNED, 16, _OUT, -max_current, max_current, "A"),
            # counts: the manual says both degrees and hundredths of them
            Field("card-temp", _UNSIGNED, 16, _IN, 0.0, 65535.0, ""),
            Field("bus-voltage", _UNSIGNED, 16, _IN, 0.0, 655.35, "V"),
            Field("status", FieldKind.BITS, 16, _IN),
            Field("fault", FieldKind.BITS, 16, _IN),
        ),
        parameters=PARAMETERS_8I20,
        receive_size=8,
        transmit_size=4,
        fault_word=(1, 0xFFFF0000),
        fault_names=("",) * 16 + FAULTS_8I20,
    )


def describe_7i64(unit_number: int, software_mode: int = 0) -> RemoteDescription:
    """A 7I64: 24 outputs, 24 inputs, two analog inputs of 3.3 V full scale."""
    return RemoteDescription(
        name="7I64",
        unit_number=unit_number,
        software_mode=software_mode,
        fields=(
            Field("output", FieldKind.BITS, 24, _OUT),
            Field("input", FieldKind.BITS, 24, _IN),
            Field("", FieldKind.PAD, 8, _IN),
            Field("analog0", _UNSIGNED, 16, _IN, 0.0, 3.3, "V"),
            Field("analog1", _UNSIGNED, 16, _IN, 0.0, 3.3, "V"),
        ),
        receive_size=8,
        transmit_size=4,
    )
