"""What the doctor says of a machine, told by files that were made up: /proc, /sys, /dev and /etc."""

from __future__ import annotations

from pathlib import Path

import pytest
from fake_sysfs import MESA_6I25, add_device

from doctor.trees import FakeLinks, machine
from hostmot2.doctor import Finding, Verdict
from hostmot2.doctor.examination import Target, look, target_of
from hostmot2.doctor.links import Coalescing, Link
from hostmot2.doctor.machine import cpu_list

CARD = Target("enp2s0", "10.10.10.10")


def findings(
    root: Path, changes: dict[str, str | None] | None = None, links: FakeLinks | None = None, **more
):
    network = links or FakeLinks()
    return {f.name: f for f in look(CARD, machine(root, changes, **more), lambda: network)}


def test_nothing_is_to_be_changed_on_a_good_machine(tmp_path: Path) -> None:
    found = findings(tmp_path)
    assert {f.verdict for f in found.values()} == {Verdict.GOOD}, [f for f in found.values() if f.advice]
    assert len(found) >= 14


CASES: list[tuple[str, dict[str, str | None], str, str]] = [
    (
        "kernel",
        {"/proc/version": "Linux 6.1 #1 SMP PREEMPT_DYNAMIC", "/sys/kernel/realtime": None},
        "DYNAMIC",
        "RT",
    ),
    ("isolated processors", {"/sys/devices/system/cpu/isolated": ""}, "none of 4", "isolcpus=3"),
    (
        "frequency governor",
        {"/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor": "powersave"},
        "powersave",
        "up",
    ),
    (
        "idle states",
        {
            "/sys/devices/system/cpu/cpu0/cpuidle/state3/name": "C6",
            "/sys/devices/system/cpu/cpu0/cpuidle/state3/latency": "133",
            "/sys/devices/system/cpu/cpu0/cpuidle/state3/disable": "0",
        },
        "C6 133 us",
        "/dev/cpu_dma_latency",
    ),
    (
        "clock source",
        {"/sys/devices/system/clocksource/clocksource0/current_clocksource": "hpet"},
        "hpet",
        "TSC",
    ),
    ("virtual machine", {"/proc/cpuinfo": "flags : fpu hypervisor tsc"}, "hypervisor", "machine itself"),
    ("enp2s0 interrupts", {"/proc/irq/40/smp_affinity_list": "0-2"}, "0, 1, 2, 3", "40, 41"),
    ("enp2s0 interrupts", {"/proc/102/comm": "irqbalance"}, "irqbalance runs", "stop it"),
    (
        "enp2s0 hardware",
        {
            "/sys/class/net/enp2s0/device/vendor": "0x10ec",
            "/sys/class/net/enp2s0/device/driver": "-> ../x/r8169",
        },
        "Realtek, driver r8169",
        "r8168",
    ),
    (
        "enp2s0 hardware",
        {"/sys/class/net/enp2s0/device/subsystem": "-> ../../bus/usb"},
        "Intel",
        "USB adapter",
    ),
    ("enp2s0 hardware", {"/sys/class/net/enp2s0/wireless/x": "1"}, "Wi-Fi", "wired"),
]


@pytest.mark.parametrize(("name", "changes", "seen", "advice"), CASES, ids=lambda value: str(value)[:30])
def test_one_thing_wrong_is_one_advice(
    tmp_path: Path, name: str, changes: dict[str, str | None], seen: str, advice: str
) -> None:
    found = findings(tmp_path, changes)
    wrong = [f for f in found.values() if f.verdict is not Verdict.GOOD]
    assert [f.name for f in wrong] == [name]
    assert seen in wrong[0].seen
    assert advice in wrong[0].advice


def test_limits_of_an_ordinary_user(tmp_path: Path) -> None:
    limits = {"rtprio": 0, "memlock": 8 << 20}
    found = findings(tmp_path, {"/dev/cpu_dma_latency": ""}, uid=1000, limits=limits)
    assert found["real-time priority"].verdict is Verdict.IMPROVE
    assert "hm2 setup rt" in found["real-time priority"].advice
    assert found["locked memory"].seen == "up to 8 MiB"


@pytest.mark.parametrize(
    ("coalesce", "trial"),
    [
        (Coalescing(57, 0, False, False), "rx-usecs=0"),
        (Coalescing(0, 0, True, True), "adaptive-rx=off"),
        (Coalescing(0, 0, False, False), ""),
        (None, ""),
    ],
)
def test_held_back_interrupts_are_told_with_a_trial(
    tmp_path: Path, coalesce: Coalescing | None, trial: str
) -> None:
    found = findings(tmp_path, links=FakeLinks(coalesce=coalesce))["enp2s0 interrupt coalescing"]
    assert found.trial == trial
    assert (found.verdict is Verdict.IMPROVE) == bool(trial)


def test_a_line_that_sleeps_and_a_host_that_is_elsewhere(tmp_path: Path) -> None:
    found = findings(tmp_path, links=FakeLinks(sleeping=True, direct=False))
    assert found["enp2s0 energy-efficient Ethernet"].trial == "eee=off"
    assert found["route to the card"].verdict is Verdict.BLOCKS
    assert "10.10.10.11/24" in found["route to the card"].advice


def test_a_link_without_a_cable_blocks(tmp_path: Path) -> None:
    link = Link("enp2s0", 2, True, False, "", "", ())
    found = findings(tmp_path, links=FakeLinks(link=link))["enp2s0 link"]
    assert found.verdict is Verdict.BLOCKS
    assert "no carrier" in found.seen


def test_advice_comes_in_the_order_in_which_it_helps(tmp_path: Path) -> None:
    """users.md 3.4: the network card and its driver, PREEMPT_RT, isolated processors, then power saving."""
    changes: dict[str, str | None] = {
        "/proc/version": "Linux PREEMPT_DYNAMIC",
        "/sys/kernel/realtime": None,
        "/sys/devices/system/cpu/isolated": "",
        "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "powersave",
        "/sys/class/net/enp2s0/device/driver": "-> ../x/r8169",
    }
    found = findings(tmp_path, changes, FakeLinks(coalesce=Coalescing(57, 0, False, False)))
    order = [f.name for f in found.values() if f.verdict is not Verdict.GOOD]
    wanted = [
        "enp2s0 hardware",
        "enp2s0 interrupt coalescing",
        "kernel",
        "isolated processors",
        "frequency governor",
    ]
    assert order == wanted


def pci(root: Path, **options: object) -> Finding:
    (root / "sys/bus/pci/devices").mkdir(parents=True)
    card = add_device(root / "sys", "0000:03:00.0", MESA_6I25)
    (card / "resource0").chmod(0o660)
    return findings(root, **options)["6I25 at 0000:03:00.0"]  # type: ignore[arg-type]


def test_a_pci_card_that_the_user_may_use(tmp_path: Path) -> None:
    assert pci(tmp_path).verdict is Verdict.GOOD


def test_a_pci_card_of_somebody_else(tmp_path: Path) -> None:
    found = pci(tmp_path, uid=12345)
    assert found.verdict is Verdict.BLOCKS
    assert "mode 660" in found.seen
    assert "hm2 setup udev" in found.advice


def test_a_group_that_was_joined_after_the_login(tmp_path: Path) -> None:
    import grp
    import os

    group = grp.getgrgid(os.getegid()).gr_name
    found = pci(tmp_path, uid=12345, changes={"/etc/group": f"{group}:x:0:anna,otto\n"})
    assert found.advice == f"anna is in {group} since the last login: log in anew."


def test_lockdown_blocks_pci_cards_and_nobody_else(tmp_path: Path) -> None:
    locked: dict[str, str | None] = {"/sys/kernel/security/lockdown": "none [integrity] confidentiality"}
    assert findings(tmp_path / "without", locked)["kernel lockdown"].verdict is Verdict.GOOD
    root = tmp_path / "with"
    (root / "sys/bus/pci/devices").mkdir(parents=True)
    add_device(root / "sys", "0000:03:00.0", MESA_6I25)
    efi = root / "sys/firmware/efi/efivars"
    efi.mkdir(parents=True)
    (efi / "SecureBoot-8be4df61-93ca-11d2-aa0d-00e098032b8c").write_bytes(b"\6\0\0\0\1")
    found = findings(root, locked)["kernel lockdown"]
    assert found.verdict is Verdict.BLOCKS
    assert "Secure Boot on" in found.seen


def test_a_serial_adapter(tmp_path: Path) -> None:
    (tmp_path / "dev").mkdir()
    adapter = tmp_path / "dev/ttyUSB0"
    adapter.write_text("")
    adapter.chmod(0o660)
    assert findings(tmp_path, uid=12345)["/dev/ttyUSB0"].verdict is Verdict.BLOCKS


def test_without_pyroute2_the_rest_is_examined(tmp_path: Path) -> None:
    def missing():
        raise ImportError("network settings need pyroute2: pip install 'hostmot2[doctor]'")

    found = {f.name: f for f in look(CARD, machine(tmp_path), missing)}
    assert found["network"].verdict is Verdict.UNKNOWN
    assert "hostmot2[doctor]" in found["network"].seen
    assert "kernel" in found


def test_what_a_target_may_be() -> None:
    links = FakeLinks()
    assert target_of(None, lambda: links) == Target()
    assert target_of("udp://10.10.10.10:27182", lambda: links) == Target("enp2s0", "10.10.10.10", 27182)
    assert target_of("pci://", lambda: links) == Target(url="pci://")


def test_lists_of_processors() -> None:
    assert cpu_list("0,2-4\n") == {0, 2, 3, 4}
    assert cpu_list("") == set()
