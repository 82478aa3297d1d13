"""hm2 setup: files that validators accept, installed whole or not at all, never over somebody else's."""

from __future__ import annotations

import configparser
import json
import os
import re
import shutil
import subprocess
from functools import partial
from pathlib import Path

import pytest

from hostmot2.pci_cards import PCI_IDS
from hostmot2.setup import ForeignFile, MachineFile, install, net_files, realtime_files, udev_files
from hostmot2.setup.files import SAVED, is_ours

MAC = "00:11:22:33:44:55"
PARTS = {
    "udev": lambda: udev_files("hostmot2"),
    "rt": lambda: realtime_files("hostmot2", cpu="3"),
    "net": lambda: net_files("enp2s0", MAC),
}


def made(part: str) -> list[MachineFile]:
    return PARTS[part]()[0]


def unit_file(text: str) -> configparser.ConfigParser:
    parser = configparser.ConfigParser(
        strict=True, interpolation=None, delimiters=("=",), comment_prefixes=("#",)
    )
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read_string(text)
    return parser


@pytest.mark.parametrize("part", PARTS)
def test_every_line_that_does_something_is_explained(part: str) -> None:
    """A comment in the few lines above each."""
    for file in made(part):
        lines = file.content.splitlines()
        for number, line in enumerate(lines):
            if line and not line.startswith(("#", "[")):
                above = lines[max(0, number - 6) : number]
                assert any(each.startswith("#") for each in above), line


def test_the_udev_rule_names_every_card_and_the_latency_file(tmp_path: Path) -> None:
    (file,) = made("udev")
    for card in PCI_IDS:
        assert f'ATTR{{device}}=="0x{card.device:04x}"' in file.body
    assert re.search(r'KERNEL=="cpu_dma_latency".*GROUP="hostmot2"', file.body)
    rules = [line for line in file.body.splitlines() if line and not line.startswith("#")]
    token = r'[A-Z]+(\{\w+\})?(==|=|\+=)"[^"]*"'
    assert all(re.fullmatch(rf"{token}(, {token})*", line) for line in rules)
    path = tmp_path / "70-hostmot2.rules"
    path.write_text(file.content)
    if shutil.which("udevadm"):
        done = subprocess.run(["udevadm", "verify", str(path)], capture_output=True, text=True, check=False)
        if "Unknown" not in done.stderr and "unrecognized" not in done.stderr:  # older than systemd 254
            assert done.returncode == 0, done.stdout + done.stderr


def test_the_unit_is_one_that_systemd_takes(tmp_path: Path) -> None:
    _, file = made("rt")
    unit = unit_file(file.content)
    assert unit["Service"]["LimitRTPRIO"] == "80"
    assert unit["Service"]["CPUAffinity"] == "3"
    assert unit["Service"]["Restart"] == "no", "outputs stay off until somebody has looked"
    assert "CPUAffinity" not in unit_file(realtime_files("hostmot2")[0][1].content)["Service"]
    if not shutil.which("systemd-analyze"):
        pytest.skip("LEFT OUT: no systemd-analyze to ask")
    path = tmp_path / "hostmot2@demo.service"
    path.write_text(file.content)
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(path)], capture_output=True, text=True, check=False
    )
    ours = [line for line in done.stderr.splitlines() if "hostmot2" in line]
    assert not ours, done.stderr


def test_limits_are_lines_of_limits_d() -> None:
    lines = [line.split() for line in made("rt")[0].content.splitlines() if not line.startswith("#")]
    assert lines == [["@hostmot2", "-", "rtprio", "80"], ["@hostmot2", "-", "memlock", "unlimited"]]


def test_link_and_network_are_for_one_interface() -> None:
    link, network = (unit_file(file.content) for file in made("net"))
    assert link["Match"]["MACAddress"] == MAC
    assert (link["Link"]["RxCoalesceSec"], link["Link"]["UseAdaptiveRxCoalesce"]) == ("0", "no")
    assert link["Link"]["NamePolicy"], "or the interface loses its name"
    assert network["Match"]["Name"] == "enp2s0"
    assert network["Network"]["Address"] == "10.10.10.11/24"
    assert network["Network"]["LinkLocalAddressing"] == "no"


@pytest.mark.parametrize(
    ("name", "mac", "address"),
    [
        ("a b", MAC, "10.10.10.11/24"),
        ("enp2s0", "banana", "10.10.10.11/24"),
        ("enp2s0", MAC, "10.10.10.0/24"),
        ("enp2s0", MAC, "10.10.10.11"),
        ("enp2s0", MAC, "10.10.10.300/24"),
    ],
)
def test_names_and_addresses_that_cannot_be_are_refused(name: str, mac: str, address: str) -> None:
    with pytest.raises(ValueError, match=r"is no|does not appear|Octet|octet|Expected|not permitted"):
        net_files(name, mac, address)


@pytest.mark.parametrize(
    "options",
    [
        ("udev", "--group", 'x", MODE="0666'),
        ("udev", "--group", "a\nb"),
        ("udev", "--group", ""),
        ("rt", "--group", "two words"),
        ("rt", "--user", "me\nExecStartPre=/bin/true"),
        ("rt", "--user", "-x"),
        ("rt", "--cpu", "3\nUser=root"),
        ("rt", "--cpu", "all"),
        ("rt", "--directory", "opt/hostmot2"),
        ("rt", "--directory", "/opt/my programs"),
    ],
)
def test_what_would_break_a_file_of_the_system_is_refused(
    hm2, tmp_path: Path, options: tuple[str, ...]
) -> None:
    """As `net` refuses it: the rule or unit would be another one, or none."""
    status, out, err = hm2(*options, "--write", "--root", tmp_path)
    assert (status, out) == (2, "")
    assert options[2].split("\n")[0] in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("cpu", ["3", "2-3", "0,2-3", "1 3"])
def test_processors_are_lists_as_systemd_takes_them(cpu: str) -> None:
    assert any(f"CPUAffinity={cpu}\n" in file.body for file in realtime_files("hostmot2", cpu=cpu)[0])


def test_a_link_beside_what_is_installed_is_not_followed(tmp_path: Path) -> None:
    victim, (file,) = tmp_path / "victim", made("udev")
    victim.write_text("precious")
    place = tmp_path / str(file.path).lstrip("/")
    place.parent.mkdir(parents=True)
    place.with_name(f".{place.name}.new").symlink_to(victim)
    assert install([file], root=tmp_path) == [place]
    assert (victim.read_text(), place.read_text()) == ("precious", file.content)


@pytest.mark.parametrize("part", PARTS)
def test_installing_twice_changes_nothing(part: str, tmp_path: Path) -> None:
    places = install(made(part), root=tmp_path)
    before = [place.read_text() for place in places]
    assert install(made(part), root=tmp_path) == places
    assert [place.read_text() for place in places] == before
    assert all(is_ours(text) for text in before)
    assert all(place.stat().st_mode & 0o777 == 0o644 for place in places)
    assert sorted(p for p in tmp_path.rglob("*") if p.is_file()) == sorted(places)


@pytest.mark.parametrize("theirs", ["# somebody's\n", "edited", ""])
def test_somebody_elses_file_is_left_alone_and_nothing_is_written(tmp_path: Path, theirs: str) -> None:
    """The second of two is foreign: the first is not written either. An edited one is foreign, too."""
    limits, unit = (tmp_path / str(file.path).lstrip("/") for file in made("rt"))
    unit.parent.mkdir(parents=True)
    unit.write_text(made("rt")[1].content + "Nice=5\n" if theirs == "edited" else theirs)
    before = unit.read_text()
    with pytest.raises(ForeignFile, match="left alone"):
        install(made("rt"), root=tmp_path)
    assert unit.read_text() == before
    assert not limits.exists()
    install(made("rt"), root=tmp_path, force=True)
    assert is_ours(unit.read_text())
    assert unit.with_name(unit.name + SAVED).read_text() == before


@pytest.fixture
def hm2(hm2):
    return partial(hm2, "setup")


@pytest.mark.parametrize("arguments", [("udev",), ("rt",), ("net", "enp2s0", "--mac", MAC)], ids=" ".join)
def test_at_the_prompt_files_are_printed_and_written_only_when_told(
    hm2, arguments: tuple[str, ...], tmp_path: Path
) -> None:
    root = ("--root", str(tmp_path))
    status, out, err = hm2(*arguments, *root)
    assert status == 0
    assert "### /etc/" in out
    assert "nothing was written" in err
    assert not list(tmp_path.iterdir())
    document = json.loads(hm2(*arguments, *root, "--json")[1])
    assert all(file["content"].rstrip() in out for file in document["files"])
    status, out, err = hm2(*arguments, *root, "--write")
    assert status == 0
    assert out.count("wrote ") == len(document["files"])
    for file in document["files"]:
        place = tmp_path / file["file"].lstrip("/")
        assert place.read_text() == file["content"]
        place.write_text("mine")
    assert hm2(*arguments, *root, "--write")[0] == 2
    assert hm2(*arguments, *root, "--write", "--force")[0] == 0


def test_an_interface_that_is_not_here_needs_its_mac(hm2) -> None:
    status, _, err = hm2("net", "enp2s0nix")
    assert status == 2
    assert "--mac" in err


def test_without_the_right_to_write_it_is_a_matter_of_permission(hm2, tmp_path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("LEFT OUT: root may write everywhere")
    tmp_path.chmod(0o500)
    assert hm2("udev", "--root", str(tmp_path), "--write")[0] == 4
