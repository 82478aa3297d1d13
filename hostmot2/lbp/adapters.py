"""Serial and USB adapters of this machine. Source: lbp_serial.md 8."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

FTDI = 0x0403
"""USB vendor of the chips that RS-422 adapters such as Mesa's 3I22 are expected to have."""


@dataclass(frozen=True, slots=True)
class Adapter:
    """One adapter. port: what to open. driver: "serial" for a device file, "usb" without a kernel driver."""

    port: str
    driver: str
    description: str
    serial_number: str = ""
    usb_id: str = ""
    location: str = ""

    @property
    def likely(self) -> bool:
        """Whether it has a chip that RS-422 adapters have. Never enough to choose one by."""
        return self.usb_id.startswith(f"{FTDI:04X}:")


def adapters() -> list[Adapter]:
    """All adapters: device files as pyserial lists them, FTDI chips as pyusb sees them.

    A list that cannot be had (package or permission missing) is left out.
    """
    return [*_serial_ports(), *_usb_chips()]


def _serial_ports() -> Iterable[Adapter]:
    try:
        from serial.tools import list_ports
    except ImportError:
        return
    for port in sorted(list_ports.comports(), key=lambda found: str(found.device)):
        usb_id = f"{port.vid:04X}:{port.pid:04X}" if port.vid is not None else ""
        yield Adapter(
            port.device,
            "serial",
            port.description or "",
            port.serial_number or "",
            usb_id,
            port.location or "",
        )


def _usb_chips() -> Iterable[Adapter]:
    try:
        from pyftdi.ftdi import Ftdi
        from usb.core import NoBackendError, USBError
    except ImportError:
        return
    try:
        found = Ftdi.list_devices()
    except (USBError, NoBackendError, ValueError, OSError):
        return
    for chip, interfaces in found:
        for interface in range(1, interfaces + 1):
            selector = chip.sn or f"{chip.bus:x}:{chip.address:x}"
            yield Adapter(
                f"ftdi://0x{chip.vid:04x}:0x{chip.pid:04x}:{selector}/{interface}",
                "usb",
                chip.description or "",
                chip.sn or "",
                f"{chip.vid:04X}:{chip.pid:04X}",
                f"{chip.bus}-{chip.address}",
            )
