"""7I77 and 7I77D. Source: 7I77 manual, hardware configuration, connectors, operation, specifications.

Where the manual's text and its table of specifications differ the stricter figure is taken: VIN from 10 V
(text: 8), field voltage up to 28 V (text: 32), 0.3 A an output (table: 0.35), 0.7 A of 5 V (text: 0.65).
"""

from hostmot2.wiring.facts import CardFacts, Connector, Jumper, Led, Limit, RemoteFacts, Terminal

_BLOCK = "3.5 mm pluggable terminal block"

_HOST_IO = (
    ("SS2TXEN", "in"), ("SS2TX", "in"), ("SS2RX", "out"), ("SS1TX", "in"), ("SS1RX", "out"), ("SS0TX", "in"),
    ("SS0RX", "out"), ("ENCMUX", "in"), ("QCMUXA01", "out"), ("QCMUXB01", "out"), ("QCMUXI01", "out"),
    ("QCMUXA23", "out"), ("QCMUXB23", "out"), ("QCMUXI23", "out"), ("QCMUXA45", "out"), ("QCMUXB45", "out"),
    ("QCMUXI45", "out"),
)  # fmt: skip
_DB25 = (1, 14, 2, 15, 3, 16, 4, 17, 5, 6, 7, 8, 9, 10, 11, 12, 13)


def _host() -> tuple[Terminal, ...]:
    signals = {
        pin: Terminal(pin, signal, direction, f"I/O {number}")
        for number, (pin, (signal, direction)) in enumerate(zip(_DB25, _HOST_IO, strict=True))
    }
    for pin in range(18, 22):
        signals[pin] = Terminal(pin, "GND", "power")
    for pin in range(22, 26):
        signals[pin] = Terminal(pin, "GND or 5V", "power", "5V with W5 left, GND with W5 right")
    return tuple(signals[pin] for pin in sorted(signals))


def _encoders(first: int) -> tuple[Terminal, ...]:
    names = ("QA{0}", "/QA{0}", "GND", "QB{0}", "/QB{0}", "+5V", "IDX{0}", "/IDX{0}")
    terminals = []
    for pin in range(24):
        name = names[pin % 8].format(first + pin // 8)
        terminals.append(Terminal(pin + 1, name, "power" if name in ("GND", "+5V") else "in"))
    return tuple(terminals)


def _drives() -> tuple[Terminal, ...]:
    terminals = []
    for axis in range(6):
        for offset, (name, direction) in enumerate(
            ((f"ENA{axis}-", "out"), (f"ENA{axis}+", "out"), ("GND", "power"), (f"AOUT{axis}", "out"))
        ):
            terminals.append(Terminal(4 * axis + offset + 1, name, direction))
    return tuple(terminals)


def _field(first_input: int, first_output: int) -> tuple[Terminal, ...]:
    inputs = [Terminal(n + 1, f"INPUT{first_input + n}", "in") for n in range(16)]
    outputs = [Terminal(n + 17, f"OUTPUT{first_output + n}", "out") for n in range(8)]
    return (*inputs, *outputs)


_RS422 = (
    Terminal(1, "GND", "power", "CAT5 pin 4, blue"),
    Terminal(2, "GND", "power", "CAT5 pin 5, blue/white"),
    Terminal(3, "RX+", "in", "CAT5 pin 6, green"),
    Terminal(4, "RX-", "in", "CAT5 pin 3, green/white"),
    Terminal(5, "TX+", "out", "CAT5 pin 2, orange"),
    Terminal(6, "TX-", "out", "CAT5 pin 1, orange/white"),
    Terminal(7, "+5V", "power", "CAT5 pin 7, brown/white"),
    Terminal(8, "+5V", "power", "CAT5 pin 8, brown"),
)
_FIELD_POWER = (
    *(
        Terminal(pin, "VFIELD", "power", "up to 28 V, without switch or relay in the line")
        for pin in range(1, 5)
    ),
    Terminal(5, "VIN", "power", "field I/O logic, 10 to 32 V; joined to VFIELD with W1 left"),
    Terminal(6, "NC", ""),
    Terminal(7, "NC", ""),
    Terminal(8, "GROUND", "power", "common of VIN and VFIELD"),
)

_ENCODER_JUMPERS = tuple(
    Jumper(
        names, f"encoder {n}: A, B, Z input", (("left", "single ended"), ("right", "differential")), "right"
    )
    for n, names in enumerate(
        (
            ("W21", "W19", "W17"),
            ("W15", "W13", "W10"),
            ("W8", "W6", "W2"),
            ("W22", "W20", "W18"),
            ("W16", "W14", "W11"),
            ("W9", "W7", "W3"),
        )
    )
)
_MODE = (("left", "operate, 2.5 Mbaud"), ("right", "set-up, 115.2 kbaud: no process data"))

_VIN = (
    "field logic power VIN: 10 to 32 V on TB2-5 against TB2-8; with W1 left it comes from VFIELD, TB2-1 to "
    "TB2-4, which must then be 10 to 28 V. Without VIN the field I/O is not detected"
)
_5V = (
    "5 V: CR1 (yellow, upper left) is on. W5 left: the FPGA card's own jumper must put 5 V on the cable; "
    "W5 right: 5 V on TB1-2 against TB1-1, never with W5 left"
)
_REMOTES = (
    RemoteFacts(
        "field I/O",
        0x12,
        0,
        (
            _VIN,
            "field voltage: CR3 (yellow, upper right) is on",
            "W12 left (operate): right is set-up mode at 115.2 kbaud, without process data",
            "from revision B on, CR16 (red, lower right) is on at power-up until the field I/O runs: dark "
            "from the start means that it has no power",
        ),
        proves="cable and bitfile",
        operate="W12 left",
    ),
    RemoteFacts(
        "analog outputs",
        0x11,
        1,
        (
            _5V,
            "analog supplies: CR6 (+16 V) and CR7 (-12 V), yellow, lower middle, are on",
            "W4 left (operate): right is set-up mode at 115.2 kbaud, without process data",
        ),
        proves="5 V, cable and bitfile",
        operate="W4 left",
    ),
    RemoteFacts(
        "RS-422 connector TB6",
        None,
        2,
        (
            "something is plugged into TB6 at all, and is powered: TB6-7 and TB6-8 give 5 V, TB6-1 and "
            "TB6-2 are GND",
            "the pairs: TB6-3 and TB6-4 (RX+, RX-) hear the remote, TB6-5 and TB6-6 (TX+, TX-) speak to it; "
            "a CAT5 cable on the screws goes by the colours of 568B (`hm2 pins 7i77 --connector TB6`)",
            "that remote's own set-up jumper: it must be in operate mode",
        ),
        needed=False,
    ),
)

CARD_7I77 = CardFacts(
    name="7i77",
    title="7I77: six analog servo axes, 48 field I/O, six encoders",
    manual="7I77 manual",
    connectors=(
        Connector("P1", "to the FPGA card; signal names as on the first connector", "DB25 female", _host()),
        Connector(
            "TB1",
            "5 V for analog, encoders and RS-422, if W5 is right",
            _BLOCK,
            (Terminal(1, "GND", "power"), Terminal(2, "5V", "power")),
        ),
        Connector("TB2", "field power", _BLOCK, _FIELD_POWER),
        Connector("TB3", "encoders 0 to 2", _BLOCK, _encoders(0)),
        Connector("TB4", "encoders 3 to 5", _BLOCK, _encoders(3)),
        Connector("TB5", "analog outputs and drive enables", _BLOCK, _drives()),
        Connector("TB6", "RS-422 for a further smart-serial remote", _BLOCK, _RS422),
        Connector("TB7", "inputs 16 to 31, outputs 8 to 15", _BLOCK, _field(16, 8)),
        Connector("TB8", "inputs 0 to 15, outputs 0 to 7", _BLOCK, _field(0, 0)),
    ),
    jumpers=(
        Jumper(
            ("W1",), "field logic power", (("left", "VIN from VFIELD"), ("right", "VIN on its own")), "left"
        ),
        Jumper(("W4",), "analog processor", _MODE, "left"),
        Jumper(
            ("W5",),
            "5 V supply",
            (("left", "from the FPGA card; nothing on TB1"), ("right", "from TB1; the FPGA card's 5 V off")),
        ),
        Jumper(("W12",), "field I/O processor", _MODE, "left"),
        *_ENCODER_JUMPERS,
    ),
    leds=(
        Led("CR1", "yellow", "upper left", "5 V", "on"),
        Led("CR3", "yellow", "upper right", "field voltage", "on"),
        Led("CR6", "yellow", "lower middle", "+16 V of the analog part", "on"),
        Led("CR7", "yellow", "lower middle", "-12 V of the analog part", "on"),
        Led(
            "CR15",
            "green",
            "lower right",
            "field I/O at work (revision B on)",
            "blinks, 1 Hz at 1 kHz updates",
        ),
        Led("CR16", "red", "lower right", "field I/O fault or watchdog (revision B on)", "off while running"),
    ),
    limits=(
        Limit("field voltage VFIELD", 5.0, 28.0, "V"),
        Limit("field logic voltage VIN", 10.0, 32.0, "V"),
        Limit("field voltage ramp", None, 10.0, "V/ms"),
        Limit("load of one field output", None, 0.3, "A"),
        Limit("load of eight outputs on one driver", None, 1.4, "A"),
        Limit("inductive load without flyback diode", None, 0.06, "A"),
        Limit("load resistance of an analog output", 2000.0, None, "ohm"),
        Limit("current of an analog output", None, 0.005, "A"),
        Limit("current of a drive enable", None, 0.05, "A"),
        Limit("voltage of a drive enable", None, 100.0, "V"),
        Limit("encoder count rate, fast filter; slow (our default): half", None, 2e6, "counts/s"),
        Limit("5 V current without encoders", None, 0.7, "A"),
        Limit("analog watchdog", None, 0.05, "s"),
    ),
    power_checklist=(
        "5 V: CR1 is on. W5 left: the FPGA card is jumpered to supply the cable; W5 right: 5 V on TB1-2",
        "never 5 V on TB1 with W5 left: it feeds back into the FPGA card and the PC",
        "analog supply: CR6 and CR7 are on",
        "field logic: VIN on TB2-5, 10 to 32 V against TB2-8, or W1 left and VFIELD, TB2-1 to 4, 10 to 28 V",
        "field power: CR3 is on; no switch or relay in the VFIELD line",
        "operate mode: W4 (analog) and W12 (field I/O) left",
    ),
    remotes=_REMOTES,
    silent_checks=(
        _5V,
        "the cable at P1, and that it leads to the FPGA card's connector named here",
        "the bitfile: one for a 7I77 on that connector (`hm2 pins`)",
        "operate mode: W4 (analog) and W12 (field I/O) left",
        _VIN,
    ),
)
