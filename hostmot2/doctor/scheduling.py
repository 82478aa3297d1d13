"""The kernel, the processors and what this user may ask of them."""

from __future__ import annotations

from collections.abc import Iterator

from hostmot2.doctor.finding import Finding, Verdict
from hostmot2.doctor.machine import Machine

_CPU = "/sys/devices/system/cpu"
DEEP_US = 10
"""An idle state that takes longer to leave is felt by a cycle."""
_WANTED_PRIORITY, _WANTED_MEMORY = 80, 256 << 20


def kernel(machine: Machine) -> Iterator[Finding]:
    """PREEMPT_RT, and a processor of its own."""
    version = machine.text("/proc/version") or ""
    if machine.text("/sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        yield Finding("kernel", Verdict.GOOD, "PREEMPT_RT")
    else:
        model = next((word for word in version.split() if word.startswith("PREEMPT")), "not preemptible")
        yield Finding(
            "kernel",
            Verdict.IMPROVE,
            model,
            "Install a PREEMPT_RT kernel (Debian: linux-image-rt-amd64) and boot it.",
        )
    isolated = machine.text(f"{_CPU}/isolated") or ""
    count = len(machine.processors(f"{_CPU}/online")) or 1
    if isolated:
        yield Finding("isolated processors", Verdict.GOOD, isolated)
    elif count > 1:
        last = count - 1
        yield Finding(
            "isolated processors",
            Verdict.IMPROVE,
            f"none of {count}",
            f"isolcpus={last} nohz_full={last} rcu_nocbs={last} on the kernel command line, the cycle on "
            f"processor {last}, and the NIC's interrupt there, too.",
        )
    else:
        yield Finding(
            "isolated processors", Verdict.IMPROVE, "one processor in all", "Use a machine with two or more."
        )


def power(machine: Machine) -> Iterator[Finding]:
    """Clock rate and idle states."""
    paths = machine.find(f"{_CPU}/cpu[0-9]*/cpufreq/scaling_governor")
    governors = {path.read_text().strip() for path in paths}
    if not governors:
        yield Finding("frequency governor", Verdict.GOOD, "the kernel does not scale the clock")
    elif governors == {"performance"}:
        yield Finding("frequency governor", Verdict.GOOD, "performance")
    else:
        advice = "performance keeps the clock up (cpupower frequency-set -g performance)."
        yield Finding(
            "frequency governor",
            Verdict.IMPROVE,
            ", ".join(sorted(governors)),
            advice,
            "governor=performance",
        )
    yield idle_states(machine)


def idle_states(machine: Machine) -> Finding:
    """Deep idle states cost their exit latency at each wake-up; an open /dev/cpu_dma_latency forbids them."""
    deep = {}
    for path in machine.find(f"{_CPU}/cpu0/cpuidle/state*"):
        base = f"{_CPU}/cpu0/cpuidle/{path.name}"
        latency, disabled = machine.number(f"{base}/latency") or 0, machine.number(f"{base}/disable")
        if latency >= DEEP_US and not disabled:
            deep[machine.text(f"{base}/name") or path.name] = latency
    if not deep:
        return Finding("idle states", Verdict.GOOD, "none that is slow to leave")
    seen = ", ".join(f"{name} {latency} us" for name, latency in deep.items())
    may = machine.may_write(machine.path("/dev/cpu_dma_latency"))
    advice = "Hold /dev/cpu_dma_latency at 0 while the cycle runs"
    if not may:
        advice += "; `hm2 setup rt` prints the udev rule that lets this user"
    return Finding("idle states", Verdict.IMPROVE, seen, f"{advice}.", "cpu_dma_latency=0" if may else "")


def limits(machine: Machine) -> Iterator[Finding]:
    """Real-time priority and locked memory for this user."""
    priority, memory = machine.limits["rtprio"], machine.limits["memlock"]
    root = machine.uid == 0
    advice = "`hm2 setup rt --write` installs the limits; then log in anew."
    if root or priority is None or priority >= _WANTED_PRIORITY:
        yield Finding("real-time priority", Verdict.GOOD, "root" if root else f"up to {_number(priority)}")
    else:
        yield Finding("real-time priority", Verdict.IMPROVE, f"up to {priority}", advice, "")
    if root or memory is None or memory >= _WANTED_MEMORY:
        yield Finding("locked memory", Verdict.GOOD, "root" if root else _mebibytes(memory))
    else:
        yield Finding("locked memory", Verdict.IMPROVE, f"up to {_mebibytes(memory)}", advice)
    yield throttling(machine)
    slack = machine.number("/proc/self/timerslack_ns")
    seen = "not told" if slack is None else f"{slack / 1000:g} us, without SCHED_FIFO"
    yield Finding("timer slack", Verdict.GOOD, seen)


def throttling(machine: Machine) -> Finding:
    """The kernel takes the processor from real-time threads that never sleep."""
    runtime, period = (
        machine.number(f"/proc/sys/kernel/sched_rt_{name}_us") for name in ("runtime", "period")
    )
    if runtime is None or runtime < 0 or period is None:
        return Finding("real-time throttling", Verdict.GOOD, "off")
    share = 100 * runtime / period
    return Finding(
        "real-time throttling",
        Verdict.GOOD,
        f"{share:g} % of {period / 1e6:g} s: felt only by threads that never sleep; a safety net, leave it",
    )


def clock(machine: Machine) -> Iterator[Finding]:
    """A slow clock costs a microsecond at each look; in a virtual machine nothing can be promised."""
    source = machine.text("/sys/devices/system/clocksource/clocksource0/current_clocksource")
    if source and source not in ("tsc", "arch_sys_counter", "kvm-clock"):
        yield Finding(
            "clock source",
            Verdict.IMPROVE,
            source,
            "The kernel gave the TSC up: look into dmesg, update the firmware.",
        )
    elif source:
        yield Finding("clock source", Verdict.GOOD, source)
    if "hypervisor" in (machine.text("/proc/cpuinfo") or "").split():
        advice = "Measure on the machine itself: the host may take the processor at any time."
        yield Finding("virtual machine", Verdict.IMPROVE, "a hypervisor is below this kernel", advice)


def _number(value: int | None) -> str:
    return "any" if value is None else str(value)


def _mebibytes(value: int | None) -> str:
    return "unlimited" if value is None else f"{value / (1 << 20):g} MiB"
