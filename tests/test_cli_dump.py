"""hm2 dump, diff and setup udev, and what a shell sees of cards that cannot be opened."""

import json
import os
from pathlib import Path

from fake_sysfs import MESA_5I25, add_device

from hostmot2.card_lock import lock_file

EMULATED = ("--board", "emu://7i76e?clock=virtual")


def test_dump_writes_a_file_that_opens_as_a_board(hm2, tmp_path: Path) -> None:
    file = tmp_path / "board.hm2dump"
    status, out, _ = hm2(*EMULATED, "dump", "-o", str(file))
    assert status == 0
    assert str(file) in out
    assert file.read_text().startswith("# hm2dump 1\n# board: MESA7I76\n")
    info = json.loads(hm2("--board", f"dump://{file}", "--json", "info")[1])
    assert info["idrom"]["board_name"] == "MESA7I76"
    assert hm2("--board", f"dump://{file}", "poke", "0x1000", "1", "--yes")[0] == 2


def test_dump_without_a_file_prints(hm2) -> None:
    status, out, _ = hm2(*EMULATED, "dump")
    assert status == 0
    assert "0100 55AACAFE  id cookie" in out.splitlines()
    assert any(line.startswith("7600 --------") for line in out.splitlines())
    document = json.loads(hm2(*EMULATED, "dump", "--json")[1])
    assert document["words"]["0x0100"] == 0x55AACAFE
    assert "0x7600" in document["omitted"]
    assert "0x7600" in json.loads(hm2(*EMULATED, "dump", "--side-effects", "--json")[1])["words"]


def test_diff_names_the_registers_that_differ(hm2, tmp_path: Path) -> None:
    left, right = tmp_path / "a.hm2dump", tmp_path / "b.hm2dump"
    hm2(*EMULATED, "dump", "-o", str(left))
    right.write_text(left.read_text().replace("1100 00000000", "1100 00000003"))
    status, out, _ = hm2("diff", str(left), str(right))
    assert status == 0
    (line,) = [line for line in out.splitlines() if line.startswith("0x")]
    assert line.split() == ["0x1100", "0x00000000", "0x00000003", "ioport", "0", "ddr"]
    (difference,) = json.loads(hm2("--json", "diff", str(left), str(right))[1])
    assert difference == {"address": 0x1100, "name": "ioport 0 ddr", "left": 0, "right": 3}
    assert hm2("diff", str(left), str(left))[1] == "no difference\n"
    assert "0x1100" in hm2("diff", str(right), "emu://7i76e?clock=virtual")[1]


def test_setup_udev_prints_rules_on_stdout_and_what_to_do_on_stderr(hm2) -> None:
    status, out, err = hm2("setup", "udev", "--group", "machine")
    assert status == 0
    assert all(line.startswith(("#", "ACTION==", "KERNEL==")) for line in out.splitlines())
    assert "chgrp machine /sys%p/resource0" in out
    assert "udevadm" in err


def test_exit_codes_of_cards_that_cannot_be_opened(hm2, tmp_path: Path) -> None:
    (tmp_path / "bus/pci/devices").mkdir(parents=True)
    url = f"pci://?sysfs={tmp_path}"
    assert hm2("--board", url, "info")[0] == 3
    directory = add_device(tmp_path, "0000:03:00.0", MESA_5I25)
    assert hm2("--board", url, "info")[0] == 0
    lock = lock_file(str(directory / "resource0"), "the card")
    status, _, err = hm2("--board", url, "info")
    assert status == 7
    assert "pid" in err
    os.close(lock)


def test_what_to_do_is_said_once(hm2, tmp_path: Path) -> None:
    (tmp_path / "small").write_bytes(b"x")
    status, _, err = hm2("--board", f"pci://{tmp_path}/small", "info")
    assert status == 5
    assert err.count("Name the BAR") == 1
