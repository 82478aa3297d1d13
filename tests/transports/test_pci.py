"""pci:// on a fabricated sysfs tree with a plain file behind the BAR, and on files that cannot be used."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from fake_sysfs import MESA_5I25, MESA_6I25, NETWORK_CARD, SOMEBODYS_PLX, add_device, image

import hostmot2
from hostmot2 import boards, errors
from hostmot2.card_lock import command
from hostmot2.pci_cards import PCI_IDS, find_cards, udev_rules


@pytest.fixture
def sysfs() -> Iterator[Path]:
    """An empty tree that other users may look into."""
    root = Path(tempfile.mkdtemp(prefix="hm2-sysfs-"))
    root.chmod(0o755)
    (root / "bus/pci/devices").mkdir(parents=True)
    yield root
    shutil.rmtree(root)


@contextlib.contextmanager
def unprivileged() -> Iterator[None]:
    """File permissions count inside the block, even for root."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_cards_are_found_by_their_ids_and_nothing_else_is(sysfs: Path) -> None:
    add_device(sysfs, "0000:04:00.0", MESA_6I25)
    add_device(sysfs, "0000:03:00.0", MESA_5I25)
    add_device(sysfs, "0000:01:00.0", NETWORK_CARD)
    add_device(sysfs, "0000:02:00.0", SOMEBODYS_PLX)
    assert [(card.address, card.model, card.url) for card in find_cards(sysfs)] == [
        ("0000:03:00.0", "5I25", "pci://0000:03:00.0"),
        ("0000:04:00.0", "6I25", "pci://0000:04:00.0"),
    ]


def test_a_machine_without_pci_has_no_cards(sysfs: Path) -> None:
    shutil.rmtree(sysfs / "bus")
    assert find_cards(sysfs) == []


@pytest.mark.parametrize(
    ("ids", "model", "bar"),
    [
        ((0x10B5, 0x9030, 0x10B5, 0x3131), "5I20", 5),
        ((0x10B5, 0x9030, 0x10B5, 0x3132), "4I65", 5),
        ((0x10B5, 0x9054, 0x10B5, 0x3315), "5I23", 3),
        ((0x10B5, 0x9054, 0x10B5, 0x3133), "4I68", 3),
        ((0x10B5, 0x9056, 0x10B5, 0x3428), "3X20-1.5M", 3),
        (MESA_5I25, "5I25", 0),
        ((0x2718, 0x6124, 0x0000, 0x0000), "6I24", 0),
        ((0x2718, 0x6925, 0x2718, 0x6925), "6I25T", 0),
    ],
)
def test_the_register_bar_follows_from_the_bridge(
    sysfs: Path, ids: tuple[int, int, int, int], model: str, bar: int
) -> None:
    add_device(sysfs, "0000:03:00.0", ids, bar=bar)
    (card,) = find_cards(sysfs)
    assert (card.model, card.registers.name, card.bar_size()) == (model, f"resource{bar}", 0x10000)


def test_every_pci_board_is_in_the_board_table_but_the_one_the_sources_disagree_about() -> None:
    assert {row.model for row in PCI_IDS if boards.find(row.model) is None} == {"4I74"}


def test_the_first_card_is_opened_and_memory_decoding_switched_on_and_off(sysfs: Path) -> None:
    directory = add_device(sysfs, "0000:03:00.0", MESA_5I25)
    add_device(sysfs, "0000:04:00.0", MESA_6I25)
    with hostmot2.open(f"pci://?sysfs={sysfs}") as board:
        assert board.name == "5I25"
        assert (directory / "enable").read_text() == "1"
        assert (directory / "config").read_bytes()[4] == 0x02
        board.write(0x1000, 0x12345678)
    assert (directory / "enable").read_text() == "0"
    assert (directory / "resource0").read_bytes()[0x1000:0x1004] == bytes.fromhex("78563412")


def test_a_forked_child_leaves_its_parents_card_switched_on_and_locked(sysfs: Path) -> None:
    directory = add_device(sysfs, "0000:03:00.0", MESA_5I25)
    with hostmot2.open(f"pci://?sysfs={sysfs}") as board:
        child = os.fork()
        if child == 0:
            board.close()
            os._exit(0)
        assert os.waitpid(child, 0)[1] == 0
        assert (directory / "enable").read_text() == "1"
        assert board.read(0x100) == 0x55AACAFE
        with pytest.raises(errors.CardBusy):
            hostmot2.open(f"pci://?sysfs={sysfs}")
    assert (directory / "enable").read_text() == "0"


def test_other_bits_of_the_command_register_stay(sysfs: Path) -> None:
    directory = add_device(sysfs, "0000:03:00.0", MESA_5I25, command=0x0505)
    with hostmot2.open(f"pci://?sysfs={sysfs}"):
        assert (directory / "config").read_bytes()[4:6] == bytes.fromhex("0705")


@pytest.mark.parametrize("address", ["0000:04:00.0", "04:00.0"])
def test_a_card_is_opened_by_address(sysfs: Path, address: str) -> None:
    add_device(sysfs, "0000:03:00.0", MESA_5I25)
    add_device(sysfs, "0000:04:00.0", MESA_6I25, content=image("6I25"))
    with hostmot2.open(f"pci://{address}?sysfs={sysfs}") as board:
        assert (board.name, board.idrom.board_name) == ("6I25", "MESA6I25")


def test_a_card_that_is_not_there_says_what_is(sysfs: Path) -> None:
    with pytest.raises(errors.CardNotFound, match="none at all"):
        hostmot2.open(f"pci://?sysfs={sysfs}")
    add_device(sysfs, "0000:03:00.0", MESA_5I25)
    with pytest.raises(errors.CardNotFound, match=r"0000:03:00\.0 \(5I25\)"):
        hostmot2.open(f"pci://0000:09:00.0?sysfs={sysfs}")


def test_a_card_that_lost_its_bar_says_so(sysfs: Path) -> None:
    directory = add_device(sysfs, "0000:03:00.0", MESA_5I25, size=0)
    (directory / "resource0").write_bytes(b"")
    with pytest.raises(errors.MappingTooSmall, match="lost its BARs") as caught:
        hostmot2.open(f"pci://?sysfs={sysfs}")
    assert (caught.value.expected, caught.value.received) == (0x10000, 0)
    assert (directory / "enable").read_text() == "0"


def test_a_card_without_power_or_decoding_fails_with_the_cookie_all_ones(sysfs: Path) -> None:
    add_device(sysfs, "0000:03:00.0", MESA_5I25, content=b"\xff" * 0x10000)
    with pytest.raises(errors.WrongCookie) as caught:
        hostmot2.open(f"pci://?sysfs={sysfs}")
    assert caught.value.received == 0xFFFFFFFF
    with pytest.raises(errors.WrongCookie):  # and has let the lock go
        hostmot2.open(f"pci://?sysfs={sysfs}")


def test_a_user_without_rights_is_told_about_the_udev_rule(sysfs: Path) -> None:
    directory = add_device(sysfs, "0000:03:00.0", MESA_5I25)
    (directory / "resource0").chmod(0o600)
    with unprivileged(), pytest.raises(errors.PermissionDenied, match="hm2 setup udev") as caught:
        hostmot2.open(f"pci://?sysfs={sysfs}")
    assert type(caught.value) is errors.PermissionDenied
    assert "resource0" in str(caught.value)


def test_a_user_with_the_bar_but_not_the_enable_file_needs_decoding_switched_on_already(sysfs: Path) -> None:
    directory = add_device(sysfs, "0000:03:00.0", MESA_5I25)
    (directory / "resource0").chmod(0o666)
    (directory / "enable").chmod(0o644)
    (directory / "config").chmod(0o644)
    with unprivileged(), pytest.raises(errors.PermissionDenied, match="enable"):
        hostmot2.open(f"pci://?sysfs={sysfs}")
    config = bytearray((directory / "config").read_bytes())
    config[4] = 0x02
    (directory / "config").write_bytes(config)
    with unprivileged(), hostmot2.open(f"pci://?sysfs={sysfs}") as board:
        assert board.name == "5I25"


def test_a_user_who_may_count_the_card_in_but_not_set_its_command_register_is_told(sysfs: Path) -> None:
    directory = add_device(sysfs, "0000:03:00.0", MESA_5I25)
    (directory / "resource0").chmod(0o666)
    (directory / "enable").chmod(0o666)
    (directory / "config").chmod(0o644)
    with unprivileged(), pytest.raises(errors.PermissionDenied, match="config: memory decoding is off"):
        hostmot2.open(f"pci://?sysfs={sysfs}")
    with (directory / "resource0").open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # nobody has it any more


def test_a_card_that_cannot_be_switched_on_says_why(sysfs: Path) -> None:
    directory = add_device(sysfs, "0000:03:00.0", MESA_5I25)
    (directory / "enable").unlink()
    (directory / "enable").mkdir()
    with pytest.raises(errors.TransportError, match=r"enable: Is a directory") as caught:
        hostmot2.open(f"pci://?sysfs={sysfs}")
    assert caught.value.os_errno == errno.EISDIR


def test_udev_rules_cover_every_board_and_switch_decoding_on() -> None:
    rules = udev_rules("machine")
    assert rules.count('SUBSYSTEM=="pci"') == len(PCI_IDS)
    (line,) = [line for line in rules.splitlines() if '"0x5125"' in line]
    for part in (
        'ATTR{vendor}=="0x2718"',
        "echo 1 > /sys%p/enable",
        "chgrp machine /sys%p/resource0",
        "chmod g+rw",
    ):
        assert part in line
    (line,) = [line for line in rules.splitlines() if '"0x3131"' in line]
    assert 'ATTR{device}=="0x9030"' in line
    assert "/sys%p/resource5" in line
    assert all(line.startswith(("#", "ACTION")) for line in rules.splitlines())


def test_a_second_open_names_the_process_that_drives_the_card(sysfs: Path) -> None:
    add_device(sysfs, "0000:03:00.0", MESA_5I25)
    script = (
        "import sys, hostmot2\n"
        f"with hostmot2.open('pci://?sysfs={sysfs}'):\n"
        "    print('ready', flush=True)\n"
        "    sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as driver:
        assert driver.stdin is not None
        assert driver.stdout is not None
        assert driver.stdout.readline() == b"ready\n"
        with pytest.raises(errors.CardBusy, match=rf"5I25 at 0000:03:00\.0 .*pid {driver.pid} \(") as caught:
            hostmot2.open(f"pci://?sysfs={sysfs}")
        assert caught.value.received == driver.pid
        driver.stdin.close()
        assert driver.wait() == 0
    hostmot2.open(f"pci://?sysfs={sysfs}").close()


def test_a_killed_process_leaves_no_lock(sysfs: Path) -> None:
    add_device(sysfs, "0000:03:00.0", MESA_5I25)
    script = f"import hostmot2, os; b = hostmot2.open('pci://?sysfs={sysfs}'); os.kill(os.getpid(), 9)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == -9
    hostmot2.open(f"pci://?sysfs={sysfs}").close()


def test_a_file_that_is_not_there_is_not_found() -> None:
    with pytest.raises(errors.CardNotFound, match="/nowhere/card"):
        hostmot2.open("pci:///nowhere/card")


def test_a_file_of_another_user_is_a_permission_error_and_not_lockdown(sysfs: Path) -> None:
    path = sysfs / "card.bin"
    path.write_bytes(image())
    path.chmod(0o600)
    with unprivileged(), pytest.raises(errors.PermissionDenied) as caught:
        hostmot2.open(f"pci://{path}")
    assert type(caught.value) is errors.PermissionDenied


def test_a_file_smaller_than_the_register_file_says_how_small(sysfs: Path) -> None:
    path = sysfs / "card.bin"
    path.write_bytes(image()[:-4])
    with pytest.raises(errors.MappingTooSmall, match="65532") as caught:
        hostmot2.open(f"pci://{path}")
    assert (caught.value.expected, caught.value.received) == (0x10000, 0xFFFC)


def test_a_file_the_kernel_will_not_map_is_lockdown_with_what_to_do() -> None:
    """A write-sealed memory file refuses mmap as a locked-down kernel does: open succeeds, then EPERM."""
    descriptor = os.memfd_create("card", os.MFD_ALLOW_SEALING)
    try:
        os.write(descriptor, image())
        fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, fcntl.F_SEAL_WRITE)
        with pytest.raises(errors.KernelLockdown, match="Secure Boot") as caught:
            hostmot2.open(f"pci:///proc/self/fd/{descriptor}")
        assert caught.value.os_errno == 1
    finally:
        os.close(descriptor)


@pytest.mark.parametrize("locks", [None, "", "1: POSIX  ADVISORY  WRITE 1 00:01:2 0 EOF\n"])
def test_a_card_is_busy_even_where_the_kernel_does_not_tell_whose_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, locks: str | None
) -> None:
    card = tmp_path / "card"
    card.write_bytes(image())
    monkeypatch.setattr("hostmot2.card_lock.LOCKS", tmp_path / "locks")
    if locks is not None:
        (tmp_path / "locks").write_text(locks)
    with card.open("r+b") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(errors.CardBusy, match="is driven by another process") as caught:
            hostmot2.open(f"pci://{card}")
    assert caught.value.received is None
    hostmot2.open(f"pci://{card}").close()


def test_a_driver_that_is_gone_meanwhile_has_no_name() -> None:
    assert command(os.getpid()) != "?"
    assert command(0) == "?"


def test_a_device_without_ids_is_no_card(sysfs: Path) -> None:
    add_device(sysfs, "0000:03:00.0", MESA_5I25)
    (add_device(sysfs, "0000:04:00.0", MESA_5I25) / "vendor").write_text("gone")
    assert [card.address for card in find_cards(sysfs)] == ["0000:03:00.0"]


def test_a_card_whose_file_cannot_be_locked_is_not_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    card = tmp_path / "card"
    card.write_bytes(image())

    def refuse(*_arguments: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    before = len(os.listdir("/proc/self/fd"))
    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.raises(OSError, match="No locks available"):
        hostmot2.open(f"pci://{card}")
    assert len(os.listdir("/proc/self/fd")) <= before, "nothing is left open"
