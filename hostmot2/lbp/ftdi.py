"""LBP over an FTDI chip without a kernel driver: pyftdi on pyusb. Source: lbp_serial.md 8."""

from __future__ import annotations

import errno
import time
from contextlib import suppress

from pyftdi.ftdi import Ftdi, FtdiError
from pyftdi.usbtools import UsbToolsError
from usb.core import NoBackendError, USBError
from usb.util import claim_interface

from hostmot2.errors import PermissionDenied
from hostmot2.lbp.errors import AdapterBusy, AdapterMissing, LineSilent

LATENCY_MS = 1


class FtdiStream:
    """An FTDI chip, 8N1, no flow control. url: as pyftdi has it, such as ftdi:///1 or ftdi://ftdi:232:SERIAL/1.

    Raises AdapterMissing, AdapterBusy, PermissionDenied, ValueError for a rate the chip cannot have.
    """

    def __init__(self, url: str, baud: int = 115200) -> None:
        self.url = url
        self.baud = baud
        self._chip = Ftdi()
        self._ahead = b""
        try:
            self._chip.open_from_url(url)
            number = url.rpartition("/")[2]
            claim_interface(self._chip.usb_dev, (int(number) if number.isdigit() else 1) - 1)
        except (FtdiError, UsbToolsError, USBError, NoBackendError, OSError, ValueError) as failure:
            with suppress(FtdiError, USBError):
                self._chip.close()
            raise _opening(url, failure) from failure
        try:
            self._chip.set_baudrate(baud)  # ValueError when the nearest rate is more than 3 % off
            self._chip.set_line_property(8, 1, "N")
            self._chip.set_flowctrl("")
            self._chip.set_latency_timer(LATENCY_MS)
            self._chip.purge_buffers()
        except BaseException:
            self._chip.close()
            raise

    def send(self, data: bytes) -> None:
        """One bulk transfer."""
        try:
            self._chip.write_data(data)
        except (FtdiError, USBError) as failure:
            raise LineSilent(f"{self.url}: {failure}") from failure

    def receive(self, count: int, timeout_s: float) -> bytes:
        """Up to `count` bytes within the time; at least one look is taken."""
        deadline = time.monotonic() + timeout_s
        while len(self._ahead) < count:
            came = self._read()
            self._ahead += came
            if not came and time.monotonic() >= deadline:
                break
        taken, self._ahead = self._ahead[:count], self._ahead[count:]
        return taken

    def _read(self) -> bytes:
        """What the chip has; it answers at the latest when its latency timer runs out."""
        try:
            return bytes(self._chip.read_data_bytes(256))
        except (FtdiError, USBError) as failure:
            raise LineSilent(f"{self.url}: {failure}") from failure

    def flush(self) -> int:
        """Take what is there, until there is nothing."""
        count = len(self._ahead)
        self._ahead = b""
        while came := self._read():
            count += len(came)
        return count

    def pause(self, seconds: float) -> None:
        """Sleep."""
        time.sleep(seconds)

    def close(self) -> None:
        """Release the chip; a kernel driver gets it back."""
        self._chip.close()

    def __str__(self) -> str:
        return self.url


def _opening(url: str, failure: Exception) -> Exception:
    cause: BaseException | None = failure
    while cause is not None:
        number = getattr(cause, "errno", None)
        if number in (errno.EACCES, errno.EPERM):
            return PermissionDenied(f"{url}: {failure}", os_errno=number)
        if number == errno.EBUSY:
            return AdapterBusy(f"{url}: another program uses it", os_errno=number)
        cause = cause.__cause__ or cause.__context__
    if "no langid" in str(failure):  # so pyusb puts it that a chip is there and may not be opened
        return PermissionDenied(f"{url}: {failure}", os_errno=errno.EACCES)
    return AdapterMissing(f"{url}: {failure}")
