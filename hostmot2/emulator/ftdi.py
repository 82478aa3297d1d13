"""A virtual FTDI chip behind pyusb's backend interface, an emulated remote on its serial side.

    plug(VirtualFtdi(remote))        # from now on ftdi:///1 of pyftdi finds it, and no real chip
    unplug()

What the chip does with rates, latency timer, status bytes and resets follows FTDI's public application notes
as pyftdi uses them; the remote hears the rate that was set. Source: lbp_serial.md 8.
"""

from __future__ import annotations

import time
from array import array
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import usb.backend
from pyftdi.usbtools import UsbTools
from usb.core import USBError, USBTimeoutError

from hostmot2.emulator.remote import EmulatedRemote
from hostmot2.emulator.serial_line import SerialLine

VENDOR, PRODUCT, FT232R = 0x0403, 0x6001, 0x0600
IN_ENDPOINT, OUT_ENDPOINT, PACKET = 0x81, 0x02, 64
STATUS = b"\x01\x60"
"""Modem status and line status (transmitter empty) that precede the data of every IN packet."""

RESET, SET_BAUDRATE, SET_DATA, SET_LATENCY, GET_LATENCY = 0x00, 0x03, 0x04, 0x09, 0x0A
PURGE_RX = 1
GET_DESCRIPTOR, STRING_DESCRIPTOR = 0x06, 0x03
FRACTIONS = (0, 0.5, 0.25, 0.125, 0.375, 0.625, 0.75, 0.875)
BASE_BAUD = 3_000_000
EIO, EBUSY, EPERM = 5, 16, 1


def baud_of_divisor(value: int, index: int) -> int:
    """The rate that a divisor request sets on an FT232R."""
    whole, fraction = value & 0x3FFF, value >> 14 | (index & 1) << 2
    if whole <= 1 and not fraction:
        return (BASE_BAUD, 2_000_000)[whole]
    return round(BASE_BAUD / (whole + FRACTIONS[fraction]))


class VirtualFtdi:
    """An FT232R with a remote on its line. bus, address, serial_number: what it is found by."""

    def __init__(
        self, remote: EmulatedRemote, *, serial_number: str = "HM2EMU", bus: int = 1, address: int = 2
    ) -> None:
        self.remote = remote
        self.strings = {1: "FTDI", 2: "RS-422 adapter", 3: serial_number}
        self.bus, self.address = bus, address
        self.kernel_driver = True
        self.claimed = False
        self.baud = 9600
        self.data_format = 0
        self.latency_ms = 16
        self.error: int | None = None
        """An errno that every transfer ends with from now on: the adapter was pulled."""
        self._line = SerialLine(remote)
        self._waiting = bytearray()

    def sent(self, data: bytes) -> None:
        """Bulk OUT."""
        self._fail()
        self._line.receive(data, self.baud)

    def packet(self) -> bytes:
        """Bulk IN: what came before the latency timer ran out, behind the status bytes."""
        self._fail()
        end_s = time.monotonic() + self.latency_ms / 1000
        while True:
            self._waiting += self._line.take()
            left_s = end_s - time.monotonic()
            if len(self._waiting) >= PACKET - len(STATUS) or left_s <= 0:
                break
            due_s = self._line.due_in_s()
            time.sleep(min(left_s, left_s if due_s is None else due_s))
        data = bytes(self._waiting[: PACKET - len(STATUS)])
        del self._waiting[: len(data)]
        return STATUS + data

    def control(self, request: int, value: int, index: int) -> bytes:
        """Vendor requests."""
        self._fail()
        if request == RESET and value == PURGE_RX:
            self._line.take()
            self._waiting.clear()
        elif request == SET_BAUDRATE:
            self.baud = baud_of_divisor(value, index)
        elif request == SET_DATA:
            self.data_format = value
        elif request == SET_LATENCY:
            self.latency_ms = value
        elif request == GET_LATENCY:
            return bytes([self.latency_ms])
        return b""

    def _fail(self) -> None:
        if self.error is not None:
            raise USBError("the adapter was pulled", -self.error, self.error)


class Backend(usb.backend.IBackend):  # type: ignore[misc]
    """The bus that pyusb sees: the plugged chips and nothing else."""

    def __init__(self) -> None:
        self.chips: list[VirtualFtdi] = []

    def enumerate_devices(self) -> Iterator[VirtualFtdi]:
        """All chips."""
        return iter(self.chips)

    def get_device_descriptor(self, dev: VirtualFtdi) -> Any:
        """That of an FT232R."""
        return SimpleNamespace(
            bLength=18,
            bDescriptorType=1,
            bcdUSB=0x0200,
            bDeviceClass=0,
            bDeviceSubClass=0,
            bDeviceProtocol=0,
            bMaxPacketSize0=8,
            idVendor=VENDOR,
            idProduct=PRODUCT,
            bcdDevice=FT232R,
            iManufacturer=1,
            iProduct=2,
            iSerialNumber=3,
            bNumConfigurations=1,
            bus=dev.bus,
            address=dev.address,
            port_number=None,
            port_numbers=None,
            speed=2,
        )

    def get_configuration_descriptor(self, dev: VirtualFtdi, config: int) -> Any:
        """Its one configuration."""
        if config:
            raise IndexError(config)
        return SimpleNamespace(
            bLength=9,
            bDescriptorType=2,
            wTotalLength=32,
            bNumInterfaces=1,
            bConfigurationValue=1,
            iConfiguration=0,
            bmAttributes=0xA0,
            bMaxPower=45,
            extra_descriptors=[],
        )

    def get_interface_descriptor(self, dev: VirtualFtdi, intf: int, alt: int, config: int) -> Any:
        """Its one interface."""
        if intf or alt or config:
            raise IndexError(intf)
        return SimpleNamespace(
            bLength=9,
            bDescriptorType=4,
            bInterfaceNumber=0,
            bAlternateSetting=0,
            bNumEndpoints=2,
            bInterfaceClass=0xFF,
            bInterfaceSubClass=0xFF,
            bInterfaceProtocol=0xFF,
            iInterface=2,
            extra_descriptors=[],
        )

    def get_endpoint_descriptor(self, dev: VirtualFtdi, ep: int, intf: int, alt: int, config: int) -> Any:
        """Bulk IN and bulk OUT."""
        return SimpleNamespace(
            bLength=7,
            bDescriptorType=5,
            bEndpointAddress=(IN_ENDPOINT, OUT_ENDPOINT)[ep],
            bmAttributes=2,
            wMaxPacketSize=PACKET,
            bInterval=0,
            bRefresh=0,
            bSynchAddress=0,
            extra_descriptors=[],
        )

    def open_device(self, dev: VirtualFtdi) -> VirtualFtdi:
        """The chip is its own handle."""
        return dev

    def close_device(self, dev_handle: VirtualFtdi) -> None:
        """Nothing is held."""

    def set_configuration(self, dev_handle: VirtualFtdi, config_value: int) -> None:
        """There is one only; it cannot be set while the kernel driver has the chip."""
        if dev_handle.kernel_driver:
            raise USBError("Resource busy", -6, EBUSY)

    def get_configuration(self, dev_handle: VirtualFtdi) -> int:
        """The one."""
        return 1

    def claim_interface(self, dev_handle: VirtualFtdi, intf: int) -> None:
        """Refused while the kernel driver or another program has it."""
        if dev_handle.kernel_driver or dev_handle.claimed:
            raise USBError("Resource busy", -6, EBUSY)
        dev_handle.claimed = True

    def release_interface(self, dev_handle: VirtualFtdi, intf: int) -> None:
        """Free again."""
        dev_handle.claimed = False

    def is_kernel_driver_active(self, dev_handle: VirtualFtdi, intf: int) -> bool:
        """Whether ftdi_sio has it."""
        return dev_handle.kernel_driver

    def detach_kernel_driver(self, dev_handle: VirtualFtdi, intf: int) -> None:
        """Take it from ftdi_sio."""
        dev_handle.kernel_driver = False

    def attach_kernel_driver(self, dev_handle: VirtualFtdi, intf: int) -> None:
        """Give it back."""
        dev_handle.kernel_driver = True

    def reset_device(self, dev_handle: VirtualFtdi) -> None:
        """Nothing that the serial side would notice."""

    def bulk_write(self, dev_handle: VirtualFtdi, ep: int, intf: int, data: Any, timeout: int) -> int:
        """Bytes for the line."""
        dev_handle.sent(bytes(data))
        return len(data)

    def bulk_read(self, dev_handle: VirtualFtdi, ep: int, intf: int, buff: Any, timeout: int) -> int:
        """One packet."""
        packet = dev_handle.packet()
        buff[: len(packet)] = array("B", packet)
        return len(packet)

    def ctrl_transfer(
        self,
        dev_handle: VirtualFtdi,
        bmRequestType: int,
        bRequest: int,
        wValue: int,
        wIndex: int,
        data: Any,
        timeout: int,
    ) -> int:
        """String descriptors and the chip's vendor requests."""
        if bmRequestType == 0x80 and bRequest == GET_DESCRIPTOR and wValue >> 8 == STRING_DESCRIPTOR:
            text = (
                dev_handle.strings.get(wValue & 0xFF, "").encode("utf-16-le")
                if wValue & 0xFF
                else b"\x09\x04"
            )
            answer = bytes([len(text) + 2, STRING_DESCRIPTOR]) + text
        elif bmRequestType & 0x60 == 0x40:
            answer = dev_handle.control(bRequest, wValue, wIndex)
        else:
            raise USBTimeoutError("no such request", -7, EIO)
        if not bmRequestType & 0x80:
            return len(data)
        count = min(len(answer), len(data))
        data[:count] = array("B", answer[:count])
        return count


_BACKEND = Backend()
_REAL = UsbTools.BACKENDS


def get_backend() -> Backend:
    """How pyftdi asks for the bus."""
    return _BACKEND


def plug(chip: VirtualFtdi) -> None:
    """Put a chip on the bus that pyftdi sees. Real chips are not seen until `unplug`."""
    _BACKEND.chips.append(chip)
    UsbTools.BACKENDS = (__name__,)
    UsbTools.flush_cache()


def unplug() -> None:
    """Take all chips off; pyftdi sees the real bus again."""
    UsbTools.release_all_devices()
    _BACKEND.chips.clear()
    UsbTools.BACKENDS = _REAL
    UsbTools.flush_cache()
