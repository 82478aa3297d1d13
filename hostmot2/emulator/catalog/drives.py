"""8I20: the servo drive that predates discovery (8I20 manual; sserial.md 7.2; lbp_serial.md 6).

EEPROM addresses and the RAM addresses of SWREVISION, UNITNUMBER and MAXCURRENT are the real ones; the other
RAM addresses are derived from the declaration order of the drive's variables.
"""

from hostmot2.emulator.catalog.parts import NO_UNIT
from hostmot2.emulator.description import Parameter, RemoteDescription, SoftwareMode
from hostmot2.fields import Direction, Field, FieldKind

PWM_HZ = 12_000
TEN_MILLI = 655.35


def _word(name: str, address: int, full_scale: float = 65535.0, unit: str = NO_UNIT, bits: int = 16) -> Field:
    top = full_scale if bits == 16 else float((1 << bits) - 1)
    return Field(name, FieldKind.UNSIGNED, bits, Direction.BIDIRECTIONAL, 0.0, top, unit, address)


def _signed(name: str, address: int) -> Field:
    return Field(name, FieldKind.SIGNED, 16, Direction.BIDIRECTIONAL, 0.0, 0.0, NO_UNIT, address)


def _volts(name: str, address: int) -> Field:
    return _word(name, address, TEN_MILLI, "V")


def _nv(
    name: str, address: int, value: int, working: str | None = None, full_scale: float = 65535.0
) -> Parameter:
    kind = FieldKind.NONVOL_UNSIGNED
    bits = 32 if name in ("NVKQI", "NVKDI") else 16
    top = full_scale if bits == 16 else float((1 << 32) - 1)
    unit = NO_UNIT if full_scale == 65535.0 else "V"
    return Parameter(
        Field(name, kind, bits, Direction.BIDIRECTIONAL, 0.0, top, unit, address), value, working
    )


_WORKING = (
    Parameter(_word("PIDENA", 0x804)),
    Parameter(_word("DRIVEMODE", 0x806)),
    Parameter(_signed("PWM", 0x808)),
    Parameter(_word("KQP", 0x812)),
    Parameter(_word("KQI", 0x814, bits=32)),
    Parameter(_word("KQIL", 0x818)),
    Parameter(_word("KDP", 0x81A)),
    Parameter(_word("KDI", 0x81C, bits=32)),
    Parameter(_word("KDIL", 0x820)),
    Parameter(_signed("IU", 0x822)),
    Parameter(_signed("IV", 0x824)),
    Parameter(_signed("IW", 0x826)),
    Parameter(_volts("BUSV", 0x828), 32000),
    Parameter(_word("RAWTEMPERATURE", 0x82A)),
    Parameter(_word("TEMPERATURE", 0x82C, TEN_MILLI, "degC"), 3000),
    Parameter(_word("GAIN", 0x82E)),
    Parameter(_word("ANGLE", 0x830)),
    Parameter(_word("DEADZONE", 0x840)),
    Parameter(_signed("ID", 0x846)),
    Parameter(_signed("IQ", 0x848)),
    Parameter(_word("ILIMITMUL", 0x850), 0xFFFF),
    Parameter(_word("FAULT", 0x852)),
    Parameter(_word("CLEARFAULT", 0x854)),
    Parameter(_word("FAULTMASK", 0x858)),
    Parameter(_word("WATCHDOGTIME", 0x85C, unit="PWM periods"), 500),
    Parameter(_signed("QSETPOINT", 0x860)),
    Parameter(_signed("DSETPOINT", 0x862)),
    Parameter(_volts("BUSUNDERVMIN", 0x864)),
    Parameter(_volts("BUSUNDERVMAX", 0x866)),
    Parameter(_volts("BUSOVERV", 0x868)),
    Parameter(_volts("BRAKEONV", 0x86A)),
    Parameter(_volts("BRAKEOFFV", 0x86C)),
    Parameter(_word("STATUS", 0x86E)),
    Parameter(_word("CPUTYPE", 0x870)),
    Parameter(_word("CONTROLTYPE", 0x872)),
    Parameter(_word("SWREVISION", 0x874), 0x0019),
    Parameter(_word("SYSCLK", 0x876, bits=32), 60_000_000),
    Parameter(_word("HWREVISION", 0x886)),
    Parameter(_word("TEMPILIMIT", 0x8E2)),
    Parameter(_word("TEMPISLOPE", 0x8E4)),
    Parameter(_word("MAXMODULEI", 0x8E6)),
    Parameter(_word("MAXCURRENT", 0x8E8, TEN_MILLI, "A")),
    Parameter(_word("PIDON", 0x8FE)),
    Parameter(_word("INTEGBOUND", 0x900)),
    Parameter(_word("UNITNUMBER", 0x928, bits=32)),
)

_EEPROM = (
    _nv("NVMAXMODULEI", 0, 3000, "MAXMODULEI"),
    _nv("NVMAXCURRENT", 2, 750, "MAXCURRENT", TEN_MILLI),
    _nv("NVBAUDRATE", 4, 9),
    _nv("NVREMBAUDRATE", 6, 9),
    _nv("NVCRCENABLE", 8, 0xFFFF),
    _nv("NVKQP", 10, 50, "KQP"),
    _nv("NVKQI", 12, 150_000, "KQI"),
    _nv("NVKQIL", 16, 0x7FFF, "KQIL"),
    _nv("NVKDP", 18, 50, "KDP"),
    _nv("NVKDI", 20, 150_000, "KDI"),
    _nv("NVKDIL", 24, 0x7FFF, "KDIL"),
    _nv("NVQSETPOINT", 26, 0, "QSETPOINT"),
    _nv("NVDSETPOINT", 28, 0, "DSETPOINT"),
    _nv("NVDEADZONE", 30, 0, "DEADZONE"),
    _nv("NVFAULTMASK", 32, 0xFFFF, "FAULTMASK"),
    _nv("NVBUSUNDERVMIN", 34, 3500, "BUSUNDERVMIN", TEN_MILLI),
    _nv("NVBUSUNDERVMAX", 36, 3700, "BUSUNDERVMAX", TEN_MILLI),
    _nv("NVBUSOVERV", 38, 38500, "BUSOVERV", TEN_MILLI),
    _nv("NVBRAKEONV", 40, 36000, "BRAKEONV", TEN_MILLI),
    _nv("NVBRAKEOFFV", 42, 34000, "BRAKEOFFV", TEN_MILLI),
    _nv("NVPWMRATE", 44, PWM_HZ),
    _nv("NVTEMPILIMIT", 46, 7000, "TEMPILIMIT"),
    _nv("NVTEMPISLOPE", 48, 100, "TEMPISLOPE"),
    _nv("NVINTEGBOUND", 50, 0x7FFF, "INTEGBOUND"),
    _nv("NVCOOKIE", 126, 0x5A5A),
)


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
    parameters=(*_EEPROM, *_WORKING),
    revision=0x19,
    watchdog_unit_us=1e6 / PWM_HZ,
    model="8i20",
    ram_at=0x0A00,
    readable=(0x0800, 0x0BFF),
    invented="start values of everything but BRAKEONV, BRAKEOFFV, KQP, KQI, KDP, KDI, BUSOVERV, the baud "
    "index and the watchdog time; bus voltage and temperature at rest",
)

CATALOG = {"8i20": MESA_8I20}
