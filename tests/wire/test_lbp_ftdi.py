"""The pyftdi and pyusb path, on a virtual FTDI chip behind pyusb's backend interface."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from hostmot2 import lbp
from hostmot2.emulator.ftdi import VirtualFtdi, baud_of_divisor, plug, unplug
from hostmot2.lbp.adapters import adapters
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


def test_no_chip_is_an_error_that_says_so() -> None:
    with pytest.raises(lbp.AdapterMissing):
        lbp.open("ftdi:///1")


def test_a_chip_of_another_program_is_busy(chip: VirtualFtdi) -> None:
    chip.kernel_driver, chip.claimed = False, True
    with pytest.raises(lbp.AdapterBusy):
        lbp.open("ftdi:///1")
