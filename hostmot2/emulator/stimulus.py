"""What hangs on the smaller modules of an emulated card: made by the methods of EmulatedBoard."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from hostmot2._core import ffi, lib
from hostmot2.registers import PktuartRx


def _checked(status: int, what: str) -> None:
    if status < 0:
        raise IndexError(f"the card has no {what}")


class EmulatedInmux:
    """The multiplexer of one InMux instance, with 32 lines. Lines float high (pull-ups) until set."""

    def __init__(self, handle: Any, unit: int) -> None:
        self._handle, self.unit = handle, unit
        self._levels = 0xFFFFFFFF
        self._write()

    def _write(self) -> None:
        _checked(lib.hm2_emulator_inmux_set(self._handle, self.unit, self._levels), f"InMux {self.unit}")

    def drive(self, number: int, level: int) -> None:
        """Put a level, 0 or 1, on line `number`, 0 to 31."""
        if not 0 <= number < 32 or level not in (0, 1):
            raise ValueError(f"line {number}, level {level!r}")
        self._levels = self._levels & ~(1 << number) | level << number
        self._write()


class EmulatedSignal:
    """A signal generator at the input of a period meter."""

    def __init__(self, handle: Any, unit: int) -> None:
        self._handle, self.unit = handle, unit
        self.stop()

    def run(self, hertz: float, duty: float = 0.5) -> None:
        """A rectangle from now on, starting with its high part. duty: 0 to 1."""
        if not 0 < hertz <= 1e9 or not 0 <= duty <= 1:
            raise ValueError(f"a signal of {hertz} Hz, duty {duty}")
        period = round(1e12 / hertz)
        self._write(period, round(period * duty))

    def stop(self) -> None:
        """Let go of the line."""
        self._write(0, 0)

    def _write(self, period_ps: int, high_ps: int) -> None:
        status = lib.hm2_emulator_period_signal(self._handle, self.unit, period_ps, high_ps)
        _checked(status, f"period meter {self.unit}")


class EmulatedResolver:
    """A resolver on a shaft; angles in electrical turns."""

    def __init__(self, handle: Any, channel: int) -> None:
        self._handle, self.channel = handle, channel
        self._speed = 0.0
        _checked(
            lib.hm2_emulator_resolver_angle(handle, channel, ffi.new("uint32_t *")), f"resolver {channel}"
        )

    @property
    def angle(self) -> float:
        """Where the shaft is, 0 to 1; setting it puts it there, at the same speed."""
        out = ffi.new("uint32_t *")
        lib.hm2_emulator_resolver_angle(self._handle, self.channel, out)
        return float(out[0]) / 2**32

    @angle.setter
    def angle(self, turns: float) -> None:
        self._set(turns, self._speed)

    @property
    def speed(self) -> float:
        """Turns per second."""
        return self._speed

    @speed.setter
    def speed(self, turns_per_second: float) -> None:
        self._set(self.angle, turns_per_second)

    def _set(self, turns: float, speed: float) -> None:
        if not math.isfinite(turns):
            raise ValueError(f"an angle of {turns} turns")
        angle = round(turns * 2**32) & 0xFFFFFFFF
        if lib.hm2_emulator_resolver_set(self._handle, self.channel, angle, speed) != lib.HM2_OK:
            raise ValueError(f"{speed} turns per second")
        self._speed = speed

    def set_flag(self, flag: bool) -> None:
        """Set the resolver's bit in the status register."""
        lib.hm2_emulator_resolver_flag(self._handle, self.channel, flag)


class EmulatedSsiEncoder:
    """An SSI encoder; asking for it plugs it in."""

    def __init__(self, handle: Any, channel: int) -> None:
        self._handle, self.channel, self._value = handle, channel, 0
        self._write(1)

    @property
    def value(self) -> int:
        """The bits it sends, the last sent the least significant; 64 at most."""
        return self._value

    @value.setter
    def value(self, value: int) -> None:
        if not 0 <= value < 1 << 64:
            raise ValueError(f"{value} is no 64-bit value")
        self._value = value
        self._write(1)

    def unplug(self) -> None:
        """Take it off: its line floats."""
        self._write(0)

    def _write(self, plugged: int) -> None:
        status = lib.hm2_emulator_ssi_set(self._handle, self.channel, plugged, self._value)
        _checked(status, f"SSI channel {self.channel}")


class EmulatedUart:
    """What hangs on a UART: a terminal that hears the transmitter and talks to the receiver."""

    def __init__(self, handle: Any, unit: int) -> None:
        self._handle, self.unit = handle, unit

    def send(self, data: bytes) -> None:
        """Put bytes on the receiver's line, behind those under way; at the receiver's bit rate."""
        status = lib.hm2_emulator_uart_send(self._handle, self.unit, data, len(data))
        _checked(status, f"UART receiver {self.unit}, or its line has more than 4096 bytes waiting")

    @property
    def received(self) -> bytes:
        """What the transmitter has sent since last asked."""
        capacity = 4096
        data, count = ffi.new("uint8_t[]", capacity), ffi.new("size_t *")
        status = lib.hm2_emulator_uart_received(self._handle, self.unit, data, capacity, count)
        _checked(status, f"UART transmitter {self.unit}")
        return bytes(data[0 : count[0]])


class EmulatedPktuart:
    """What hangs on a packet UART."""

    def __init__(self, handle: Any, unit: int) -> None:
        self._handle, self.unit = handle, unit

    def send(
        self,
        frame: bytes,
        *,
        start_error: bool = False,
        overrun: bool = False,
        parity_error: bool = False,
        longest_gap: int = 0,
    ) -> None:
        """A frame of 1 to 1023 bytes that has just arrived, and what the receiver says of it.

        Lost if the receiver is off; lost and flagged if it has no room.
        """
        count = PktuartRx.frame_count
        flags = count.start_error.put(start_error) | count.overrun.put(overrun)
        flags |= count.parity_error.put(parity_error) | count.longest_gap.put(longest_gap)
        status = lib.hm2_emulator_pktuart_send(self._handle, self.unit, frame, len(frame), flags)
        _checked(status, f"packet UART receiver {self.unit} for {len(frame)} bytes")

    @property
    def received(self) -> list[bytes]:
        """The frames that were sent since last asked."""
        capacity = 1023
        data, count = ffi.new("uint8_t[]", capacity), ffi.new("size_t *")
        frames: list[bytes] = []
        while True:
            status = lib.hm2_emulator_pktuart_received(self._handle, self.unit, data, capacity, count)
            _checked(status, f"packet UART transmitter {self.unit}")
            if not status:
                return frames
            frames.append(bytes(data[0 : count[0]]))


class SpiWord(NamedTuple):
    """A word that went out on a buffered SPI."""

    value: int
    bits: int
    chip_select: int
    channel: int


class EmulatedSpiSlaves:
    """What hangs on a buffered SPI."""

    def __init__(self, handle: Any, unit: int) -> None:
        self._handle, self.unit = handle, unit
        self.answer([])

    def answer(self, words: Sequence[int]) -> None:
        """What is shifted in with the next words, one each, whoever is selected; ones without an answer."""
        status = lib.hm2_emulator_bspi_answer(self._handle, self.unit, list(words), len(words))
        _checked(status, f"buffered SPI {self.unit}, or more than 256 answers wait")

    @property
    def sent(self) -> list[SpiWord]:
        """What went out since last asked."""
        capacity = 256
        records, count = ffi.new("hm2_spi_record[]", capacity), ffi.new("size_t *")
        lib.hm2_emulator_bspi_sent(self._handle, self.unit, records, capacity, count)
        return [SpiWord(r.value, r.bits, r.chip_select, r.channel) for r in records[0 : count[0]]]
