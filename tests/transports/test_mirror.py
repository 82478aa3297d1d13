"""pci:// against an emulated card that answers from another process through shared memory."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fake_sysfs import MESA_5I25, add_device

import hostmot2
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.mirror import Mirror

UNDRIVEN = 0xDEADBEEF


@pytest.fixture
def shared() -> Iterator[Path]:
    with tempfile.NamedTemporaryFile(dir="/dev/shm", prefix="hm2-test-") as file:
        yield Path(file.name)


@pytest.fixture
def served(shared: Path) -> Iterator[Path]:
    command = [sys.executable, "-m", "hostmot2.emulator.mirror", "5i25+7i77", str(shared)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == f"ready {shared}\n".encode()
        try:
            yield shared
            process.send_signal(signal.SIGTERM)
            assert process.wait(10) == 0
        finally:
            process.kill()


def until(condition: Callable[[], bool], seconds: float = 10.0) -> bool:
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.0005)
    return True


def test_a_card_in_another_process_is_opened_and_answers(served: Path) -> None:
    with hostmot2.open(f"pci://{served}") as board:
        assert (board.name, len(board.modules)) == ("5I25", 6)
        assert board.read(0x1000, 2) == [0x1FFFF, 0x1FFFF]
        board.write(0x1100, 0x1)
        assert until(lambda: board.read(0x1000) == 0x1FFFE)


def test_an_sserial_command_of_another_process_is_carried_out(served: Path) -> None:
    with hostmot2.open(f"pci://{served}") as board:
        command, data = 0x5A00, 0x5B00
        board.write(command, 0x4000)
        assert until(lambda: board.read(command) == 0x4000)
        board.write(command, 0x0001)
        assert until(lambda: board.read(command) == 0)
        for address, value in ((0, 0x12), (1, 0x08), (2, 0x01), (3, 0x2B)):
            board.write(command, 0x2000 | address)
            assert until(lambda: board.read(command) == 0)
            assert board.read(data) & 0xFF == value


def test_the_whole_way_through_sysfs(served: Path) -> None:
    sysfs = Path(tempfile.mkdtemp(prefix="hm2-sysfs-"))
    (sysfs / "bus/pci/devices").mkdir(parents=True)
    directory = add_device(sysfs, "0000:03:00.0", MESA_5I25)
    (directory / "resource0").unlink()
    (directory / "resource0").symlink_to(served)
    with hostmot2.open(f"pci://0000:03:00.0?sysfs={sysfs}") as board:
        board.write(0x1104, 0x3)
        assert until(lambda: board.read(0x1004) == 0x1FFFC)


def test_a_write_is_taken_once_and_the_cards_own_word_is_shown_after_it(shared: Path) -> None:
    card = EmulatedBoard("5i25+7i77", clock="virtual")
    mirror = Mirror(card, shared)
    with hostmot2.open(f"pci://{shared}") as driver:
        driver.write(0x1000, 0x1FFFE)  # the latch, not the pads
        mirror.look()
        assert driver.read(0x1000) == 0x1FFFF
        driver.write(0x1100, 0x1)
        mirror.look()
        assert driver.read(0x1000, 1) == 0x1FFFE
        card.write(0x1100, 0)
        mirror.look()
        assert driver.read(0x1100) == 0
    mirror.close()


def test_write_only_registers_show_that_nothing_drives_them_so_that_every_write_is_seen(shared: Path) -> None:
    card = EmulatedBoard("5i25+7i77", clock="virtual")
    mirror = Mirror(card, shared)
    with hostmot2.open(f"pci://{shared}") as driver:
        driver.write(0x0C00, 100)
        mirror.look()
        card.advance_clocks(50)
        assert driver.read(0x0E00) == UNDRIVEN
        for _ in range(3):  # the same word again and again
            driver.write(0x0E00, 0x5A000000)
            mirror.look()
            assert driver.read(0x0E00) == UNDRIVEN
            card.advance_clocks(80)
        assert card.read(0x0D00) == 0x1  # from power-up: it has not bitten since, but nobody cleared it
        assert card.read(0x0C00) < 100
    mirror.close()


def test_reading_a_register_with_a_side_effect_has_none(shared: Path) -> None:
    card = EmulatedBoard("7i76e", clock="virtual")
    mirror = Mirror(card, shared)
    with hostmot2.open(f"pci://{shared}") as driver:
        assert driver.read(0x7600) == UNDRIVEN
    mirror.close()
