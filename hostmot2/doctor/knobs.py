"""What `--ab KEY=VALUE` can change: each reads its setting as text and writes it, so it can be put back."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hostmot2.doctor.links import Links
from hostmot2.doctor.machine import Machine

_SWITCH = {"on": 1, "off": 0, "1": 1, "0": 0}


@dataclass(frozen=True)
class Knob:
    """One setting. kept: it outlives this process, so somebody must restore it even if that is killed."""

    key: str
    read: Callable[[], str]
    write: Callable[[str], None]
    kept: bool = True


def _number(text: str) -> int:
    if not text.isdigit():
        raise ValueError(f"{text!r} is no number")
    return int(text)


def _switch(text: str) -> int:
    if text not in _SWITCH:
        raise ValueError(f"{text!r} is neither on nor off")
    return _SWITCH[text]


def _on(value: bool) -> str:
    return "on" if value else "off"


def _coalescing(links: Links, name: str, field: str, parse: Callable[[str], int], key: str) -> Knob:
    def read() -> str:
        found = links.coalescing(name)
        if found is None:
            raise OSError(f"the driver of {name} has no interrupt coalescing")
        value = getattr(found, field)
        return _on(value) if parse is _switch else str(value)

    return Knob(key, read, lambda text: links.set_coalescing(name, **{field: parse(text)}))


def _eee(links: Links, name: str) -> Knob:
    def read() -> str:
        found = links.eee(name)
        if found is None:
            raise OSError(f"the driver of {name} has no energy-efficient Ethernet")
        return _on(found)

    return Knob("eee", read, lambda text: links.set_eee(name, bool(_switch(text))))


def _files(key: str, paths: list[Path], what: str) -> Knob:
    """Files that are set alike and put back each to its own."""
    if not paths:
        raise OSError(f"{key}: this machine has no {what}")

    def read() -> str:
        values = [path.read_text().strip() for path in paths]
        return values[0] if len(set(values)) == 1 else ";".join(values)

    def write(text: str) -> None:
        values = text.split(";")
        for path, value in zip(paths, values * len(paths) if len(values) == 1 else values, strict=False):
            path.write_text(value)

    return Knob(key, read, write)


class _DmaLatency:
    """Holds /dev/cpu_dma_latency open with a bound in us; the kernel forgets it when the file is closed."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._held: tuple[int, str] | None = None

    def read(self) -> str:
        """The bound held, "" for none."""
        return self._held[1] if self._held else ""

    def write(self, text: str) -> None:
        """Hold a bound; "" lets go."""
        bound = _number(text) if text else 0
        if not 0 <= bound < 1 << 31:
            raise ValueError(f"{text} us is no latency")
        if self._held:
            os.close(self._held[0])
            self._held = None
        if text:
            descriptor = os.open(self._path, os.O_RDWR)
            self._held = (descriptor, text)
            os.write(descriptor, bound.to_bytes(4, "little"))


KEYS = ("rx-usecs", "tx-usecs", "adaptive-rx", "adaptive-tx", "eee", "irq-cpu", "governor", "cpu_dma_latency",
        "timer-slack", "rt-runtime")  # fmt: skip
"""Everything that can be tried; the first six need an interface."""


def knob(key: str, machine: Machine, links: Callable[[], Links], interface: str | None) -> Knob:
    """The knob called `key`. ValueError if it is unknown or needs an interface, OSError if it is not here."""
    if key not in KEYS:
        raise ValueError(f"{key!r} cannot be tried; there are {', '.join(KEYS)}")
    if key in KEYS[:6]:
        if not interface:
            raise ValueError(f"{key} belongs to an interface: hm2 doctor INTERFACE --ab {key}=...")
        return _of_interface(key, machine, links, interface)
    if key == "governor":
        return _files(
            key, machine.find("/sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor"), "governor"
        )
    if key == "cpu_dma_latency":
        held = _DmaLatency(machine.path("/dev/cpu_dma_latency"))
        return Knob(key, held.read, held.write, kept=False)
    if key == "timer-slack":
        return _own(_files(key, [machine.path("/proc/self/timerslack_ns")], "timer slack"))
    return _files(key, [machine.path("/proc/sys/kernel/sched_rt_runtime_us")], "real-time throttling")


def _own(made: Knob) -> Knob:
    """A setting of this process: it ends with it."""
    return Knob(made.key, made.read, made.write, kept=False)


def _of_interface(key: str, machine: Machine, links: Callable[[], Links], name: str) -> Knob:
    if key == "irq-cpu":
        numbers = [path.name for path in machine.find(f"/sys/class/net/{name}/device/msi_irqs/*")]
        paths = [machine.path(f"/proc/irq/{number}/smp_affinity_list") for number in numbers]
        return _files(key, [path for path in paths if path.exists()], f"interrupt of {name}")
    if key == "eee":
        return _eee(links(), name)
    parse = _switch if key.startswith("adaptive") else _number
    return _coalescing(links(), name, key.replace("-", "_"), parse, key)
