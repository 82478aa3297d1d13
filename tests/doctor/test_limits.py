"""Where the doctor cannot measure, see or set: it says so, and claims nothing."""

from __future__ import annotations

import json
import os
import pwd
import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fake_sysfs import MESA_6I25, add_device

from doctor.test_experiment import Setting
from doctor.trees import FakeLinks, machine
from hostmot2.cli.doctor import _advice
from hostmot2.doctor import Finding, Verdict, access, measure, network, scheduling
from hostmot2.doctor import machine as machines
from hostmot2.doctor.examination import Target, look, probe_of, target_of
from hostmot2.doctor.experiment import try_change
from hostmot2.doctor.knobs import knob
from hostmot2.doctor.measure import register_reads, round_trips
from hostmot2.pci_cards import find_cards

# ---- measuring


def test_a_card_that_refuses_or_says_nothing_is_no_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure, "_TIMEOUT_S", 0.0005)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        deaf.bind(("127.0.0.1", 0))
        port = deaf.getsockname()[1]
        with pytest.raises(TimeoutError, match=f"udp://127.0.0.1:{port} does not answer"):
            round_trips("127.0.0.1", port, 50, priority=0)
    with pytest.raises(TimeoutError, match="does not answer"):  # now nobody has the port
        round_trips("127.0.0.1", port, 50, priority=0)


def test_answers_of_another_length_are_not_counted_as_this_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure, "_TIMEOUT_S", 0.0005)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with ours, theirs:
        ours.settimeout(0.0005)
        theirs.send(bytes(4))
        theirs.send(bytes(8))
        assert measure._answered(ours, 8), "the late one before it is passed over"
        theirs.send(bytes(4))
        assert not measure._answered(ours, 8)


def test_registers_are_read_through_the_card_that_is_named() -> None:
    found = register_reads("emu://5i25+7i77", 20, priority=0)
    assert (found.what, len(found.times)) == ("register read", 20)
    assert "normal scheduling" in found.how


def test_a_change_is_judged_by_the_card_where_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, Any]] = []
    for name in ("round_trips", "register_reads", "lateness"):
        monkeypatch.setattr(
            f"hostmot2.doctor.examination.{name}",
            lambda *arguments, name=name, **_options: asked.append((name, arguments)),
        )
    probe_of(Target("enp2s0", "10.10.10.10"), None)(7)
    probe_of(Target(None, None, url="emu://5i25+7i77"), None)(7)
    probe_of(Target(), None)(7)
    assert [name for name, _ in asked] == ["round_trips", "register_reads", "lateness"]
    assert asked[0][1][::2] == ("10.10.10.10", 7)


def test_scheduling_that_is_not_permitted_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    real = os.sched_setscheduler

    def refuse(pid: int, policy: int, parameters: os.sched_param) -> None:
        if policy == os.SCHED_FIFO:
            raise PermissionError
        real(pid, policy, parameters)

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with measure.real_time(50) as how:
        assert how == "normal scheduling (SCHED_FIFO is not permitted)"


# ---- what is seen


def test_a_machine_without_the_network_extra_has_no_interfaces_towards_a_card() -> None:
    def missing() -> FakeLinks:
        raise ImportError("pyroute2")

    assert target_of("udp://10.10.10.10:5000", missing) == Target(None, "10.10.10.10", 5000)
    assert target_of("enp2s0", missing).host is None


@pytest.mark.parametrize(
    ("mode", "uid", "groups", "may"),
    [
        (0o600, "own", (), True),
        (0o400, "own", (), False),
        (0o660, "other", ("its",), True),
        (0o640, "other", ("its",), False),
        (0o606, "other", (), True),
        (0o660, "other", (), False),
        (0o000, "root", (), True),
    ],
)
def test_who_may_use_a_file_follows_from_its_mode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int, uid: str, groups: tuple[str, ...], may: bool
) -> None:
    path = tmp_path / "port"
    path.write_text("")
    path.chmod(mode)
    monkeypatch.setattr(machines, "group_name", lambda _gid: "its")
    facts = os.stat_result((0o100000 | mode, 0, 0, 1, 1234, 5678, 0, 0, 0, 0))
    monkeypatch.setattr(Path, "stat", lambda _self, **_options: facts)
    number = {"own": 1234, "other": 99, "root": 0}[uid]
    subject = machines.Machine(tmp_path, "anna", number, frozenset(groups), {})
    assert subject.may_write(path) is may


def test_files_that_are_gone_may_not_be_used_and_belong_to_nobody(tmp_path: Path) -> None:
    subject = machine(tmp_path, uid=1000)
    gone = tmp_path / "ttyUSB7"
    assert not subject.may_write(gone)
    found = access.serial_port(subject, gone)
    assert found.verdict is Verdict.BLOCKS
    assert "No such file" in found.seen
    assert subject.members("nobodys") is None
    gone.write_text("")
    assert access.serial_port(machine(tmp_path / "b"), gone).verdict is Verdict.GOOD


def test_users_and_groups_without_a_name_have_their_number(monkeypatch: pytest.MonkeyPatch) -> None:
    assert machines.group_name(3_999_999_999) == "3999999999"

    def nobody(_uid: int) -> None:
        raise KeyError

    monkeypatch.setattr(pwd, "getpwuid", nobody)
    assert machines._user() == str(os.geteuid())


def test_a_process_that_ends_meanwhile_is_left_out(tmp_path: Path) -> None:
    subject = machine(tmp_path, {"/proc/102/comm": "irqbalance"})
    (tmp_path / "proc/103/comm").mkdir(parents=True)  # which cannot be read
    assert sorted(subject.processes()) == ["bash", "irqbalance"]


def test_an_interface_that_is_not_there_blocks(tmp_path: Path) -> None:
    (found,) = network.interface(machine(tmp_path), FakeLinks(), "enp9s9")
    assert (found.name, found.verdict) == ("enp9s9", Verdict.BLOCKS)


@pytest.mark.parametrize(
    ("vendor", "verdict"), [("0x8086", Verdict.GOOD), ("0x14e4", Verdict.IMPROVE), ("0x9999", Verdict.GOOD)]
)
def test_other_makers_cards_are_no_fault_but_an_intel_one_is_better(
    tmp_path: Path, vendor: str, verdict: Verdict
) -> None:
    changes = {
        "/sys/class/net/enp2s0/device/vendor": vendor,
        "/sys/class/net/enp2s0/device/driver": "-> ../../../bus/pci/drivers/tg3",
    }
    found = {each.name: each for each in network.interface(machine(tmp_path, changes), FakeLinks(), "enp2s0")}
    assert found["enp2s0 hardware"].verdict is verdict


def test_one_processor_is_all_there_is(tmp_path: Path) -> None:
    changes = {"/sys/devices/system/cpu/online": "0", "/sys/devices/system/cpu/isolated": ""}
    found = {each.name: each for each in scheduling.kernel(machine(tmp_path, changes))}
    assert "two or more" in found["isolated processors"].advice


@pytest.mark.parametrize("runtime", ["-1", None])
def test_throttling_that_is_off_takes_nothing(tmp_path: Path, runtime: str | None) -> None:
    found = scheduling.throttling(machine(tmp_path, {"/proc/sys/kernel/sched_rt_runtime_us": runtime}))
    assert (found.verdict, found.seen) == (Verdict.GOOD, "off")


def test_a_bound_that_this_user_may_not_hold_needs_a_rule(tmp_path: Path) -> None:
    state = "/sys/devices/system/cpu/cpu0/cpuidle/state3"
    changes = {f"{state}/name": "C6", f"{state}/latency": "133", f"{state}/disable": "0"}
    subject = machine(tmp_path, {**changes, "/dev/cpu_dma_latency": None}, uid=1000)
    found = scheduling.idle_states(subject)
    assert "hm2 setup rt" in found.advice
    assert found.trial == ""


# ---- what can be set


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("rx-usecs", "fast", "'fast' is no number"),
        ("tx-usecs", "-1", "'-1' is no number"),
        ("adaptive-rx", "maybe", "'maybe' is neither on nor off"),
        ("eee", "2", "'2' is neither on nor off"),
        ("cpu_dma_latency", "soon", "'soon' is no number"),
        ("cpu_dma_latency", "99999999999", "99999999999 us is no latency"),
    ],
)
def test_a_value_that_is_none_changes_nothing(tmp_path: Path, key: str, value: str, said: str) -> None:
    links = FakeLinks()
    made = knob(key, machine(tmp_path), lambda: links, "enp2s0")
    before = made.read()
    with pytest.raises(ValueError, match=said):
        made.write(value)
    assert made.read() == before
    assert links.written == []


def test_what_this_machine_or_driver_does_not_have_cannot_be_tried(tmp_path: Path) -> None:
    links = FakeLinks(sleeping=None)
    with pytest.raises(OSError, match="the driver of enp2s0 has no energy-efficient Ethernet"):
        knob("eee", machine(tmp_path), lambda: links, "enp2s0").read()
    governors = {f"/sys/devices/system/cpu/cpu{n}/cpufreq/scaling_governor": None for n in (0, 1)}
    with pytest.raises(OSError, match="governor: this machine has no governor"):
        knob("governor", machine(tmp_path / "b", governors), lambda: links, None)


# ---- the command


@pytest.fixture
def trying(monkeypatch: pytest.MonkeyPatch) -> Setting:
    """`hm2 doctor --ab rx-usecs=0` on a knob in memory."""
    setting = Setting()
    monkeypatch.setattr("hostmot2.cli.doctor.knob", lambda *_: setting.knob())
    monkeypatch.setattr("hostmot2.cli.doctor.probe_of", lambda *_, **__: lambda _count: setting.probe())
    monkeypatch.setattr("hostmot2.cli.doctor.target_of", lambda *_: Target("enp2s0", "10.10.10.10"))
    return setting


def test_a_tried_change_is_told_with_both_numbers_and_put_back(command_line: Any, trying: Setting) -> None:
    status, out, _ = command_line("doctor", "--ab", "rx-usecs=0", "--rounds", "10")
    assert status == 0
    assert "rx-usecs 57" in out
    assert "rx-usecs 0" in out
    assert "faster" in out
    assert "the setting is back at 57" in out
    assert trying.value == "57"
    told = json.loads(command_line("--json", "doctor", "--ab", "rx-usecs=0", "--rounds", "10")[1])
    assert (told["old"], told["new"], told["differences"]["p50"]["verdict"]) == ("57", "0", "faster")


def test_a_setting_that_could_not_be_put_back_is_said_loudly(
    command_line: Any, trying: Setting, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = try_change
    monkeypatch.setattr(
        "hostmot2.cli.doctor.try_change",
        lambda *arguments, **options: replace(real(*arguments, **options), restored=False, lost=(0, 3)),
    )
    out = command_line("doctor", "--ab", "rx-usecs=0", "--rounds", "10")[1]
    assert "could NOT be put back to 57: do it by hand" in out
    assert "answers lost: 0 without, 3 with the change" in out


def test_what_a_card_judges_needs_a_card(command_line: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hostmot2.cli.doctor.knob", lambda *_: Setting().knob())
    monkeypatch.setattr("hostmot2.cli.doctor.target_of", lambda *_: Target("enp2s0"))
    status, _, err = command_line("doctor", "enp2s0", "--ab", "rx-usecs=0")
    assert (status, "name the card, udp://HOST" in err) == (2, True)


@pytest.mark.parametrize(
    ("trial", "target", "command"),
    [
        ("rx-usecs=0", Target("enp2s0"), "Try it: hm2 doctor enp2s0 --ab rx-usecs=0"),
        ("rx-usecs=0", Target(), "Try it: hm2 doctor enp3s0 --ab rx-usecs=0"),
        ("governor=performance", Target("enp2s0"), "Try it: hm2 doctor --ab governor=performance"),
    ],
)
def test_advice_that_can_be_tried_says_how(trial: str, target: Target, command: str) -> None:
    finding = Finding("enp3s0 coalescing", Verdict.IMPROVE, "57 us", "Turn it off.", trial)
    assert _advice(finding, target) == f"enp3s0 coalescing: Turn it off. {command}"


def test_interfaces_in_use_with_hardware_are_looked_at_when_none_is_named(tmp_path: Path) -> None:
    names = [each.name for each in look(Target(), machine(tmp_path), FakeLinks)]
    assert "enp2s0 hardware" in names
    unplugged = FakeLinks(link=replace(FakeLinks().link, carrier=False))
    names = [each.name for each in look(Target(), machine(tmp_path / "b"), lambda: unplugged)]
    assert not any(name.startswith("enp2s0") for name in names)


def test_a_pci_card_that_lost_its_bar_blocks(tmp_path: Path) -> None:
    add_device(_sysfs(tmp_path), "0000:03:00.0", MESA_6I25, size=0)
    (card,) = find_cards(tmp_path / "sys")
    (tmp_path / "sys/bus/pci/devices/0000:03:00.0" / card.registers.name).write_bytes(b"")
    found = access.pci_card(machine(tmp_path / "root"), card)
    assert (found.verdict, found.seen) == (Verdict.BLOCKS, "its register BAR is not assigned")


def _sysfs(tmp_path: Path) -> Path:
    (tmp_path / "sys/bus/pci/devices").mkdir(parents=True)
    return tmp_path / "sys"
