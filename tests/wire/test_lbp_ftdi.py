"""The pyftdi and pyusb path, on a virtual FTDI chip behind pyusb's backend interface."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from functools import partial

import pytest
import usb.core
from usb.core import USBError

from hostmot2 import lbp
from hostmot2.emulator.ftdi import Backend, VirtualFtdi, baud_of_divisor, get_backend, plug, unplug
from hostmot2.errors import PermissionDenied
from hostmot2.lbp.adapters import adapters
from hostmot2.lbp.ftdi import FtdiStream
from wire.lines import emulated


@pytest.fixture
def chip() -> Iterator[VirtualFtdi]:
    chip = VirtualFtdi(emulated("8i20"))
    plug(chip)
    yield chip
    unplug()


def test_the_drive_is_read_and_written_without_a_kernel_driver(chip: VirtualFtdi) -> None:
    with lbp.open("ftdi:///1") as remote:
        values = lbp.parameters(remote)
        values["NVMAXCURRENT"] = 2500
        assert values["NVMAXCURRENT"] == 2500
        assert not chip.kernel_driver
        assert chip.latency_ms == 1
        assert chip.data_format == 0x0008  # 8N1
        assert abs(chip.baud - 115200) < 0.01 * 115200
    assert chip.kernel_driver  # given back


def test_divisor_26_is_115200_baud() -> None:
    """lbp_serial.md 8."""
    assert baud_of_divisor(26, 0) == 115385
    assert baud_of_divisor(0, 0) == 3_000_000
    assert baud_of_divisor(0x8000 | 26, 0) == round(3_000_000 / 26.25)


def test_a_chip_at_another_rate_is_not_heard(chip: VirtualFtdi) -> None:
    with pytest.raises(lbp.LineSilent):
        lbp.open("ftdi:///1", 57600)
    with pytest.raises(ValueError, match="2500000"):
        lbp.open("ftdi:///1", 2_500_000)


def test_the_chip_is_listed_with_its_serial_number(chip: VirtualFtdi) -> None:
    (found,) = [adapter for adapter in adapters() if adapter.driver == "usb"]
    assert found.port == "ftdi://0x0403:0x6001:HM2EMU/1"
    assert found.likely
    with lbp.open(found.port) as remote:
        assert remote.name == "8I20"


def test_a_pulled_adapter_is_an_error_and_no_value(chip: VirtualFtdi) -> None:
    remote = lbp.open("ftdi:///1")
    chip.error = 19
    with pytest.raises(lbp.LineSilent, match="pulled"):
        remote.read_remote(0x828, 2)
    chip.error = None
    assert remote.read_remote(0x828, 2) == 32000
    remote.close()


@pytest.mark.parametrize("call", ["bulk_write", "bulk_read"])
def test_what_fails_on_the_way_there_or_back_is_an_error(
    chip: VirtualFtdi, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    def fail(*_arguments: object) -> None:
        raise USBError(call, -1, errno.EIO)

    remote = lbp.open("ftdi:///1")
    stream = remote.link.stream
    attempt = partial(stream.send, b"\x00") if call == "bulk_write" else stream.flush
    with monkeypatch.context() as broken:
        broken.setattr(Backend, call, fail)
        with pytest.raises(lbp.LineSilent, match=call):
            attempt()
    remote.close()


def test_no_chip_is_an_error_that_says_so() -> None:
    with pytest.raises(lbp.AdapterMissing):
        lbp.open("ftdi:///1")


def test_a_chip_of_another_program_is_busy(chip: VirtualFtdi) -> None:
    chip.kernel_driver, chip.claimed = False, True
    with pytest.raises(lbp.AdapterBusy):
        lbp.open("ftdi:///1")


@pytest.mark.parametrize("call", ["open_device", "claim_interface"])
def test_a_chip_this_user_may_not_use_says_so(
    chip: VirtualFtdi, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    def refuse(*_arguments: object) -> None:
        raise USBError("Access denied (insufficient permissions)", -3, errno.EACCES)

    monkeypatch.setattr(Backend, call, refuse)
    with pytest.raises(PermissionDenied, match=r"^HM2-E012: ftdi:///1: ") as caught:
        lbp.open("ftdi:///1")
    assert caught.value.os_errno == errno.EACCES


def test_chips_that_cannot_be_listed_are_left_out(chip: VirtualFtdi, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object) -> None:
        raise USBError("no bus", -1, errno.EIO)

    monkeypatch.setattr(Backend, "enumerate_devices", refuse)
    assert [adapter for adapter in adapters() if adapter.driver == "usb"] == []


def test_what_came_unasked_is_thrown_away_and_counted(chip: VirtualFtdi) -> None:
    stream = FtdiStream("ftdi:///1")
    assert str(stream) == "ftdi:///1"
    stream.send(bytes.fromhex("DF 16"))
    assert stream.receive(1, 1.0) == b"\x5a"
    stream.send(bytes.fromhex("DF 16"))
    assert stream.flush() == 3
    assert stream.receive(1, 0.0) == b""
    stream.close()


def test_pyusb_sees_a_chip_as_the_real_one(chip: VirtualFtdi) -> None:
    (device,) = usb.core.find(find_all=True, backend=get_backend())
    assert [len(list(interface)) for configuration in device for interface in configuration] == [2]
    with pytest.raises(IndexError):
        device[1]
    with pytest.raises(USBError, match="no such request"):
        device.ctrl_transfer(0xA0, 0x21, 0, 0, 7)
    stream = FtdiStream("ftdi:///1")
    assert stream._chip.get_latency_timer() == chip.latency_ms == 1
    stream.close()
