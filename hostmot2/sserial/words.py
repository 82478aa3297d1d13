"""CS, COMMAND and DATA words in plain words: what each bit says, whether it holds now, and what to do.

Source: sserial.md 2 (commands), 3.2 and 3.3 (CS), 2.3 (DATA).
"""

from __future__ import annotations

from dataclasses import dataclass

from hostmot2.registers import ComState, CsStatus, LocalFault, RemoteFault, SslbpCommand, SslbpResult
from hostmot2.sserial.status import ChannelStatus

_STATES = {
    "stopped": "The channel is stopped: it was not started since the port's reset or its last stop.",
    "absent": "Nothing answered: the start asked 21 times and gave up.",
    "starting": "The channel is being started.",
    "failed": "A remote answered, but its start broke off.",
    "chatter": "Started: until the first DOIT the firmware itself exchanges zero outputs with the remote.",
    "dead": "Given up: before the first DOIT the remote stopped answering 21 times.",
    "running": "Process data runs: DOIT exchanges it.",
    "setup": "Set-up mode: the remote's memory can be reached, no process data runs.",
}
_STATUS = {
    CsStatus.NOT_READY: (15, "not ready", "stopped, absent or still starting", True),
    CsStatus.NO_REMOTE_ID: (14, "no remote identified", "the remote's name is not known (yet)", True),
    CsStatus.COMMUNICATION_ERROR: (
        13,
        "communication error",
        "an error on the line; bits 7 to 0 say which",
        False,
    ),
    CsStatus.REMOTE_FAULT: (8, "remote fault", "a fault of the remote; set by every stop, too", False),
}
_LOCAL = {
    LocalFault.TOO_MANY_ERRORS: (7, "too many errors", "21 or more of one kind; while running only a flag"),
    LocalFault.REMOTE_FAULT: (6, "remote fault", "a fault came with a start or with process data"),
    LocalFault.SERIAL_BREAK: (
        5,
        "serial break",
        "a stop bit was low: broken wire, polarity, or wrong baud rate",
    ),
    LocalFault.EXTRA_CHARACTER: (4, "extra character", "more bytes than a reply has: noise, or two remotes"),
    LocalFault.TIMEOUT: (3, "timeout", "no complete reply in time (a damaged one sets this, too)"),
    LocalFault.OVERRUN: (2, "overrun", "bytes came faster than they were taken"),
    LocalFault.INVALID_COOKIE: (1, "invalid cookie", "something answered that is no LBP remote"),
    LocalFault.CRC: (0, "CRC error", "a reply's checksum was wrong: noise or wiring"),
}
_REMOTE = {
    RemoteFault.LBP_COMMUNICATION: (31, "LBP communication", "the remote heard damaged commands"),
    RemoteFault.ILLEGAL_MODE: (30, "illegal mode", "it does not have the software mode asked for"),
    RemoteFault.LOW_VOLTAGE: (29, "low voltage", "its supply or bus voltage is too low"),
    RemoteFault.HIGH_VOLTAGE: (28, "high voltage", "its supply or bus voltage is too high"),
    RemoteFault.OVER_CURRENT: (27, "over current", "an output is overloaded or shorted"),
    RemoteFault.OVER_TEMPERATURE: (26, "over temperature", "it is too hot"),
    RemoteFault.NO_ENABLE: (25, "not enabled", "its hardware enable is missing"),
    RemoteFault.WATCHDOG: (
        24,
        "watchdog bitten",
        "no exchange for longer than its watchdog allows: outputs are off",
    ),
}


@dataclass(frozen=True, slots=True)
class Meaning:
    """One bit or group of a word. live: it held when the word was read; else: at some time since a stop."""

    bits: str
    name: str
    text: str
    live: bool = True


@dataclass(frozen=True)
class Words:
    """A word in plain words: a sentence, its parts, what to do ("" for nothing)."""

    summary: str
    parts: tuple[Meaning, ...] = ()
    do: str = ""


def explain_cs(word: int) -> Words:
    """A channel's CS register as it was read."""
    status = ChannelStatus(word & 0xFFFFFFFF)
    heard = bool(status.live_fault)
    before = "" if heard else "left over from before the start: "
    state = Meaning("23:16", status.state, _state(status))
    parts = [
        *(
            Meaning(str(bit), name, before + text, heard)
            for flag, (bit, name, text) in _REMOTE.items()
            if status.remote_fault & flag
        ),
        state,
        *(
            Meaning(str(bit), name, text, live)
            for flag, (bit, name, text, live) in _STATUS.items()
            if status.status & flag
        ),
        *(
            Meaning(str(bit), name, text, False)
            for flag, (bit, name, text) in _LOCAL.items()
            if status.local_fault & flag
        ),
    ]
    return Words(_summary(status), tuple(parts), _cs_advice(status))


def _state(status: ChannelStatus) -> str:
    text = _STATES.get(status.state, "A state of the firmware that is not known.")
    code = status.com_state
    name = code.name.lower().replace("_", " ") if isinstance(code, ComState) else f"0x{code:02X}"
    return f"{text} (state 0x{int(code):02X}, {name})"


def _summary(status: ChannelStatus) -> str:
    words = [_STATES.get(status.state, f"State 0x{status.word >> 16 & 0xFF:02X} of the firmware.")]
    if status.live_fault:
        words.append("The remote reports a fault.")
    if status.local_fault & ~LocalFault.REMOTE_FAULT and status.state not in ("absent", "dead"):
        words.append("There were errors on the line since the channel was last stopped; they may be over.")
    elif not status.live_fault and status.state == "running":
        words.append("Nothing is wrong." if not status.local_fault else "A remote's fault has gone again.")
    return " ".join(words)


def _cs_advice(status: ChannelStatus) -> str:
    fault, local = status.live_fault, status.local_fault
    if status.state in ("absent", "dead"):
        return "`hm2 sserial scan` says what to check, in order (`hm2 explain NoRemote`)."
    if fault & RemoteFault.ILLEGAL_MODE:
        return "Choose another software mode (channel.mode; 0 always exists), then start again."
    if fault & RemoteFault.WATCHDOG:
        return "Find out what kept exchanges from coming in time; stop() and start() bring the outputs back."
    if fault:
        return "Remove the cause of the remote's fault, then stop() and start() the channel."
    if status.state == "failed":
        return "Stop, check supply and line, start again; `hm2 sserial start MASK` shows the evidence."
    if local & ~LocalFault.REMOTE_FAULT:
        return (
            "The port's counters() tell how many and of which kind. A few over days are noise; many are "
            "cable, termination, ground or baud rate. Bits stay until the channel is stopped; DATA tells of "
            "each exchange."
        )
    return ""


def explain_command(word: int) -> Words:
    """A port's COMMAND register, as written or, while a command is at work, as read."""
    if word & 0x80000000:
        return Words(
            "A write that is ignored (bit 31): it keeps a fixed list of transfers without a command."
        )
    word &= 0xFFFF
    high, low = word >> 8, word & 0xFF
    if word == 0:
        return Words("Read: idle, the last command is done. Written: no command; DATA becomes 0xFF.")
    if word & SslbpCommand.RESET:
        return Words(
            f"The port's processor is held in reset; DATA shows word 0x{word & 0x7FF:03X} of its program.",
            do="Any value without bit 14 releases it; port.reset() does all of it.",
        )
    if high & 0x10:
        if high == SslbpCommand.DOIT >> 8:
            return Words(f"DOIT: exchange process data with {_channels(low)}.")
        return Words(
            "A DOIT with further bits set: it is accepted and never completes.",
            do="Write 0x08FF, wait until COMMAND reads 0, then 0x0800; port.reset() if that fails.",
        )
    simple = {
        SslbpCommand.START_NORMAL >> 8: f"Start {_channels(low)} with process data.",
        SslbpCommand.START_SETUP >> 8: f"Start {_channels(low)} in set-up mode.",
        SslbpCommand.STOP >> 8: f"Stop {_channels(low)}." if low else "STOP ALL: stop every channel.",
    }
    if word == SslbpCommand.UNJAM:
        return Words(
            "Stop all eight channels by their bits; completes a hung command, which 0x0800 does not."
        )
    if high in simple:
        return Words(simple[high])
    if high & 0x20:
        verb = "Write" if word & 0x8000 else "Read"
        return Words(f"{verb} the firmware's variable at 0x{word & 0xFFF:03X}; the byte is in DATA.")
    return Words("No such command: it ends at once and DATA becomes 0xFF.")


def explain_data(word: int) -> Words:
    """A port's DATA register after a command."""
    word &= 0xFFFF
    if word > 0xFF:
        return Words("A word of the processor's program: it is held in reset (COMMAND bit 14).")
    if word == 0:
        return Words("After start or DOIT: no channel failed. After a local read: the byte 0.")
    mask = f"After start or DOIT: {_channels(word)} failed. After a local read: the byte 0x{word:02X}."
    if word == SslbpResult.STOPPED_ALL:
        return Words(f"After STOP ALL, and while the firmware initialises itself: its sign of life. {mask}")
    if word == SslbpResult.INVALID:
        return Words(f"The last command does not exist, or one was written while another was at work. {mask}")
    return Words(mask)


def _channels(mask: int) -> str:
    numbers = [str(number) for number in range(8) if mask >> number & 1]
    if not numbers:
        return "no channel"
    if len(numbers) == 1:
        return f"channel {numbers[0]}"
    return f"channels {', '.join(numbers[:-1])} and {numbers[-1]}"
