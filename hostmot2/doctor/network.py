"""The way to an Ethernet card: address, NIC, driver, interrupt coalescing, EEE, interrupt processor."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator

from hostmot2.doctor.finding import Finding, Verdict
from hostmot2.doctor.links import Link, Links
from hostmot2.doctor.machine import Machine

_VENDORS = {"0x8086": "Intel", "0x10ec": "Realtek", "0x14e4": "Broadcom", "0x1969": "Atheros"}
_REALTEK = {"r8169": "r8168 (or r8125 for 2.5 Gbit/s)"}
_SLOW = {"usb": "USB", "mmc": "SDIO"}


def interface(machine: Machine, links: Links, name: str) -> Iterator[Finding]:
    """Everything about one interface, in the order in which it matters."""
    link = next((each for each in links.all() if each.name == name), None)
    if link is None:
        yield Finding(name, Verdict.BLOCKS, "there is no such interface", "`hm2 doctor` lists what is there.")
        return
    yield _carrier(link)
    yield hardware(machine, link)
    yield from coalescing(links, link)
    yield from eee(links, link)
    yield from interrupts(machine, link)


def _carrier(link: Link) -> Finding:
    addresses = ", ".join(link.addresses) or "no IPv4 address"
    if link.up and link.carrier:
        return Finding(f"{link.name} link", Verdict.GOOD, f"up, {addresses}")
    what = "no carrier" if link.up else "down"
    return Finding(
        f"{link.name} link",
        Verdict.BLOCKS,
        f"{what}, {addresses}",
        "Check the cable and the card's power." if link.up else f"ip link set {link.name} up",
    )


def address(links: Links, card: str) -> Iterator[Finding]:
    """Whether this host is in the card's network."""
    name, direct = links.towards(card)
    if direct:
        yield Finding("route to the card", Verdict.GOOD, f"{card} by {name}, without a gateway")
        return
    number = ipaddress.IPv4Address(card)
    own = number + 1 if number.packed[3] < 254 else number - 1
    yield Finding(
        "route to the card",
        Verdict.BLOCKS,
        f"this host has no address in the network of {card}; packets would leave by {name or 'nothing'}",
        f"hm2 setup net INTERFACE --address {own}/24 --write, or for now: ip addr add {own}/24 dev INTERFACE",
    )


def hardware(machine: Machine, link: Link) -> Finding:
    """A dedicated Intel NIC is best; USB and Wi-Fi have no bounds; Realtek's own drivers beat the kernel."""
    base = f"/sys/class/net/{link.name}"
    title = f"{link.name} hardware"
    if machine.path(f"{base}/wireless").exists() or machine.path(f"{base}/phy80211").exists():
        return Finding(
            title, Verdict.IMPROVE, "Wi-Fi", "Wi-Fi has no bounded latency: use a wired Intel NIC."
        )
    driver, bus = machine.target(f"{base}/device/driver"), machine.target(f"{base}/device/subsystem")
    if driver is None:
        return Finding(title, Verdict.GOOD, f"virtual ({link.kind or 'no device'}): nothing to tune")
    vendor = _VENDORS.get(machine.text(f"{base}/device/vendor") or "", "")
    seen = f"{vendor or bus or 'device'}, driver {driver}"
    if bus in _SLOW:
        advice = f"A {_SLOW[bus]} adapter adds milliseconds: use a NIC on PCI, best an Intel one of its own."
        return Finding(title, Verdict.IMPROVE, seen, advice)
    if driver in _REALTEK:
        return Finding(
            title,
            Verdict.IMPROVE,
            seen,
            f"Realtek's own driver {_REALTEK[driver]} has mended this for many; an Intel NIC is better.",
        )
    if vendor in ("Intel", ""):
        return Finding(title, Verdict.GOOD, seen)
    return Finding(title, Verdict.IMPROVE, seen, "An Intel NIC for the card alone has the best record.")


def coalescing(links: Links, link: Link) -> Iterator[Finding]:
    """Interrupts that are held back are latency; on a few NICs zero is worse, so measure."""
    title = f"{link.name} interrupt coalescing"
    found = links.coalescing(link.name)
    if found is None:
        yield Finding(title, Verdict.GOOD, "the driver has none")
        return
    seen = f"rx-usecs {found.rx_usecs}, tx-usecs {found.tx_usecs}, adaptive rx {_on(found.adaptive_rx)}"
    if found.adaptive_rx:
        advice = "Switch adaptive coalescing off; `hm2 setup net` prints the .link file that keeps it off."
        yield Finding(title, Verdict.IMPROVE, seen, advice, "adaptive-rx=off")
    elif found.rx_usecs > 0:
        advice = (
            "Try 0: it helps most NICs and hurts a few; `hm2 setup net` prints the .link file that keeps it."
        )
        yield Finding(title, Verdict.IMPROVE, seen, advice, "rx-usecs=0")
    else:
        yield Finding(title, Verdict.GOOD, seen)


def eee(links: Links, link: Link) -> Iterator[Finding]:
    """The transceiver takes tens of microseconds to wake."""
    title = f"{link.name} energy-efficient Ethernet"
    found = links.eee(link.name)
    if found:
        yield Finding(
            title, Verdict.IMPROVE, "on", "Switch it off: the line sleeps between packets.", "eee=off"
        )
    else:
        yield Finding(title, Verdict.GOOD, "off" if found is False else "the driver has none")


def interrupts(machine: Machine, link: Link) -> Iterator[Finding]:
    """The NIC's interrupt belongs on the processor of the cycle: the isolated one, if there is one."""
    numbers = [path.name for path in machine.find(f"/sys/class/net/{link.name}/device/msi_irqs/*")]
    single = machine.text(f"/sys/class/net/{link.name}/device/irq")
    numbers = numbers or [each for each in [single] if each and each != "0"]
    if not numbers:
        return
    cpus: set[int] = set()
    for number in numbers:
        where = machine.processors(f"/proc/irq/{number}/effective_affinity_list")
        cpus |= where or machine.processors(f"/proc/irq/{number}/smp_affinity_list")
    isolated = machine.processors("/sys/devices/system/cpu/isolated")
    title, shown = f"{link.name} interrupts", _shown(cpus)
    balanced = "irqbalance" in machine.processes()
    seen = f"on processors {shown}, isolated {_shown(isolated) or 'none'}" + (
        ", irqbalance runs" if balanced else ""
    )
    if isolated and not cpus <= isolated:
        target = min(isolated)
        yield Finding(
            title,
            Verdict.IMPROVE,
            seen,
            f"Put them on the isolated processor that runs the cycle: echo {target} into "
            f"/proc/irq/N/smp_affinity_list for N = {', '.join(numbers)}.",
            f"irq-cpu={target}",
        )
    elif balanced:
        yield Finding(
            title, Verdict.IMPROVE, seen, "irqbalance moves interrupts at will: stop it, or ban these."
        )
    else:
        yield Finding(title, Verdict.GOOD, seen)


def _on(value: bool) -> str:
    return "on" if value else "off"


def _shown(cpus: set[int] | frozenset[int]) -> str:
    return ", ".join(str(cpu) for cpu in sorted(cpus))
