"""Fabricated /proc, /sys, /dev and /etc, and a network that is not there."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from hostmot2.doctor.links import Coalescing, Link
from hostmot2.doctor.machine import Machine

GOOD: dict[str, str] = {
    "/proc/version": "Linux version 6.1.0-rt (gcc) #1 SMP PREEMPT_RT Debian",
    "/sys/kernel/realtime": "1",
    "/sys/kernel/security/lockdown": "[none] integrity confidentiality",
    "/sys/devices/system/cpu/isolated": "3",
    "/sys/devices/system/cpu/online": "0-3",
    "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "performance",
    "/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor": "performance",
    "/sys/devices/system/cpu/cpu0/cpuidle/state0/name": "POLL",
    "/sys/devices/system/cpu/cpu0/cpuidle/state0/latency": "0",
    "/sys/devices/system/cpu/cpu0/cpuidle/state0/disable": "0",
    "/sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc",
    "/proc/sys/kernel/sched_rt_runtime_us": "950000",
    "/proc/sys/kernel/sched_rt_period_us": "1000000",
    "/proc/self/timerslack_ns": "50000",
    "/proc/cpuinfo": "flags : fpu tsc",
    "/etc/group": "root:x:0:\nhostmot2:x:900:anna\n",
    "/dev/cpu_dma_latency": "",
    "/sys/class/net/enp2s0/device/vendor": "0x8086",
    "/sys/class/net/enp2s0/device/msi_irqs/40": "msix",
    "/sys/class/net/enp2s0/device/msi_irqs/41": "msix",
    "/proc/irq/40/smp_affinity_list": "3",
    "/proc/irq/41/smp_affinity_list": "3",
    "/proc/irq/41/effective_affinity_list": "3",
    "/proc/101/comm": "bash",
}
"""A machine on which nothing is to be changed."""
LINKS = {
    "/sys/class/net/enp2s0/device/driver": "../../../bus/pci/drivers/igb",
    "/sys/class/net/enp2s0/device/subsystem": "../../../bus/pci",
}


def machine(root: Path, changes: dict[str, str | None] | None = None, **options: object) -> Machine:
    """The good machine below `root` with some files otherwise; None: without that file."""
    files: dict[str, str | None] = {**GOOD, **(changes or {})}
    targets = {
        **LINKS,
        **{name: text[3:] for name, text in (changes or {}).items() if text and text[:3] == "-> "},
    }
    for name, text in files.items():
        if text is None or name in targets:
            continue
        path = root / name.lstrip("/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n" if text else "")
    for name, target in targets.items():
        path = root / name.lstrip("/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.symlink_to(target)
    facts = {
        "user": "anna",
        "uid": 0,
        "groups": frozenset({"anna"}),
        "limits": {"rtprio": 80, "memlock": None},
    }
    return Machine(root=root, **{**facts, **options})  # type: ignore[arg-type]


@dataclass
class FakeLinks:
    """A network with one interface, whose settings can be changed."""

    link: Link = field(
        default_factory=lambda: Link("enp2s0", 2, True, True, "00:11:22:33:44:55", "", ("10.10.10.11/24",))
    )
    coalesce: Coalescing | None = field(default_factory=lambda: Coalescing(0, 0, False, False))
    sleeping: bool | None = False
    direct: bool = True
    written: list[dict[str, int]] = field(default_factory=list)

    def all(self) -> list[Link]:
        return [self.link]

    def towards(self, address: str) -> tuple[str, bool]:
        return self.link.name, self.direct

    def coalescing(self, name: str) -> Coalescing | None:
        return self.coalesce

    def set_coalescing(self, name: str, **values: int) -> None:
        assert self.coalesce is not None
        self.written.append(values)
        self.coalesce = Coalescing(**{**self.coalesce.__dict__, **values})

    def eee(self, name: str) -> bool | None:
        return self.sleeping

    def set_eee(self, name: str, on: bool) -> None:
        self.sleeping = on
