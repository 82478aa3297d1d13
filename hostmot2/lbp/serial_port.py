"""LBP over a serial port of the operating system: USB adapters with a kernel driver, RS-422 cards, ptys."""

from __future__ import annotations

import errno
import termios
import time
from pathlib import Path

import serial

from hostmot2.errors import PermissionDenied
from hostmot2.lbp.errors import AdapterBusy, AdapterMissing, LineSilent

LATENCY_MS = 1
_GONE = (serial.SerialException, OSError, termios.error)
USB_SERIAL = Path("/sys/bus/usb-serial/devices")


class SerialStream:
    """A serial port, 8N1, no flow control, for this program alone.

    Raises AdapterMissing, AdapterBusy, PermissionDenied, ValueError for a rate the port cannot have.
    """

    def __init__(self, path: str, baud: int = 115200) -> None:
        self.url = path
        self.baud = baud
        try:
            self._port = serial.Serial(path, baud, exclusive=True, timeout=0)
        except (serial.SerialException, termios.error) as failure:
            raise _opening(path, failure) from failure
        _low_latency(path)

    def send(self, data: bytes) -> None:
        """One write, so that the bytes stay together."""
        try:
            self._port.write(data)
            self._port.flush()
        except _GONE as failure:
            raise LineSilent(f"{self.url}: {failure}") from failure

    def receive(self, count: int, timeout_s: float) -> bytes:
        """Up to `count` bytes within the time."""
        try:
            self._port.timeout = timeout_s
            return bytes(self._port.read(count))
        except _GONE as failure:
            raise LineSilent(f"{self.url}: {failure}") from failure

    def flush(self) -> int:
        """Read away what is there."""
        try:
            waiting = self._port.in_waiting
            self._port.reset_input_buffer()
        except _GONE as failure:
            raise LineSilent(f"{self.url}: {failure}") from failure
        return int(waiting)

    def pause(self, seconds: float) -> None:
        """Sleep."""
        time.sleep(seconds)

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def __str__(self) -> str:
        return self.url


def _opening(path: str, failure: Exception) -> Exception:
    number = getattr(failure, "errno", None)
    if number in (errno.EACCES, errno.EPERM):
        return PermissionDenied(f"{path}: {failure}", os_errno=number)
    if number in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in str(failure):
        return AdapterBusy(f"{path}: another program uses it", os_errno=number)
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return AdapterMissing(f"{path}: there is no such port", os_errno=number)
    return AdapterMissing(f"{path}: {failure}", os_errno=number)


def _low_latency(path: str) -> None:
    """FTDI chips hold short answers back for 16 ms unless told otherwise; without the right it stays slow."""
    timer = USB_SERIAL / Path(path).resolve().name / "latency_timer"
    try:
        if int(timer.read_text()) > LATENCY_MS:
            timer.write_text(str(LATENCY_MS))
    except (OSError, ValueError):
        pass
