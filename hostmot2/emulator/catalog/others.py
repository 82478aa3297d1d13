"""Remotes whose tables are published: 7I90 reference remote and STMBL; and the 7I64 (sserial.md 7.3, 8.3)."""

from hostmot2.emulator.catalog.parts import inputs, outputs
from hostmot2.emulator.description import Parameter, RemoteDescription, SoftwareMode
from hostmot2.fields import Direction, Field, FieldKind

_INFINITE = float("inf")


def _port(name: str, direction: Direction) -> Field:
    return Field(name, FieldKind.BITS, 24, direction, 0.0, 0.0, "bit")


MESA_7I90 = RemoteDescription(
    name="7I90",
    unit_number=0x1234_5678,
    modes=(
        SoftwareMode(
            0,
            "standard",
            (
                *(_port(f"P{port}-Out", Direction.OUTPUT) for port in (1, 2, 3)),
                *(_port(f"P{port}-In", Direction.INPUT) for port in (1, 2, 3)),
            ),
        ),
    ),
    hardware_mode=(0, "standard"),
    watchdog_us=193 * 256.0,
    ptoc=0x0200,
    gtoc=0x0220,
    tables_at=0x0300,
    ram_at=0x0280,
    globals_listed=False,
    flash=None,
    readable=(0x0200, 0x07FF),
    invented="addresses of process data and records (the published ones are 32 bytes apart), card name",
)


def _stmbl(
    name: str, kind: FieldKind, width: int, direction: Direction, limit: float = 0.0, unit: str = ""
) -> Field:
    return Field(name, kind, width, direction, -limit, limit, unit)


_OUT, _IN, _BOTH = Direction.OUTPUT, Direction.INPUT, Direction.BIDIRECTIONAL

STMBL = RemoteDescription(
    name="stbl",
    unit_number=0x0000_0001,
    modes=(
        SoftwareMode(
            0,
            "Position mode",
            (
                _stmbl("pos_cmd", FieldKind.FLOAT, 32, _OUT, _INFINITE, "rad"),
                _stmbl("vel_cmd", FieldKind.FLOAT, 32, _OUT, _INFINITE, "rad"),
                _stmbl("out", FieldKind.BITS, 4, _OUT),
                _stmbl("enable", FieldKind.BOOLEAN, 1, _OUT),
                _stmbl("pos_fb", FieldKind.FLOAT, 32, _IN, _INFINITE, "rad"),
                _stmbl("vel_fb", FieldKind.FLOAT, 32, _IN, _INFINITE, "rad"),
                _stmbl("current", FieldKind.SIGNED, 8, _IN, 30.0, "A"),
                _stmbl("in", FieldKind.BITS, 4, _IN),
                _stmbl("fault", FieldKind.BOOLEAN, 1, _IN),
                _stmbl("index_enable", FieldKind.BOOLEAN, 1, _BOTH),
                _stmbl("", FieldKind.PAD, 2, _OUT),
                _stmbl("", FieldKind.PAD, 2, _IN),
            ),
        ),
    ),
    parameters=(
        Parameter(Field("scale", FieldKind.FLOAT, 32, _OUT, -_INFINITE, _INFINITE, ""), 0x3F80_0000),
    ),
    hardware_mode=(0, "Standard"),
    watchdog_us=50_000.0,
    ptoc=0x018B,
    gtoc=0x01A5,
    tables_at=0x0200,
    modes_in_ptoc=False,
    flash=None,
    invented="addresses of process data and records, unit strings, watchdog time, fault after power-up",
)

MESA_7I64 = RemoteDescription(
    name="7I64",
    unit_number=0x0000_0064,
    modes=(
        SoftwareMode(
            0,
            "Standard",
            (
                outputs(24),
                Field("Command", FieldKind.STREAM, 8, Direction.OUTPUT),
                inputs(24),
                Field("Status", FieldKind.STREAM, 8, Direction.INPUT),
                Field("Analog0", FieldKind.UNSIGNED, 16, Direction.INPUT, 0.0, 3.3, "V"),
                Field("Analog1", FieldKind.UNSIGNED, 16, Direction.INPUT, 0.0, 3.3, "V"),
            ),
        ),
    ),
    model="7i64",
    watchdog_us=50_000.0,
    invented="all RAM addresses, watchdog time, names of the two status bytes",
)

CATALOG = {"7i90": MESA_7I90, "stmbl": STMBL, "7i64": MESA_7I64}
