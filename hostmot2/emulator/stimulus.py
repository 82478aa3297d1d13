"""What hangs on the smaller modules of an emulated card: made by the methods of EmulatedBoard."""

from __future__ import annotations

from typing import Any

from hostmot2._core import ffi, lib


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
        self._set(turns)

    @property
    def speed(self) -> float:
        """Turns per second."""
        return self._speed

    @speed.setter
    def speed(self, turns_per_second: float) -> None:
        angle = self.angle
        self._speed = turns_per_second
        self._set(angle)

    def _set(self, turns: float) -> None:
        angle = round(turns * 2**32) & 0xFFFFFFFF
        status = lib.hm2_emulator_resolver_set(self._handle, self.channel, angle, self._speed)
        if status != lib.HM2_OK:
            raise ValueError(f"{self._speed} turns per second")

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
