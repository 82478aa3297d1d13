"""The cards that can be emulated, as the words of their IDROM.

A card is a header, module descriptors and pin descriptors (fact sheet registers.md 1.3-1.5, 3). What is
known of real configurations is taken word for word; contents inferred there are inferred here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from hostmot2.registers import Gtag

IDROM_WORDS = 256
GPIO = 0x03000000
MODULE_OFFSET, PIN_OFFSET = 64, 448


@dataclass(frozen=True)
class ModuleWords:
    """One module descriptor: what the card has of a module and where (registers.md 1.4)."""

    gtag: int
    base: int
    registers: int
    instances: int = 1
    version: int = 0
    clock: int = 1
    """1: ClockLow, 2: ClockHigh."""
    strides: int = 0
    """Bits 3..0 register stride selector, 7..4 instance stride selector."""
    multiple: int = 0
    """Bit r: register r exists once per instance."""

    def words(self) -> tuple[int, int, int]:
        """The three words of the descriptor."""
        return (
            self.instances << 24 | self.clock << 16 | self.version << 8 | self.gtag,
            self.strides << 24 | self.registers << 16 | self.base,
            self.multiple,
        )


@dataclass(frozen=True)
class Daughter:
    """A daughter card on a port: what it wires to the pins besides what the descriptors say."""

    name: str
    port: int
    sserial_channel: int = 0
    """The first SSERIAL channel of its remotes."""


DAUGHTER_REMOTES = {
    "7i77": ("7i77-io", "7i77-analog"),
    "7i77d": ("7i77d-io", "7i77d-analog"),
    "7i76": ("7i76",),
}
"""The remotes of a daughter card in the catalogue, in the order of its SSERIAL channels (sserial.md 9)."""


@dataclass(frozen=True)
class CardDescription:
    """Everything an emulated card is made of. Make your own, or `dataclasses.replace` one of ours."""

    name: str
    board_name: str
    """Eight characters, e.g. "MESA5I25"."""
    modules: tuple[ModuleWords, ...]
    pins: tuple[int, ...]
    """One pin descriptor word per pin, port by port."""
    port_width: int = 17
    clock_low: int = 33_333_333
    clock_high: int = 200_000_000
    fpga_size: int = 9
    fpga_pins: int = 144
    leds: int = 2
    bus: str = "pci"
    """"pci" cards have the interrupt registers."""
    daughters: tuple[Daughter, ...] = ()
    idrom_type: int = field(default=3)
    instance_stride: int = 64
    """The second instance stride: 64, 16 where there are UARTs."""

    def idrom(self) -> list[int]:
        """The 256 words from the IDROM offset on. Raises ValueError when it does not fit."""
        if len(self.pins) % self.port_width:
            raise ValueError(f"{len(self.pins)} pins are no multiple of the port width {self.port_width}")
        name = self.board_name.encode("ascii").ljust(8, b"\0")[:8]
        header = [
            self.idrom_type, MODULE_OFFSET, PIN_OFFSET,
            int.from_bytes(name[:4], "little"), int.from_bytes(name[4:], "little"),
            self.fpga_size, self.fpga_pins,
            len(self.pins) // self.port_width, len(self.pins), self.port_width,
            self.clock_low, self.clock_high, 4, self.instance_stride, 256, 256,
        ]  # fmt: skip
        words = header + [0] * (IDROM_WORDS - len(header))
        descriptors = [word for module in self.modules for word in module.words()]
        if len(descriptors) + 3 > (PIN_OFFSET - MODULE_OFFSET) // 4 + 3 or len(self.pins) > 144:
            raise ValueError("an IDROM holds 32 module descriptors and 144 pins")
        words[MODULE_OFFSET // 4 : MODULE_OFFSET // 4 + len(descriptors)] = descriptors
        words[PIN_OFFSET // 4 : PIN_OFFSET // 4 + len(self.pins)] = self.pins
        return words


def pin(tag: int, number: int, unit: int = 0) -> int:
    """A pin descriptor word: module tag, function number and unit (registers.md 1.5)."""
    return GPIO | unit << 16 | tag << 8 | number


def pins_7i77(first_channel: int, first_unit: int, select_unit: int) -> tuple[int, ...]:
    """The 17 pins of a 7I77 (registers.md 3.2)."""
    c = first_channel + 1
    serial = [pin(Gtag.SSERIAL, kind + c + n) for kind, n in (
        (0x90, 2), (0x80, 2), (0x00, 2), (0x80, 1), (0x00, 1), (0x80, 0), (0x00, 0),
    )]  # fmt: skip
    encoders = [pin(Gtag.MUXED_ENCODER, line, first_unit + u) for u in range(3) for line in (1, 2, 3)]
    return (*serial, pin(Gtag.MUXED_ENCODER_SELECT, 0x81, select_unit), *encoders)


def pins_7i76(first_channel: int, first_stepgen: int, encoder: Sequence[int]) -> tuple[int, ...]:
    """The 17 pins of a 7I76 (registers.md 3.3-3.5); `encoder` its Z, B and A words."""
    steps = [pin(Gtag.STEPGEN, number, first_stepgen + n) for n in range(5) for number in (0x82, 0x81)]
    serial = [pin(Gtag.SSERIAL, kind + first_channel + n + 1) for n in (0, 1) for kind in (0x80, 0x00)]
    return (*steps, *serial, *encoder)


@dataclass(frozen=True)
class Generation:
    """Base addresses of one register generation (registers.md 0)."""

    muxed_qcount: int
    pwm: int
    sserial: int


GENERATIONS = {"a": Generation(0x3500, 0x4000, 0x5A00), "b": Generation(0x3600, 0x4100, 0x5B00)}


def _modules(
    generation: Generation,
    ports: int,
    *,
    dpll: bool = False,
    stepgens: int = 0,
    encoders: int = 0,
    muxed: int = 0,
    sserial: bool = True,
    ssr: bool = False,
) -> tuple[ModuleWords, ...]:
    rows: list[ModuleWords] = []
    if dpll:
        rows.append(ModuleWords(Gtag.DPLL, 0x7000, 7))
    rows.append(ModuleWords(Gtag.WATCHDOG, 0x0C00, 3))
    rows.append(ModuleWords(Gtag.IOPORT, 0x1000, 5, instances=ports, multiple=0x1F))
    if encoders:
        rows.append(ModuleWords(Gtag.ENCODER, 0x3000, 5, instances=encoders, version=2, multiple=3))
    if muxed:
        rows.append(
            ModuleWords(
                Gtag.MUXED_ENCODER, generation.muxed_qcount, 5, instances=muxed, version=3, multiple=3
            )
        )
        rows.append(ModuleWords(Gtag.MUXED_ENCODER_SELECT, 0x0000, 0))
    if sserial:
        rows.append(ModuleWords(Gtag.SSERIAL, generation.sserial, 6, strides=0x10, multiple=0x3C))
    if stepgens:
        rows.append(ModuleWords(Gtag.STEPGEN, 0x2000, 10, instances=stepgens, version=2, multiple=0x1FF))
    if ssr:
        rows.append(ModuleWords(Gtag.SSR, 0x7D00, 2))
    rows.append(ModuleWords(Gtag.LED, 0x0200, 1))
    return tuple(rows)


def _5i25_7i77(generation: Generation) -> CardDescription:
    return CardDescription(
        name="5i25+7i77",
        board_name="MESA5I25",
        modules=_modules(generation, 2, muxed=6),
        pins=(*pins_7i77(0, 0, 0), *(GPIO,) * 17),
        daughters=(Daughter("7i77", 0),),
    )


def _5i25_7i77x2(generation: Generation) -> CardDescription:
    return CardDescription(
        name="5i25+7i77x2",
        board_name="MESA5I25",
        modules=_modules(generation, 2, muxed=12),
        pins=(*pins_7i77(0, 0, 0), *pins_7i77(3, 3, 6)),
        daughters=(Daughter("7i77", 0), Daughter("7i77", 1, 3)),
    )


def _5i25_7i77_7i76(generation: Generation) -> CardDescription:
    encoder = [pin(Gtag.MUXED_ENCODER, line, 3) for line in (3, 2, 1)]
    return CardDescription(
        name="5i25+7i77+7i76",
        board_name="MESA5I25",
        modules=_modules(generation, 2, muxed=8, stepgens=5),
        pins=(*pins_7i77(0, 0, 0), *pins_7i76(3, 0, encoder)),
        daughters=(Daughter("7i77", 0), Daughter("7i76", 1, 3)),
    )


def _6i25(base: CardDescription) -> CardDescription:
    return replace(base, name=base.name.replace("5i25", "6i25"), board_name="MESA6I25", clock_low=66_666_666)


def _ethernet(base: CardDescription, name: str, **changes: object) -> CardDescription:
    """What it says over LBP16 beside its registers is in ethernet.DESCRIPTIONS."""
    values: dict[str, object] = {
        "name": name, "board_name": "MESA" + name[:4].upper(),
        "clock_low": 100_000_000, "leds": 4, "bus": "ethernet",
    }  # fmt: skip
    return replace(base, **{**values, **changes})  # type: ignore[arg-type]


def _7i92_7i77(generation: Generation) -> CardDescription:
    return _ethernet(_5i25_7i77(generation), "7i92+7i77", modules=_modules(generation, 2, muxed=6, dpll=True))


def _7i92_7i77_7i76(generation: Generation) -> CardDescription:
    return _ethernet(
        _5i25_7i77_7i76(generation),
        "7i92+7i77+7i76",
        modules=_modules(generation, 2, muxed=8, stepgens=5, dpll=True),
    )


def _7i76e(generation: Generation) -> CardDescription:
    encoder = [pin(Gtag.ENCODER, line) for line in (3, 2, 1)]
    rows = list(_modules(generation, 3, dpll=True, stepgens=5, encoders=1))
    tags = (Gtag.DPLL, Gtag.WATCHDOG, Gtag.IOPORT, Gtag.STEPGEN, Gtag.ENCODER, Gtag.SSERIAL, Gtag.LED)
    rows.sort(key=lambda row: tags.index(row.gtag))  # the order of registers.md 3.5
    base = CardDescription(
        name="7i76e",
        board_name="MESA7I76",
        modules=tuple(rows),
        pins=(*pins_7i76(0, 0, encoder), *(GPIO,) * 34),
        daughters=(Daughter("7i76", 0),),
    )
    return _ethernet(base, "7i76e", fpga_size=16, fpga_pins=256)


def _7i96(generation: Generation) -> CardDescription:
    pins = [GPIO] * 51
    pins[11:17] = [pin(Gtag.SSR, 0x81 + n) for n in range(6)]
    pins[17:27] = [pin(Gtag.STEPGEN, number, n) for n in range(5) for number in (0x81, 0x82)]
    pins[27:30] = [pin(Gtag.ENCODER, line) for line in (1, 2, 3)]
    pins[30:33] = [pin(Gtag.SSERIAL, number) for number in (0x01, 0x81, 0x91)]
    pins[33] = pin(Gtag.SSR, 0xA0)
    base = CardDescription(
        name="7i96",
        board_name="MESA7I96",
        modules=_modules(generation, 3, dpll=True, stepgens=5, encoders=1, ssr=True),
        pins=tuple(pins),
    )
    return _ethernet(base, "7i96")


def _7i80hd(generation: Generation) -> CardDescription:
    base = CardDescription(
        name="7i80hd",
        board_name="MESA7I80",
        modules=_modules(generation, 3, dpll=True, sserial=False),
        pins=(GPIO,) * 72,
        port_width=24,
    )
    return _ethernet(base, "7i80hd", fpga_size=16, fpga_pins=256)


_CARDS: dict[str, Callable[[Generation], CardDescription]] = {
    "5i25+7i77": _5i25_7i77,
    "5i25+7i77x2": _5i25_7i77x2,
    "5i25+7i77+7i76": _5i25_7i77_7i76,
    "6i25+7i77": lambda generation: _6i25(_5i25_7i77(generation)),
    "6i25+7i77x2": lambda generation: _6i25(_5i25_7i77x2(generation)),
    "7i92+7i77": _7i92_7i77,
    "7i92+7i77+7i76": _7i92_7i77_7i76,
    "7i76e": _7i76e,
    "7i96": _7i96,
    "7i80hd": _7i80hd,
}

CARD_NAMES = tuple(_CARDS)
"""The specs `card()` knows."""


def card(spec: str, firmware: str | None = None) -> CardDescription:
    """The description of a known card.

    `firmware` is the register generation, "a" or "b"; PCI cards have a, Ethernet cards b unless said.
    Raises KeyError for an unknown card and ValueError for an unknown generation.
    """
    try:
        build = _CARDS[spec.lower()]
    except KeyError:
        raise KeyError(f"no emulated card {spec!r}; there are {', '.join(CARD_NAMES)}") from None
    if firmware is None:
        firmware = "b" if build(GENERATIONS["b"]).bus == "ethernet" else "a"
    if firmware.lower() not in GENERATIONS:
        raise ValueError(f"firmware {firmware!r} is neither 'a' nor 'b'")
    return build(GENERATIONS[firmware.lower()])
