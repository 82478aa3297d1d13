"""7I77 and 7I77D: field I/O and analog, two remotes on one card (sserial.md 8.1, 8.2; 7I77 manual)."""

from hostmot2.emulator.catalog.parts import (
    NO_UNIT,
    analog_inputs,
    card_parameters,
    counter,
    flag,
    inputs,
    nonvolatile,
    outputs,
    volts,
    working,
)
from hostmot2.emulator.description import Parameter, RemoteDescription, SoftwareMode
from hostmot2.fields import Direction, Field, FieldKind

IO_UNIT = 0x1200_0001
ANALOG_UNIT = 0x1100_0001

_IO = (outputs(16), inputs(32))
_ANALOG = (*_IO, *analog_inputs(4))
_VOLTAGE = (*_ANALOG, volts("FieldVoltage"))
_MPG = (*_VOLTAGE, counter("Enc0"), counter("Enc1"))

_FIELD_VOLTAGE = Field("FieldVoltage", FieldKind.UNSIGNED, 16, Direction.INPUT, 0.0, 36.3, "V")


def _field_io(invented: str) -> RemoteDescription:
    return RemoteDescription(
        name="7I77",
        unit_number=IO_UNIT,
        modes=(
            SoftwareMode(0, "IO", _IO),
            SoftwareMode(1, "IO_Ana", _ANALOG),
            SoftwareMode(2, "IO_Ana_FV", _VOLTAGE),
            SoftwareMode(3, "IO_Enc_Ana_FV", _MPG),
        ),
        parameters=card_parameters(
            14,
            Parameter(nonvolatile("NVEncMode0"), 0, "EncMode0"),
            Parameter(nonvolatile("NVEncMode1"), 0, "EncMode1"),
            Parameter(working("EncMode0")),
            Parameter(working("EncMode1")),
            Parameter(_FIELD_VOLTAGE),
        ),
        revision=14,
        invented=invented,
    )


_INVENTED = (
    "all addresses, mode names, unit strings; 8 bits of FieldVoltage and of Enc0, Enc1 and the names of "
    "the two; SWRevision 14 as seen on real cards"
)

FIELD_IO = _field_io(_INVENTED)
FIELD_IO_D = _field_io(_INVENTED + "; that a 7I77D tells nothing of its sinking outputs")

_ANALOG_OUT = tuple(
    Field(f"AnalogOut{axis}", FieldKind.SIGNED, 13, Direction.OUTPUT, -10.0, 10.0, "V") for axis in range(6)
)

ANALOG = RemoteDescription(
    name="7I77",
    unit_number=ANALOG_UNIT,
    modes=(SoftwareMode(0, "Standard", (*_ANALOG_OUT, flag("AnalogEna"), flag("SpinEna"))),),
    parameters=card_parameters(14),
    revision=14,
    invented="all addresses, mode name, unit strings (V, " + NO_UNIT + "); receive size 1 from the bit sums",
)

CATALOG = {
    "7i77-io": FIELD_IO,
    "7i77-analog": ANALOG,
    "7i77d-io": FIELD_IO_D,
    "7i77d-analog": ANALOG,
}
