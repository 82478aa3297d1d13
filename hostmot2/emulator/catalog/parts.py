"""What the catalogue's descriptions are put together from."""

from hostmot2.emulator.description import Parameter
from hostmot2.fields import Direction, Field, FieldKind

ANALOG_FULL_SCALE = 36.3
"""Volts of the field analog inputs at full scale (sserial.md 8.1)."""

NO_UNIT = "none"


def bits(name: str, width: int, direction: Direction) -> Field:
    """Independent bits."""
    return Field(name, FieldKind.BITS, width, direction, unit=NO_UNIT)


def inputs(width: int, name: str = "Input") -> Field:
    """A card's digital inputs."""
    return bits(name, width, Direction.INPUT)


def outputs(width: int, name: str = "Output") -> Field:
    """A card's digital outputs."""
    return bits(name, width, Direction.OUTPUT)


def flag(name: str, width: int = 1, direction: Direction = Direction.OUTPUT) -> Field:
    """A truth value; all of its bits are written alike."""
    return Field(name, FieldKind.BOOLEAN, width, direction, unit=NO_UNIT)


def volts(name: str, width: int = 8, full_scale: float = ANALOG_FULL_SCALE) -> Field:
    """An analog input, 0 .. full_scale volts."""
    return Field(name, FieldKind.UNSIGNED, width, Direction.INPUT, 0.0, full_scale, "V")


def analog_inputs(count: int, width: int = 8, full_scale: float = ANALOG_FULL_SCALE) -> tuple[Field, ...]:
    """AnalogIn0 .. AnalogIn(count-1)."""
    return tuple(volts(f"AnalogIn{number}", width, full_scale) for number in range(count))


def counter(name: str, width: int = 8) -> Field:
    """A counter that wraps."""
    return Field(name, FieldKind.ENCODER, width, Direction.INPUT, 0.0, float((1 << width) - 1), "count")


def working(name: str, width: int = 16, unit: str = NO_UNIT) -> Field:
    """A parameter in RAM."""
    return Field(name, FieldKind.UNSIGNED, width, Direction.BIDIRECTIONAL, 0.0, float((1 << width) - 1), unit)


def nonvolatile(name: str, width: int = 16, unit: str = NO_UNIT) -> Field:
    """A parameter in EEPROM."""
    return Field(
        name, FieldKind.NONVOL_UNSIGNED, width, Direction.BIDIRECTIONAL, 0.0, float((1 << width) - 1), unit
    )


def card_parameters(revision: int, *more: Parameter) -> tuple[Parameter, ...]:
    """What every Mesa field card has (7I77 manual, field I/O parameters; sserial.md 8.1, 8.3)."""
    return (
        Parameter(nonvolatile("NVBaudRate"), 9),
        Parameter(nonvolatile("NVUnitNumber", 32), 0, "UnitNumber"),
        Parameter(nonvolatile("NVWatchDogTimeout", 16, "ms"), 50, "WatchDogTime"),
        *(parameter for parameter in more if parameter.field.kind is FieldKind.NONVOL_UNSIGNED),
        Parameter(working("UnitNumber", 32)),
        Parameter(working("WatchDogTime", 16, "ms"), 50),
        Parameter(working("Fault")),
        Parameter(working("SWRevision"), revision),
        Parameter(working("HWRevision"), 1),
        *(parameter for parameter in more if parameter.field.kind is not FieldKind.NONVOL_UNSIGNED),
    )
