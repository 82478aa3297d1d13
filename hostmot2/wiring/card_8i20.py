"""8I20. Source: 8I20 manual, hardware configuration, connectors, operation."""

from hostmot2.wiring.facts import CardFacts, Connector, Jumper, Led, Limit, RemoteFacts, Terminal

_EDGE = "bottom edge"
_LEDS = (
    Led("CR13", "green", _EDGE, "DSP status", "blinks with communication"),
    Led("CR14", "yellow", _EDGE, "motor power present", "on with motor power"),
    Led("CR15", "red", _EDGE, "drive fault", "off while running"),
    Led("CR16", "red", _EDGE, "over voltage, brake", "on while the brake is applied"),
    Led("CR17", "green", _EDGE, "isolated power present", "on"),
    Led("CR18", "yellow", _EDGE, "isolated inverter", "on"),
    Led("CR19", "green", _EDGE, "logic power present", "on"),
)
_CHECKS = (
    "logic power: CR19 (green, right end of the bottom edge) is on. W2 up: 5 V over J1-7 and J1-8, at most "
    "2.4 m of cable; W2 down: 8 to 40 V on TB1-1 (+) and TB1-2 (-)",
    "W6 up (operate): down is set-up mode at 115.2 kbaud, without process data",
    "the cable at J1: J1-1 and J1-2 (RXA, RXB) hear the host, J1-3 and J1-6 (TXA, TXB) speak to it, J1-4 and "
    "J1-5 are GND; all eight wires straight through",
    "termination: W4 and W5 up at the end of the cable",
    "CR13 (green, left end) blinks with communication; motor power is not needed for that",
)

CARD_8I20 = CardFacts(
    name="8i20",
    title="8I20: servo amplifier for permanent-magnet motors, 2200 W",
    manual="8I20 manual",
    connectors=(
        Connector(
            "J1",
            "serial interface, with 5 V",
            "RJ-45",
            (
                Terminal(1, "RXA", "in"),
                Terminal(2, "RXB", "in"),
                Terminal(3, "TXA", "out"),
                Terminal(4, "GND", "power"),
                Terminal(5, "GND", "power"),
                Terminal(6, "TXB", "out"),
                Terminal(7, "+5V", "power"),
                Terminal(8, "+5V", "power"),
            ),
        ),
        Connector(
            "TB1",
            "logic power, enable, fault output",
            "3.5 mm pluggable terminal block",
            (
                Terminal(1, "logic power +", "power", "8 to 40 V, with W2 down"),
                Terminal(2, "logic power -", "power"),
                Terminal(3, "enable in +", "in", "4 to 24 V, isolated; must be driven to run"),
                Terminal(4, "enable in -", "in"),
                Terminal(5, "fault out +", "out", "isolated, on in normal operation"),
                Terminal(6, "fault out -", "out"),
            ),
        ),
        Connector(
            "motor",
            "motor, motor power and brake, left to right",
            ".250 inch spade terminals",
            (
                Terminal(1, "chassis ground", "power"),
                Terminal(2, "brake resistor -", "out"),
                Terminal(3, "brake resistor +", "out"),
                Terminal(4, "motor power +", "power", "35 to 385 V DC; a fault above"),
                Terminal(5, "motor power -", "power"),
                Terminal(6, "motor W", "out"),
                Terminal(7, "motor V", "out"),
                Terminal(8, "motor U", "out"),
                Terminal(9, "chassis ground", "power"),
            ),
        ),
    ),
    jumpers=(
        Jumper(("W2",), "logic power", (("up", "5 V from the serial cable"), ("down", "from TB1-1, TB1-2"))),
        Jumper(
            ("W4", "W5"),
            "RS-422 termination",
            (("up", "terminated"), ("down", "not terminated")),
            default="up",
        ),
        Jumper(
            ("W6",),
            "mode",
            (("up", "operate, 2.5 Mbaud"), ("down", "set-up, 115.2 kbaud: drive off, no process data")),
            default="up",
        ),
    ),
    leds=_LEDS,
    limits=(
        Limit("motor power", 35.0, 385.0, "V"),
        Limit("logic power on TB1", 8.0, 40.0, "V"),
        Limit("enable input", 4.0, 24.0, "V"),
        Limit("fault output voltage", None, 24.0, "V"),
        Limit("fault output current", None, 0.005, "A"),
        Limit("peak current", None, 30.0, "A"),
        Limit("brake current", None, 15.0, "A"),
        Limit("serial cable that also feeds the card", None, 2.4, "m"),
        Limit("motor power leads", None, 0.9, "m"),
        Limit("board temperature", None, 85.0, "degC"),
    ),
    power_checklist=(
        "logic power: W2 up: 5 V over at most 2.4 m of serial cable; W2 down: 8 to 40 V on TB1-1, TB1-2",
        "enable input: 4 to 24 V across TB1-3 and TB1-4, else the drive faults with no-enable",
        "operate mode: W6 up",
        "termination: W4 and W5 up if this is the end of the cable",
        "motor power 35 to 385 V; no fuse or breaker between the drive and the supply's capacitors",
    ),
    remotes=(RemoteFacts("servo amplifier", None, 0, _CHECKS, operate="W6 up"),),
    silent_checks=_CHECKS,
)
