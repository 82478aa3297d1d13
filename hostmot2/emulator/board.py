"""EmulatedBoard: a card with its FPGA, daughter cards and wires, answering like the real one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any, Literal, TypeVar

from hostmot2._core import ffi, lib
from hostmot2.emulator import catalog
from hostmot2.emulator.cards import DAUGHTER_REMOTES, IDROM_WORDS, CardDescription, card
from hostmot2.emulator.encoder import EmulatedEncoder
from hostmot2.emulator.pin import EmulatedPin
from hostmot2.emulator.sserial_port import EmulatedSserialPort
from hostmot2.emulator.stimulus import (
    EmulatedInmux,
    EmulatedPktuart,
    EmulatedResolver,
    EmulatedSignal,
    EmulatedSpiSlaves,
    EmulatedSsiEncoder,
    EmulatedUart,
)
from hostmot2.errors import check, new_error
from hostmot2.handles import own

Stimulus = TypeVar("Stimulus")

UNDRIVEN: int = lib.HM2_EMULATOR_UNDRIVEN
"""What a read gives where nothing answers."""


class EmulatedBoard:
    """An emulated card.

    `spec` is a name such as "5i25+7i77" (`hostmot2.emulator.cards.CARD_NAMES`), a `CardDescription`, or
    the words of an IDROM from its offset on. `clock` is "virtual" (time stands still until advanced) or
    "real". `wire="off"` lets serial bytes take no time. `sserial_channels` overrides the number of
    channels of the SSERIAL instances, `processor_clock_hz` is their processor's clock. `firmware` is the
    register generation, "a" or "b" (PCI cards have a, Ethernet cards b unless said). With `strict` an
    access that nothing decodes raises ProtocolError; else it reads `UNDRIVEN`. There is one engine, which
    is exact whether `exact` asks for it or not.

    The remotes of the daughter cards hang on the card's pins: they answer once the driver has switched the
    pins to their secondary function. A remote that `sserial[i].attach` puts in place needs no pins.

    One thread at a time may use a board. Times are microseconds.
    """

    def __init__(
        self,
        spec: str | CardDescription | Sequence[int] = "5i25+7i77",
        *,
        clock: Literal["virtual", "real"] = "real",
        wire: Literal["on", "off"] = "on",
        sserial_channels: int | None = None,
        processor_clock_hz: int = 100_000_000,
        firmware: str | None = None,
        strict: bool = False,
        exact: bool = True,
    ) -> None:
        self.clock = clock
        """"virtual" or "real"."""
        if clock not in ("virtual", "real") or wire not in ("on", "off"):
            raise ValueError('clock is "virtual" or "real", wire is "on" or "off"')
        if sserial_channels is not None and not 1 <= sserial_channels <= 8:
            raise ValueError("an SSERIAL instance has 1 to 8 channels")
        if isinstance(spec, str):
            spec = card(spec, firmware)
        self.description = spec if isinstance(spec, CardDescription) else None
        """What the card is made of; None when it was made from raw IDROM words."""
        words = spec.idrom() if isinstance(spec, CardDescription) else list(spec)
        if len(words) > IDROM_WORDS:
            raise ValueError(f"an IDROM has {IDROM_WORDS} words, not {len(words)}")
        options: Any = ffi.new("hm2_emulator_options *")
        options.clock = lib.HM2_CLOCK_REAL if clock == "real" else lib.HM2_CLOCK_VIRTUAL
        options.wire_off = wire == "off"
        options.strict = strict
        options.sserial_channels = sserial_channels or 0
        options.sserial_clock_hz = processor_clock_hz
        options.leds = self.description.leds if self.description else 2
        options.interrupt = self.description is None or self.description.bus == "pci"
        self._error = new_error()
        out: Any = ffi.new("hm2_emulator **")
        check(
            lib.hm2_emulator_new(ffi.new("uint32_t[]", words), len(words), options, out, self._error),
            self._error,
        )
        self._handle, self._hidden = own(out[0], lib.hm2_emulator_free)
        self._closed = False
        self._bus: Any = None
        self._plugged: set[int] = set()
        self._stimuli: dict[tuple[object, int], Any] = {}
        self._kept: list[object] = []
        self._mux_delay_ns = 5.0
        self.sserial: list[EmulatedSserialPort] = []
        """The SSERIAL instances."""
        while lib.hm2_emulator_sserial_channels(self.handle, len(self.sserial)):
            self.sserial.append(EmulatedSserialPort(self, len(self.sserial)))
        self._attach_daughters()

    def _attach_daughters(self) -> None:
        """The daughter cards' own remotes hang on the card's pins."""
        for number, daughter in enumerate(self.description.daughters if self.description else ()):
            for position, name in enumerate(DAUGHTER_REMOTES[daughter.name]):
                channel = daughter.sserial_channel + position
                if channel >= self.sserial[0].channels:
                    continue
                unit = catalog.CATALOG[name].unit_number + number
                self.sserial[0].attach(channel, catalog.remote(name, unit_number=unit), through_pins=True)

    @property
    def handle(self) -> Any:
        """The `hm2_emulator *` of the C core. Raises ValueError on a closed board."""
        if self._closed:
            raise ValueError("the emulated board is closed")
        return self._handle

    def read(self, address: int, count: int = 1) -> Any:
        """One word, or a list of `count` words at consecutive addresses; takes no virtual time.

        Raises ValueError for an address outside the register file or not a multiple of four, and, on a
        strict board, ProtocolError for one that nothing decodes.
        """
        if count < 1:
            raise ValueError(f"count must be at least 1, not {count}")
        buffer: Any = ffi.new("uint32_t[]", count)
        check(lib.hm2_emulator_read(self.handle, address, buffer, count, self._error), self._error)
        return int(buffer[0]) if count == 1 else list(buffer)

    def write(self, address: int, words: int | Sequence[int]) -> None:
        """Write one word, or several at consecutive addresses; takes no virtual time. Raises like `read`."""
        values = [words] if isinstance(words, int) else list(words)
        buffer = ffi.new("uint32_t[]", values)
        check(lib.hm2_emulator_write(self.handle, address, buffer, len(values), self._error), self._error)

    def keep(self, part: object) -> None:
        """Keep `part` alive as long as the board: something the core works on."""
        self._kept.append(part)

    def advance(self, us: float) -> None:
        """Let virtual time pass, in microseconds. On a real clock time passes by itself."""
        lib.hm2_emulator_advance_ps(self.handle, round(us * 1e6))

    def advance_clocks(self, clocks: int) -> None:
        """Let `clocks` periods of ClockLow pass."""
        lib.hm2_emulator_advance_clocks(self.handle, clocks)

    def sync(self) -> None:
        """Bring every part of the card up to now; accesses do it for the part they reach."""
        lib.hm2_emulator_sync(self.handle)

    @property
    def now_us(self) -> float:
        """The card's time in microseconds."""
        return float(lib.hm2_emulator_now_ps(self.handle)) / 1e6

    @property
    def clocks(self) -> int:
        """Rising edges of ClockLow so far. The first lies half a period behind time 0."""
        return int(lib.hm2_emulator_clocks(self.handle))

    @property
    def bus(self) -> Any:
        """The `hm2_bus *` for a driver; alive as long as this board."""
        if self._bus is None:
            self._bus = ffi.new("hm2_bus *")
            lib.hm2_emulator_bus(self.handle, self._bus)
        return self._bus

    def pin(self, number: int) -> EmulatedPin:
        """The pad IO`number`. Raises IndexError when the card has no such pin."""
        if not 0 <= number < lib.hm2_emulator_pins(self.handle):
            raise IndexError(f"no pin IO{number}")
        return EmulatedPin(self, number)

    @property
    def pins(self) -> Iterator[EmulatedPin]:
        """All pads in order."""
        return (EmulatedPin(self, n) for n in range(lib.hm2_emulator_pins(self.handle)))

    def encoder_input(self, number: int) -> EmulatedEncoder:
        """The encoder at encoder input `number`, plugged in by the first call.

        Numbered as the module descriptors count them; of two muxed ones that share pins each has its
        number. Until then the lines float. Raises IndexError when the card has no such input.
        """
        if not 0 <= number < lib.hm2_emulator_encoders(self.handle):
            raise IndexError(f"no encoder input {number}")
        if number not in self._plugged:
            lib.hm2_emulator_encoder_plug(self.handle, number, 1)
            self._plugged.add(number)
        return EmulatedEncoder(self, number)

    def _stimulus(self, kind: Callable[[Any, int], Stimulus], unit: int) -> Stimulus:
        """One object per instance, made when first asked for."""
        if (kind, unit) not in self._stimuli:
            self._stimuli[kind, unit] = kind(self.handle, unit)
        stimulus: Stimulus = self._stimuli[kind, unit]
        return stimulus

    def inmux(self, unit: int) -> EmulatedInmux:
        """What hangs on InMux instance `unit`. Raises IndexError when the card has none."""
        return self._stimulus(EmulatedInmux, unit)

    def period(self, unit: int) -> EmulatedSignal:
        """The signal generator at period meter `unit`. Raises IndexError when the card has none."""
        return self._stimulus(EmulatedSignal, unit)

    def resolver(self, channel: int) -> EmulatedResolver:
        """The resolver on `channel`. Raises IndexError when the card has none."""
        return self._stimulus(EmulatedResolver, channel)

    def ssi(self, channel: int) -> EmulatedSsiEncoder:
        """The SSI encoder on `channel`. Raises IndexError when the card has none."""
        return self._stimulus(EmulatedSsiEncoder, channel)

    def uart(self, unit: int) -> EmulatedUart:
        """What hangs on UART `unit`."""
        return self._stimulus(EmulatedUart, unit)

    def pktuart(self, unit: int) -> EmulatedPktuart:
        """What hangs on packet UART `unit`."""
        return self._stimulus(EmulatedPktuart, unit)

    def bspi(self, unit: int) -> EmulatedSpiSlaves:
        """What hangs on buffered SPI `unit`. Raises IndexError when the card has none."""
        return self._stimulus(EmulatedSpiSlaves, unit)

    @property
    def mux_delay_ns(self) -> float:
        """From Sel0 to the multiplexed encoder lines and back; cable and daughter card."""
        return self._mux_delay_ns

    @mux_delay_ns.setter
    def mux_delay_ns(self, ns: float) -> None:
        if lib.hm2_emulator_set_mux_delay_ps(self.handle, round(ns * 1000)) != lib.HM2_OK:
            raise ValueError("a multiplexer delay is 0 to 1000000 ns")
        self._mux_delay_ns = ns

    @property
    def leds(self) -> list[bool]:
        """Whether CR01, CR02, ... are lit."""
        lit = lib.hm2_emulator_leds(self.handle)
        count = self.description.leds if self.description else 2
        return [bool(lit >> n & 1) for n in range(count)]

    @property
    def interrupt(self) -> bool:
        """Whether the card asserts its interrupt."""
        return bool(lib.hm2_emulator_interrupt(self.handle))

    def close(self) -> None:
        """Take the card away: using it afterwards is a ValueError. An open driver keeps it alive."""
        self._closed = True

    def __enter__(self) -> EmulatedBoard:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        name = self.description.name if self.description else "from IDROM words"
        return f"<EmulatedBoard {name} at {self.now_us:.3f} us>"
