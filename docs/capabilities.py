"""What the package can do: which class drives it, what emulates it, where it is tested: data of a page."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One capability.

    driver and emulator are `module:name` in the package, or paths from the root. part: the attribute of
    Board. note: what is different, left out or refused.
    """

    capability: str
    driver: tuple[str, ...]
    emulator: tuple[str, ...]
    tests: tuple[str, ...]
    note: str = ""
    part: str = ""
    refused: bool = False


def module(
    capability: str, part: str, driver: str, emulator: str, tests: str, note: str = "", refused: bool = False
) -> Row:
    """A row of a module; several names are separated by spaces."""
    classes = tuple(f"hostmot2.{name}" for name in driver.split())
    emulators = tuple(f"csrc/emulator/{name}.c" for name in emulator.split())
    return Row(
        capability,
        classes,
        emulators,
        tuple(f"tests/{name}.py" for name in tests.split()),
        note,
        part,
        refused,
    )


MODULES = [
    module(
        "General-purpose I/O: level, direction, open drain, inversion, alternate source of every pin",
        "gpio",
        "modules.ioport:Gpio modules.ioport:GpioPin",
        "ioport",
        "modules/test_ioport",
    ),
    module(
        "I/O ports: who owns and drives which pin",
        "ioport",
        "modules.ioport:Ioport",
        "ioport",
        "modules/test_ioport modules/test_bite",
    ),
    module(
        "Watchdog: time-out, bite, gate for writes until acknowledged",
        "watchdog",
        "modules.watchdog:Watchdog",
        "watchdog",
        "modules/test_watchdog modules/test_bite test_exits",
    ),
    module("LEDs", "leds", "modules.led:Leds", "card_identity", "test_board"),
    module(
        "Encoders, plain and multiplexed: 64-bit count, position, velocity, index and probe latch, "
        "filters, errors",
        "encoders",
        "modules.encoder_module:Encoders modules.encoder:Encoder",
        "encoder muxed_encoder encoder_bank counter",
        "modules/test_encoder modules/test_encoder_math emulator/test_encoder_reference "
        "emulator/test_encoder_limits",
    ),
    module(
        "SSI absolute encoders: formats, Gray code, multi-turn, split positions, start by exchange or timer",
        "ssis",
        "modules.ssi:Ssis modules.ssi:Ssi modules.absolute_format:parse_format",
        "ssi",
        "modules/test_ssi",
    ),
    module(
        "BiSS absolute encoders",
        "bisses",
        "modules.unsupported:Bisses",
        "",
        "modules/test_unsupported",
        "hardware and the known driver disagree on the start bits",
        refused=True,
    ),
    module(
        "Fanuc absolute encoders",
        "fanucs",
        "modules.unsupported:Fanucs",
        "",
        "modules/test_unsupported",
        "hardware and the known driver disagree on how settings are loaded",
        refused=True,
    ),
    module(
        "Resolvers: angle, turns, velocity, index with divisor, excitation",
        "resolvers",
        "modules.resolver:Resolvers modules.resolver:Resolver",
        "resolver",
        "modules/test_resolver",
        "the status bit is shown as it is: the sources disagree on whether it means valid or "
        "error; positions are "
        "not kept in a file",
    ),
    module(
        "Step generators: position and velocity control, pulse times, modes, tables",
        "stepgens",
        "modules.stepgen:Stepgens modules.stepgen:Stepgen",
        "stepgen stepper",
        "modules/test_stepgen_math emulator/test_generators",
        "latching by index and probe is refused: hardware and drivers in use disagree on the bits",
    ),
    module(
        "PWM and PDM generators: duty, output kinds, offset mode, frequencies",
        "pwmgens",
        "modules.pwmgen:Pwmgens modules.pwmgen:Pwmgen",
        "pwmgen",
        "emulator/test_generators modules/test_bite",
    ),
    module(
        "Three-phase PWM: duties, dead time, fault input, ADC sample time, frequency",
        "tp_pwms",
        "modules.tp_pwm:TpPwms modules.tp_pwm:TpPwm",
        "tp_pwm",
        "modules/test_tp_pwm",
        "a fault stays until enabled again; nothing is rewritten behind the user's back",
    ),
    module(
        "Servo pulses (RC PWM): width by scale and offset, common rate",
        "rcpwms",
        "modules.rcpwm:Rcpwms modules.rcpwm:Rcpwm",
        "rcpwm",
        "modules/test_rcpwm",
    ),
    module(
        "Pulse timers (OneShot): widths, filters, triggers by software, pin, DPLL, rate or each other",
        "oneshots",
        "modules.oneshot:Oneshots modules.oneshot:OneshotTimer",
        "oneshot",
        "modules/test_oneshot",
    ),
    module(
        "Period meters: period, width, duty, averages, minimum frequency, filter, inversion",
        "periods",
        "modules.period:Periods modules.period:Period",
        "period",
        "modules/test_period",
    ),
    module(
        "InM inputs: filtered and raw, slow and fast filter, scan rate, hand wheels",
        "inms",
        "modules.field_input:Inms modules.field_input:FieldInputs",
        "field_input",
        "modules/test_field_input",
    ),
    module(
        "InMux inputs: the same behind a multiplexer",
        "inmuxes",
        "modules.field_input:Inmuxes modules.field_input:FieldInputs",
        "field_input",
        "modules/test_field_input",
    ),
    module(
        "SSR outputs with their carrier, inversion",
        "ssrs",
        "modules.outputs:Ssrs modules.outputs:FieldOutputs",
        "outputs",
        "modules/test_outputs",
    ),
    module(
        "OutM outputs, inversion",
        "outms",
        "modules.outputs:Outms modules.outputs:FieldOutputs",
        "outputs",
        "modules/test_outputs",
    ),
    module(
        "XY2-100 galvanometers",
        "xy2mods",
        "modules.unsupported:Xy2mods",
        "",
        "modules/test_unsupported",
        "what a velocity means contradicts what a position means in the one known driver",
        refused=True,
    ),
    module(
        "Smart serial: discovery, process data, faults, parameters",
        "sserial",
        "sserial:SserialPorts sserial.port:SserialPort sserial.channel:Channel",
        "sserial sslbp remote",
        "sserial/test_port sserial/test_discovery sserial/test_recorded_firmware emulator/test_sslbp_golden",
    ),
    module(
        "Buffered SPI: channels, transfers, words of each exchange",
        "bspis",
        "modules.bspi:Bspis modules.bspi:Bspi modules.bspi:BspiFrame",
        "bspi",
        "modules/test_bspi",
    ),
    module(
        "UARTs: set-up, sending, reading",
        "uarts",
        "modules.uart:Uarts modules.uart:Uart",
        "uart",
        "modules/test_uart",
    ),
    module(
        "Packet UARTs: set-up, frames out and in with the receiver's errors, all versions",
        "pktuarts",
        "modules.pktuart:Pktuarts modules.pktuart:Pktuart",
        "pktuart",
        "modules/test_pktuart",
        "a Modbus client is not part of the package",
    ),
    module(
        "DPLL: frequency, timers, time constant, phase error",
        "dpll",
        "modules.dpll:Dpll",
        "dpll",
        "emulator/test_generators",
    ),
]

BOARD = [
    Row(
        "PCI cards: finding, mapping, one driver per card",
        ("hostmot2.transports.pci:open_transport",),
        ("csrc/emulator/mirror.c",),
        ("tests/transports/test_pci.py",),
    ),
    Row(
        "Ethernet cards over LBP16 on UDP, sequenced, retried where that is safe",
        ("hostmot2.transports.udp:open_transport", "csrc/udp.c"),
        ("csrc/emulator/ethernet.c",),
        ("tests/test_udp.py", "tests/test_udp_board.py", "tests/test_lbp16.py"),
    ),
    Row(
        "A card without hardware, for tests",
        ("hostmot2.transports.emulated:open_transport",),
        ("hostmot2.emulator:EmulatedBoard",),
        ("tests/emulator/test_emulated_board.py",),
    ),
    Row(
        "A register dump in the card's place, only to read",
        ("hostmot2.transports.dump:open_transport", "csrc/image.c"),
        (),
        ("tests/test_dump.py",),
    ),
    Row(
        "FPGA image files: reading and checking the part; writing the configuration flash of Ethernet cards",
        ("hostmot2.bitfile", "hostmot2.ethernet.flash"),
        ("csrc/emulator/ethernet_flash.c",),
        ("tests/test_bitfile.py", "tests/test_ethernet_service.py"),
        "volatile programming of cards without a flash is not there; parallel port and SPI neither",
    ),
    Row(
        "Everything the card says of itself read and checked, one exception per check",
        ("hostmot2.inventory:read_inventory",),
        ("csrc/emulator/card_identity.c",),
        ("tests/test_idrom.py",),
    ),
    Row(
        "Exchanges: read and write together, apart, or in two halves so that several cards overlap",
        ("hostmot2.cycle:Cycle", "csrc/cycle.c"),
        ("csrc/emulator/card_bus.c",),
        ("tests/test_board.py",),
    ),
    Row(
        "A real-time thread for the cycle: schedule, dead-man, policies for stale data, overruns and faults, "
        "position controllers, trace and records of every cycle",
        ("hostmot2.engine:Engine", "csrc/engine.c"),
        ("csrc/emulator/card_bus.c",),
        ("tests/test_engine.py",),
        part="engine",
    ),
    Row(
        "Every cycle in an MCAP file (values, raw registers, times), read whole or cut off, exported, drawn",
        ("hostmot2.recording:Recorder", "hostmot2.recording:Recording", "csrc/record_ring.c"),
        (),
        ("tests/recording/test_round_trip.py", "tests/recording/test_cut_off.py"),
    ),
    Row(
        "A recording in the card's place: the driver sees and must do what it did then",
        ("hostmot2.recording:Replay",),
        (),
        ("tests/recording/test_replay.py", "tests/recording/test_engine.py"),
    ),
    Row(
        "Link errors counted, a level at which the link is given up, recovery that writes everything anew",
        ("hostmot2.board:Board", "csrc/udp_retry.c"),
        ("csrc/emulator/ethernet_fault.c",),
        ("tests/test_udp.py", "tests/test_udp_board.py"),
    ),
    Row(
        "What is on the card and on which pin; raw registers, decoded",
        ("hostmot2.cli.identify", "hostmot2.cli.registers"),
        (),
        ("tests/test_cli.py",),
    ),
    Row(
        "Outputs off on every way out, the watchdog left to bite",
        ("hostmot2.exits", "hostmot2.board:SafeOff"),
        ("csrc/emulator/watchdog.c",),
        ("tests/test_exits.py",),
    ),
    Row(
        "Absolute encoders started by each exchange where no DPLL timer is used",
        ("hostmot2.modules.ssi:Ssi", "csrc/absolute_encoder.c"),
        ("csrc/emulator/ssi.c",),
        ("tests/modules/test_ssi.py",),
    ),
    Row(
        "Number and kind of modules to use",
        ("hostmot2.parts",),
        (),
        ("tests/test_board.py",),
        "no configuration string: a part of the card is set up when it is first used, the others "
        "are left alone",
    ),
]
