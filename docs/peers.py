"""What LinuxCNC's hostmot2 and mesaflash can do, and what there is of it here: the data of a page.

The features are those of LinuxCNC 2.10.0~pre1 and mesaflash of August 2025, by their sources and manuals.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Peer:
    """One feature of another program.

    ours: names that must exist, as in Row. gap: what is missing or different; with no `ours` all of it is.
    """

    feature: str
    ours: tuple[str, ...] = ()
    gap: str = ""

    @property
    def verdict(self) -> str:
        """In a word."""
        if not self.ours:
            return "**no**"
        return "partly" if self.gap else "yes"


def has(feature: str, ours: str, gap: str = "") -> Peer:
    """A feature that is here; names are separated by spaces, those with a colon in the package."""
    names = ours.split()
    return Peer(feature, tuple(n if "/" in n else f"hostmot2.{n}" for n in names), gap)


def lacks(feature: str, why: str) -> Peer:
    """A feature that is not."""
    return Peer(feature, (), why)


LINUXCNC_BOARD = [
    has(
        "PCI cards (hm2_pci)",
        "transports.pci pci_cards:PCI_IDS",
        "cards without a flash are not loaded with firmware",
    ),
    has(
        "Ethernet cards (hm2_eth)",
        "transports.udp",
        "firmware without scratch memory (LBP16 before 3) is refused",
    ),
    lacks("EPP: 7I43, 7I90 (hm2_7i43, hm2_7i90)", "no parallel port"),
    lacks(
        "SPI: 7I90, 7C80, 7C81 (hm2_spi, hm2_rpspi, hm2_spix)",
        "no SPI; a transport of another package can bring it",
    ),
    has("A card for tests without hardware (hm2_test)", "emulator:EmulatedBoard"),
    has("Bitfile read, part checked", "bitfile"),
    lacks(
        "Firmware loaded into cards without a flash (`firmware=`)", "load it with mesaflash or LinuxCNC first"
    ),
    has("Cookie, IDROM, module and pin descriptors read and validated", "inventory:read_inventory"),
    has("Read and write of everything per thread cycle", "cycle:Cycle engine:Engine"),
    has("Split read for latency (`read-request`)", "engine:Engine board:Board"),
    lacks(
        "GPIO-only fast read and write functions",
        "a cycle moves everything in use; `Board.read` reaches one register",
    ),
    has("Absolute encoders triggered without DPLL (`trigger-encoders`)", "modules.ssi:Ssi"),
    has("I/O error flag, cleared by the user", "errors:LinkFailed"),
    has("Packet errors: counts, level, limit, read timeout", "transports.udp engine:Engine"),
    has("Dumps of IDROM, descriptors, modules (`debug_*`)", "cli.identify dump"),
    lacks(
        "Remotes' pins named by serial number (`use_serial_numbers`)",
        "`Channel.unit_number` tells them apart",
    ),
    has("Another baud rate for remotes (`sserial_baudrate`)", "sserial.channel:Channel"),
    has("Listing of pins, their use and connectors", "cli.identify"),
    has("Watchdog made to bite at unload", "board:SafeOff"),
    has("Everything written anew after a bite or a lost link", "board:Board"),
    has("Cyclic lists of registers, queued access", "cycle:Cycle"),
    has("A realtime thread that calls it", "engine:Engine"),
    lacks(
        "Pinned ARP entry, firewall rules for the card's interface",
        "needs root; give the card a network port of its own",
    ),
]

LINUXCNC_CONFIG = [
    has(
        "`num_encoders`, `num_stepgens`, `num_pwmgens` ... `num_leds`",
        "parts:PARTS",
        "not needed: parts are set up when used",
    ),
    has("`num_dplls=0`", "modules.dpll:Dpll", "not needed: the DPLL is left alone until used"),
    has("`stepgen_width`", "modules.stepgen:Stepgen", "follows from the mode"),
    has(
        "`sserial_port_N=`: modes of remotes, channels left out",
        "sserial.channel:Channel sserial.port:SserialPort",
    ),
    has("`ssi_chan_N=`: format of the bits", "modules.absolute_format:parse_format"),
    lacks("`biss_chan_N=`, `fanuc_chan_N=`", "refused, see the modules"),
    has("`enable_raw`", "board:Board", "always there; `hm2 poke` asks for `--yes`"),
    lacks("`firmware=`", "as above"),
]

LINUXCNC_MODULES = [
    has("gpio: in, out, direction, open drain, inversion", "modules.ioport:Gpio modules.ioport:Ioport"),
    has("watchdog: has_bit, timeout_ns", "modules.watchdog:Watchdog", "default 50 ms, not 5"),
    has("led", "modules.led:Leds"),
    has("encoder: all pins and parameters", "modules.encoder:Encoder", "velocity is per second only, no rpm"),
    has("ssi: format letters, gray, multi-turn, split encoders", "modules.ssi:Ssi"),
    lacks("biss", "hardware and driver disagree on the start bits: refused"),
    lacks("fanuc", "hardware and driver disagree on how settings are loaded: refused"),
    has("resolver", "modules.resolver:Resolver", "no position file, no joint feedback, one scale"),
    has(
        "stepgen: position and velocity control, times, table, swap",
        "modules.stepgen:Stepgen",
        "no latch by index or probe (refused), no position-reset, no DPLL timer",
    ),
    has("pwmgen: PWM, up/down, PDM, swapped, offset mode", "modules.pwmgen:Pwmgen", "no dither"),
    has("3pwmgen", "modules.tp_pwm:TpPwm"),
    has("rcpwmgen", "modules.rcpwm:Rcpwm"),
    has("oneshot", "modules.oneshot:Oneshot"),
    has("periodm", "modules.period:Period", "duty without scale and offset"),
    has("inm, inmux", "modules.field_input:FieldInputs"),
    has("ssr, outm", "modules.outputs:FieldOutputs"),
    lacks(
        "xy2mod", "what a velocity means contradicts what a position means in the one known driver: refused"
    ),
    has(
        "sserial: remotes found and described, states, fault counts, parameters",
        "sserial.port:SserialPort engine:Engine",
    ),
    lacks(
        "sserial: `-not` and `-invert` pins, `scalemax`, limits per pin", "negate and scale in your program"
    ),
    has("bspi", "modules.bspi:Bspi"),
    has("uart", "modules.uart:Uart"),
    has("pktuart, versions 0 to 3", "modules.pktuart:Pktuart"),
    has("dpll: frequency, timers, phase error", "modules.dpll:Dpll", "time constant and limits are fixed"),
    has("raw: read and write of any register", "board:Board cli.registers"),
    lacks("Modbus over packet UARTs (mesambccc, hm2_modbus)", "not part of this package"),
    lacks("7I65 over BSPI (hm2_7i65)", "BSPI is there, the card's model is not"),
    has("setsserial: parameters and firmware of remotes", "cli.param lbp.firmware"),
]

MESAFLASH = [
    has("Ethernet cards by address (`--addr`)", "ethernet.discovery:discover"),
    has("PCI cards found", "pci_cards:PCI_IDS"),
    lacks("SPI, EPP, USB and serial FPGA cards", "no such transports"),
    has("`--readhmid`, `--print-pd`", "cli.identify"),
    has("`--verbose`: name, versions, addresses, counters", "ethernet.service:EthernetService"),
    has("`--sserial`: remotes and their tables", "cli.sserial cli.param"),
    has("`--rpo`, `--wpo`: a register read, written", "cli.registers"),
    has(
        "`--info FILE`: a bitfile's header",
        "bitfile",
        "in Python; `hm2 flash write` checks it, no command shows it alone",
    ),
    has(
        "`--write`, `--verify`, `--backup-flash`",
        "ethernet.flash:Flash",
        "Ethernet cards only, not PCI cards",
    ),
    lacks("`--fallback`: write the fallback image", "only the user area is ever written"),
    lacks("`--fix-boot-block`", "a damaged boot block is reported, not repaired"),
    lacks("`--program`: volatile load of cards without a flash", "as above"),
    lacks("`--recover` of 6I24 and 6I25 through their bridge", "dangerous, and not testable here"),
    has("`--reload`, also of the fallback image", "ethernet.service:EthernetService"),
    has("`--set ip=`", "ethernet.service:EthernetService"),
    lacks("`--set led=`: source of the card's LEDs", "`hm2 poke` does not reach it either"),
]
