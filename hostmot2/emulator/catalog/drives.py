"""8I20: the servo drive that predates discovery (8I20 manual; sserial.md 7.2; lbp_serial.md 6).

Addresses and types are declared in `hostmot2.drive_8i20`, which the driver knows the drive by, too.
"""

from hostmot2 import drive_8i20
from hostmot2.emulator.catalog.parts import NO_UNIT
from hostmot2.emulator.description import Parameter, RemoteDescription, SoftwareMode
from hostmot2.fields import Direction, Field, FieldKind, ParameterField

PWM_HZ = 12_000
TEN_MILLI = 655.35
SCALED = ("V", "A", "degC")
"""Units that the emulated drive's values are given in; all others are counts."""

_AT_POWER_UP = {
    "BUSV": 32000,
    "TEMPERATURE": 3000,
    "ILIMITMUL": 0xFFFF,
    "WATCHDOGTIME": 500,
    "SWREVISION": 0x0019,
    "SYSCLK": 60_000_000,
}

_FROM_THE_FACTORY = {
    "NVMAXMODULEI": 3000,
    "NVMAXCURRENT": 750,
    "NVBAUDRATE": 9,
    "NVREMBAUDRATE": 9,
    "NVCRCENABLE": 0xFFFF,
    "NVKQP": 50,
    "NVKQI": 150_000,
    "NVKQIL": 0x7FFF,
    "NVKDP": 50,
    "NVKDI": 150_000,
    "NVKDIL": 0x7FFF,
    "NVFAULTMASK": 0xFFFF,
    "NVBUSUNDERVMIN": 3500,
    "NVBUSUNDERVMAX": 3700,
    "NVBUSOVERV": 38500,
    "NVBRAKEONV": 36000,
    "NVBRAKEOFFV": 34000,
    "NVPWMRATE": PWM_HZ,
    "NVTEMPILIMIT": 7000,
    "NVTEMPISLOPE": 100,
    "NVINTEGBOUND": 0x7FFF,
    "NVCOOKIE": 0x5A5A,
}


def _parameter(declared: ParameterField) -> Parameter:
    """As the drive's memory holds it; limits in the unit, as everywhere in the catalogue."""
    top = declared.maximum * (declared.scale if declared.unit in SCALED else 1)
    signed = declared.kind in (FieldKind.SIGNED, FieldKind.NONVOL_SIGNED)
    field = Field(
        declared.name,
        declared.kind,
        declared.bits,
        Direction.BIDIRECTIONAL,
        0.0,
        0.0 if signed else float(top),
        declared.unit or NO_UNIT,
        declared.address,
    )
    value = (_AT_POWER_UP | _FROM_THE_FACTORY).get(declared.name, 0)
    return Parameter(field, value, declared.working or None)


def _element(name: str, kind: FieldKind, direction: Direction, address: int, top: float, unit: str) -> Field:
    return Field(name, kind, 16, direction, 0.0, top, unit, address)


MESA_8I20 = RemoteDescription(
    name="8I20",
    unit_number=0x0000_001F,
    modes=(
        SoftwareMode(
            0,
            "Standard",
            (
                _element("Angle", FieldKind.UNSIGNED, Direction.OUTPUT, 0x830, 65535.0, NO_UNIT),
                _element("QSetpoint", FieldKind.SIGNED, Direction.OUTPUT, 0x860, 0.0, NO_UNIT),
                _element("Status", FieldKind.UNSIGNED, Direction.INPUT, 0x86E, 65535.0, NO_UNIT),
                _element("Fault", FieldKind.UNSIGNED, Direction.INPUT, 0x852, 65535.0, NO_UNIT),
                _element("BusV", FieldKind.UNSIGNED, Direction.INPUT, 0x828, TEN_MILLI, "V"),
                _element("Temperature", FieldKind.UNSIGNED, Direction.INPUT, 0x82C, TEN_MILLI, "degC"),
            ),
        ),
    ),
    parameters=tuple(_parameter(declared) for declared in drive_8i20.PARAMETERS),
    revision=0x19,
    watchdog_unit_us=1e6 / PWM_HZ,
    model="8i20",
    ram_at=0x0A00,
    readable=(0x0800, 0x0BFF),
    invented="start values of everything but BRAKEONV, BRAKEOFFV, KQP, KQI, KDP, KDI, BUSOVERV, the baud "
    "index and the watchdog time; bus voltage and temperature at rest; currents in 10 mA, "
    "the law of the temperature limit, hysteresis of the bus under voltage between MIN and MAX",
)

CATALOG = {"8i20": MESA_8I20}
