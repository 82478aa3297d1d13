"""Mesa's other field I/O cards (sserial.md 8.3). Widths that no source gives are ours and said to be."""

from hostmot2.emulator.catalog.parts import (
    analog_inputs,
    bits,
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

_ADDRESSES = "all addresses, unit strings"

# -- 7I76: field I/O with a spindle

_SPINDLE = (
    outputs(16),
    Field("SpinOut", FieldKind.UNSIGNED, 16, Direction.OUTPUT, 0.0, 100.0, "percent"),
    flag("SpinEna", 8),
    flag("SpinDir", 8),
)
_SPINDLE_IO = (*_SPINDLE, inputs(32))
_SPINDLE_ANALOG = (*_SPINDLE_IO, *analog_inputs(4))

MESA_7I76 = RemoteDescription(
    name="7I76",
    unit_number=0x1000_0001,
    modes=(
        SoftwareMode(0, "IO_Spin", _SPINDLE_IO),
        SoftwareMode(1, "IO_Ana_Spin", _SPINDLE_ANALOG),
        SoftwareMode(
            2,
            "IO_Enc_Ana_Spin_FV",
            (*_SPINDLE_ANALOG, volts("FieldVoltage"), counter("Enc0"), counter("Enc1")),
        ),
    ),
    parameters=card_parameters(14),
    revision=14,
    invented=f"{_ADDRESSES}; SpinEna and SpinDir 8 bits each as the 7I76E manual places them; 8 bits of "
    "FieldVoltage and of Enc0, Enc1, which are named after the 7I77's",
)

# -- 7I83: six analog outputs

MESA_7I83 = RemoteDescription(
    name="7I83",
    unit_number=0x1700_0001,
    modes=(
        SoftwareMode(
            0,
            "Standard",
            (
                *(
                    Field(f"AnalogOut{axis}", FieldKind.SIGNED, 13, Direction.OUTPUT, -10.0, 10.0, "V")
                    for axis in range(6)
                ),
                *(flag(f"AnalogEna{axis}") for axis in range(6)),
                volts("FieldVoltage"),
            ),
        ),
    ),
    parameters=card_parameters(14),
    revision=14,
    invented=f"{_ADDRESSES}, mode name; every width: 13 bits of AnalogOut as on the 7I77, 1 bit of AnalogEna,"
    " 8 bits of FieldVoltage",
)

# -- 7I84: 32 inputs, 16 outputs

_7I84 = (outputs(16), inputs(32))

MESA_7I84 = RemoteDescription(
    name="7I84",
    unit_number=0x1300_0001,
    modes=(
        SoftwareMode(0, "IO", _7I84),
        SoftwareMode(1, "IO_Ana", (*_7I84, *analog_inputs(4))),
        SoftwareMode(2, "IO_Ana_FV", (*_7I84, *analog_inputs(4), volts("FieldVoltage"))),
        SoftwareMode(
            3,
            "IO_Enc_Ana_FV",
            (*_7I84, *analog_inputs(4), volts("FieldVoltage"), counter("Enc0"), counter("Enc1")),
        ),
    ),
    parameters=card_parameters(14),
    revision=14,
    invented=f"{_ADDRESSES}, device code 0x13 of the unit number, mode names, modes 1 and 2, what mode 3 "
    "holds besides the MPG counters, every width but those of Input and Output",
)

# -- 7I69: 48 lines either way; 7I70: 48 inputs; 7I71, 7I72: 48 outputs

MESA_7I69 = RemoteDescription(
    name="7I69",
    unit_number=0x1400_0001,
    modes=(
        SoftwareMode(0, "IO", (outputs(48), inputs(48))),
        SoftwareMode(1, "Input", (inputs(48),)),
        SoftwareMode(2, "Output", (outputs(48),)),
        SoftwareMode(3, "Half", (inputs(24), outputs(24))),
        SoftwareMode(4, "IO_Enc", (outputs(48), inputs(48), *(counter(f"Enc{n}") for n in range(4)))),
    ),
    parameters=card_parameters(14),
    revision=14,
    invented=f"{_ADDRESSES}, device code 0x14, mode names, that mode 0 lists an Output and an Input, 8-bit "
    "counters",
)

MESA_7I70 = RemoteDescription(
    name="7I70",
    unit_number=0x1500_0001,
    modes=(
        SoftwareMode(0, "Input", (inputs(48),)),
        SoftwareMode(1, "Input_Ana", (inputs(48), *analog_inputs(6))),
        SoftwareMode(2, "Input_Ana_FV", (inputs(48), *analog_inputs(5), volts("FieldVoltage"))),
    ),
    parameters=card_parameters(14),
    revision=14,
    invented=f"{_ADDRESSES}, device code 0x15, mode names, 8-bit analog inputs, and that mode 2 has five of "
    "them, so that it stays within 12 bytes",
)

MESA_7I71 = RemoteDescription(
    name="7I71",
    unit_number=0x1600_0001,
    modes=(
        SoftwareMode(0, "Output", (outputs(48),)),
        SoftwareMode(1, "Output_FV", (outputs(48), volts("FieldVoltage"))),
    ),
    parameters=card_parameters(14),
    revision=14,
    invented=f"{_ADDRESSES}, device code 0x16, mode names, 8 bits of FieldVoltage",
)

MESA_7I72 = RemoteDescription(
    name="7I72",
    unit_number=0x1800_0001,
    modes=MESA_7I71.modes,
    parameters=card_parameters(14),
    revision=14,
    invented=f"{_ADDRESSES}, device code 0x18, mode names, 8 bits of FieldVoltage, mode 1 as on the 7I71",
)

# -- 7I73: pendant

_PENDANT = (outputs(22), inputs(24), *(counter(f"Enc{n}") for n in range(4)))

MESA_7I73 = RemoteDescription(
    name="7I73",
    unit_number=0x1900_0001,
    modes=(
        SoftwareMode(0, "IO_Enc", _PENDANT),
        SoftwareMode(1, "IO_Enc_Ana", (*_PENDANT, *analog_inputs(4, 8, 3.3))),
        SoftwareMode(2, "IO_Enc_Disp", (*_PENDANT, bits("Display32", 32, Direction.OUTPUT))),
    ),
    parameters=card_parameters(
        14,
        Parameter(nonvolatile("NVAnalogFilter")),
        Parameter(nonvolatile("NVContrast")),
        Parameter(nonvolatile("NVDispMode")),
        *(Parameter(nonvolatile(f"NVEncMode{n}")) for n in range(4)),
        Parameter(nonvolatile("NVKeyTimer")),
        Parameter(working("KeyCode", 8)),
    ),
    revision=14,
    invented=f"{_ADDRESSES}, device code 0x19, mode names, every width; four analog inputs of the eight and "
    "the largest jumper setting of inputs and outputs, so that a mode stays within 12 bytes",
)

CATALOG = {
    "7i76": MESA_7I76,
    "7i83": MESA_7I83,
    "7i84": MESA_7I84,
    "7i69": MESA_7I69,
    "7i70": MESA_7I70,
    "7i71": MESA_7I71,
    "7i72": MESA_7I72,
    "7i73": MESA_7I73,
}
