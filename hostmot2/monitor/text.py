"""What the view writes: lines and cells from a snapshot; and values from what a user types."""

from __future__ import annotations

import math

from hostmot2.monitor.snapshot import BitsRow, ChannelRow, Snapshot, ValueRow

BAR = 12
ON, OFF = "●", "·"


def status_line(now: Snapshot, paused: bool) -> str:
    """Card, access, rate, watchdog, recording."""
    parts = [f"{now.card} {now.url}", f"{now.rate:g} Hz", f"watchdog {now.watchdog}"]
    if now.recording is not None:
        recording = now.recording
        dropped = f" {recording.dropped} dropped" if recording.dropped else ""
        parts.append(f"REC {minutes(recording.seconds)}{dropped}")
    if paused:
        parts.append("PAUSED")
    return "  ".join(parts)


def latency_text(now: Snapshot) -> str:
    """99th percentiles and the longest cycle."""
    latency = now.latency
    if latency.reply_p99 is None or latency.cycle_p99 is None or latency.cycle_max is None:
        return "p99 of reply and cycle: -"
    reply, cycle = microseconds(latency.reply_p99), microseconds(latency.cycle_p99)
    return f"p99: reply {reply}, cycle {cycle}, max {microseconds(latency.cycle_max)}"


def lost_text(now: Snapshot) -> str:
    """How many exchanges did not come back, and how many cycles ended too late."""
    return f"lost {now.lost} of {now.cycles}  late {now.overruns}"


def microseconds(value: float) -> str:
    """In the unit that suits."""
    if value >= 1000:
        return f"{value / 1000:.1f} ms" if value < 100_000 else f"{value / 1000:.0f} ms"
    return f"{value:.1f} µs" if value < 100 else f"{value:.0f} µs"


def minutes(seconds: float) -> str:
    """Minutes and seconds."""
    return f"{int(seconds) // 60:02d}:{int(seconds) % 60:02d}"


def channel_state(row: ChannelRow) -> str:
    """One word or two."""
    if row.cut_off:
        return "cut off"
    if row.faults and row.started:
        return "FAULT"
    return row.status.state


def channel_trouble(row: ChannelRow) -> str:
    """What is or was wrong, the worst first, in words."""
    parts = ["the watchdog has bitten: nothing is exchanged"] if row.cut_off else []
    if row.faults:
        parts.append(", ".join(row.faults))
    if row.past:
        parts.append(f"since start: {', '.join(row.past)}")
    if row.counters is not None and row.counters.total:
        parts.append(str(row.counters))
    if row.failed:
        parts.append(f"{row.failed} transfers failed")
    return "; ".join(parts) or ("" if row.idle else "ok")


def channel_detail(row: ChannelRow) -> str:
    """All that is known of a channel, a few lines."""
    unit = f", unit {row.unit_number:08X}" if row.unit_number else ""
    head = f"{row.label} {row.name or 'no remote known'}{unit}: {row.status.state}"
    lines = [f"{head}{f', software mode {row.mode}' if row.mode else ''}"]
    lines.append(
        f"now: {', '.join(row.faults) or 'nothing wrong'}; since start: {', '.join(row.past) or 'nothing'}"
    )
    counted = row.counters
    if counted is not None:
        lines.append(
            f"counted: CRC {counted.crc_errors}, cookie {counted.cookie_errors}, overrun {counted.overruns}, "
            f"timeout {counted.timeouts}, extra {counted.extra_characters}, break {counted.serial_breaks}, "
            f"remote fault {counted.remote_faults}; {row.failed} transfers failed"
        )
    return "\n".join(lines)


def bits_text(row: BitsRow) -> str:
    """Bit 0 first, in groups of eight."""
    marks = "".join(ON if bit else OFF for bit in row.bits)
    return " ".join(marks[first : first + 8] for first in range(0, len(marks), 8))


def bar(row: ValueRow) -> str:
    """The value between its limits; from the middle where the limits are on both sides of 0."""
    fraction = row.fraction
    if fraction is None:
        return ""
    zero = -row.low / (row.high - row.low) if row.low < 0 < row.high else 0.0
    first, last = sorted((zero, fraction))
    cells = [first * BAR <= n + 0.5 < last * BAR for n in range(BAR)]
    return "▕" + "".join("█" if cell else " " for cell in cells) + "▏"


def limits(row: ValueRow) -> str:
    """What a value may be."""
    return f"{row.low:g} to {row.high:g} {row.unit}".strip() if row.fraction is not None else "any number"


def parse_value(row: ValueRow | BitsRow, typed: str) -> float:
    """What was typed for an output. Raises ValueError, saying what would do."""
    if isinstance(row, BitsRow):
        return float(_parse_bits(row, typed.lower().replace("=", " ").split()))
    try:
        value = float(typed)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"a number is needed: {limits(row)}")
    if row.fraction is not None and not row.low <= value <= row.high:
        raise ValueError(f"{typed} is outside {limits(row)}")
    return value


_SWITCHED = {"on": True, "1": True, "off": False, "0": False}


def _parse_bits(row: BitsRow, words: list[str]) -> int:
    if row.width == 1 and len(words) == 1 and words[0] in _SWITCHED:
        return int(_SWITCHED[words[0]])
    if len(words) == 2 and words[0].isdecimal() and words[1] in _SWITCHED:
        bit = int(words[0])
        if bit >= row.width:
            raise ValueError(f"there are bits 0 to {row.width - 1}")
        return row.value | 1 << bit if _SWITCHED[words[1]] else row.value & ~(1 << bit)
    try:
        value = int(words[0], 0) if len(words) == 1 else -1
    except ValueError:
        value = -1
    if not 0 <= value < 1 << row.width:
        wanted = (
            "on or off"
            if row.width == 1
            else f"`3 on`, `3 off`, or all bits as 0x0 to 0x{(1 << row.width) - 1:X}"
        )
        raise ValueError(wanted)
    return value
