"""Declarations of the 8I20's parameters: address, type, scale, unit, default.

The drive predates discovery and cannot name them itself. EEPROM addresses, and SWREVISION, UNITNUMBER and
MAXCURRENT in RAM, are confirmed by two sources; the other RAM addresses are derived from the order in which
the drive's variables are declared (they reproduce those three). Firmware versions may differ: check
SWREVISION. Source: 8I20 manual, parameters and fault conditions; lbp_serial.md 6; sserial.md 7.2.
"""

from __future__ import annotations

from hostmot2.fields import Direction, FieldKind, ParameterField

VOLT, AMPERE = (0.01, "V"), (0.01, "A")
_TOP = {FieldKind.SIGNED: (-0x8000, 0x7FFF)}
_CONFIRMED = {"SWREVISION", "UNITNUMBER", "MAXCURRENT"}


def _ram(
    name: str,
    address: int,
    kind: FieldKind = FieldKind.UNSIGNED,
    bits: int = 16,
    *,
    count: tuple[float, str] = (0.0, ""),
    default: int | None = None,
    direction: Direction = Direction.BIDIRECTIONAL,
    clears_itself: bool = False,
) -> ParameterField:
    low, high = _TOP.get(kind, (0, (1 << bits) - 1))
    return ParameterField(
        name,
        kind,
        bits,
        direction,
        low,
        high,
        count[1],
        address,
        scale=count[0],
        default=default,
        derived=name not in _CONFIRMED,
        clears_itself=clears_itself,
    )


def _nv(
    name: str,
    address: int,
    working: str = "",
    *,
    count: tuple[float, str] = (0.0, ""),
    bits: int = 16,
    default: int | None = None,
    high: int | None = None,
    signed: bool = False,
) -> ParameterField:
    kind = FieldKind.NONVOL_SIGNED if signed else FieldKind.NONVOL_UNSIGNED
    low, top = (-0x8000, 0x7FFF) if signed else (0, (1 << bits) - 1)
    return ParameterField(
        name,
        kind,
        bits,
        Direction.BIDIRECTIONAL,
        low,
        top if high is None else high,
        count[1],
        address,
        scale=count[0],
        default=default,
        working=working,
    )


_SIGNED, _FLAG, _IN = FieldKind.SIGNED, FieldKind.BITS, Direction.INPUT

EEPROM: tuple[ParameterField, ...] = (
    _nv("NVMAXMODULEI", 0, "MAXMODULEI"),
    _nv("NVMAXCURRENT", 2, "MAXCURRENT", count=AMPERE),
    _nv("NVBAUDRATE", 4, default=9, high=11),
    _nv("NVREMBAUDRATE", 6),
    _nv("NVCRCENABLE", 8),
    _nv("NVKQP", 10, "KQP", default=50),
    _nv("NVKQI", 12, "KQI", bits=32, default=150_000),
    _nv("NVKQIL", 16, "KQIL"),
    _nv("NVKDP", 18, "KDP", default=50),
    _nv("NVKDI", 20, "KDI", bits=32, default=150_000),
    _nv("NVKDIL", 24, "KDIL"),
    _nv("NVQSETPOINT", 26, "QSETPOINT", signed=True),
    _nv("NVDSETPOINT", 28, "DSETPOINT", signed=True),
    _nv("NVDEADZONE", 30, "DEADZONE"),
    _nv("NVFAULTMASK", 32, "FAULTMASK"),
    _nv("NVBUSUNDERVMIN", 34, "BUSUNDERVMIN", count=VOLT),
    _nv("NVBUSUNDERVMAX", 36, "BUSUNDERVMAX", count=VOLT),
    _nv("NVBUSOVERV", 38, "BUSOVERV", count=VOLT, default=38500),
    _nv("NVBRAKEONV", 40, "BRAKEONV", count=VOLT, default=36000),
    _nv("NVBRAKEOFFV", 42, "BRAKEOFFV", count=VOLT, default=34000),
    _nv("NVPWMRATE", 44, default=12_000),
    _nv("NVTEMPILIMIT", 46, "TEMPILIMIT"),
    _nv("NVTEMPISLOPE", 48, "TEMPISLOPE"),
    _nv("NVINTEGBOUND", 50, "INTEGBOUND"),
    _nv("NVCOOKIE", 126),
)
"""Memory space 1; effective after the next power-up."""

RAM: tuple[ParameterField, ...] = (
    _ram("PIDENA", 0x804, _FLAG),
    _ram("DRIVEMODE", 0x806, _FLAG),
    _ram("PWM", 0x808, _SIGNED),
    _ram("KQP", 0x812, default=50),
    _ram("KQI", 0x814, bits=32, default=150_000),
    _ram("KQIL", 0x818),
    _ram("KDP", 0x81A, default=50),
    _ram("KDI", 0x81C, bits=32, default=150_000),
    _ram("KDIL", 0x820),
    _ram("IU", 0x822, _SIGNED, direction=_IN),
    _ram("IV", 0x824, _SIGNED, direction=_IN),
    _ram("IW", 0x826, _SIGNED, direction=_IN),
    _ram("BUSV", 0x828, count=VOLT, direction=_IN),
    _ram("RAWTEMPERATURE", 0x82A, direction=_IN),
    _ram("TEMPERATURE", 0x82C, count=(0.01, "degC"), direction=_IN),
    _ram("GAIN", 0x82E),
    _ram("ANGLE", 0x830, count=(1 / 65536, "rev")),
    _ram("DEADZONE", 0x840),
    _ram("ID", 0x846, _SIGNED, direction=_IN),
    _ram("IQ", 0x848, _SIGNED, direction=_IN),
    _ram("ILIMITMUL", 0x850),
    _ram("FAULT", 0x852, _FLAG, direction=_IN),
    _ram("CLEARFAULT", 0x854, _FLAG, clears_itself=True),
    _ram("FAULTMASK", 0x858, _FLAG),
    _ram("WATCHDOGTIME", 0x85C, count=(1.0, "PWM periods"), default=500),
    _ram("QSETPOINT", 0x860, _SIGNED),
    _ram("DSETPOINT", 0x862, _SIGNED),
    _ram("BUSUNDERVMIN", 0x864, count=VOLT),
    _ram("BUSUNDERVMAX", 0x866, count=VOLT),
    _ram("BUSOVERV", 0x868, count=VOLT, default=38500),
    _ram("BRAKEONV", 0x86A, count=VOLT, default=36000),
    _ram("BRAKEOFFV", 0x86C, count=VOLT, default=34000),
    _ram("STATUS", 0x86E, _FLAG),
    _ram("CPUTYPE", 0x870, direction=_IN),
    _ram("CONTROLTYPE", 0x872, direction=_IN),
    _ram("SWREVISION", 0x874, direction=_IN),
    _ram("SYSCLK", 0x876, bits=32, direction=_IN),
    _ram("HWREVISION", 0x886, direction=_IN),
    _ram("TEMPILIMIT", 0x8E2),
    _ram("TEMPISLOPE", 0x8E4),
    _ram("MAXMODULEI", 0x8E6),
    _ram("MAXCURRENT", 0x8E8, count=AMPERE),
    _ram("PIDON", 0x8FE, _FLAG, direction=_IN),
    _ram("INTEGBOUND", 0x900),
    _ram("UNITNUMBER", 0x928, bits=32),
)
"""Memory space 0: the working parameters, lost at power-down."""

PARAMETERS = (*EEPROM, *RAM)

MAX_CURRENT = 0x08E8
"""Address of MAXCURRENT, by which the process data element `current` is scaled."""

ALIASES = {"BUSUNDERV": "BUSUNDERVMIN", "NVBUSUNDERV": "NVBUSUNDERVMIN", "QISETPOINT": "QSETPOINT"}
"""Names in the manual's text -> names of the drive's variables."""

STATUS = (
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
"""Bits of STATUS, from bit 0."""

FAULTS = (
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
"""Bits of FAULT, from bit 0."""
