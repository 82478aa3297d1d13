"""The stand-in remotes of the recordings, built and steered as their `set` lines say."""

import json
from pathlib import Path
from typing import Any

from hostmot2.emulator import EmulatedRemote

GOLDEN = Path(__file__).parent / "golden" / "sserial"
SECOND_SET = ("s1_8i20_run", "w1_counters", "y5_7i77_bringup")
MODELS = {0: None, 1: "8i20", 2: "7i64"}


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def image(recording: str) -> dict[int, int]:
    name = "remote_image2.json" if recording in SECOND_SET else "remote_image.json"
    memory = json.loads((GOLDEN / name).read_text())["mem"]
    return {int(address, 16): value for address, value in memory.items()}


def stand_in(recording: str, channel: int, settings: dict[str, Any]) -> EmulatedRemote:
    """The remote that the `set` lines of the first moment describe."""
    first = channel == 0
    offset = settings.get("mem_offset", 0)
    memory = {a - offset: v for a, v in image(recording).items() if a >= offset}
    remote = EmulatedRemote(
        unit_number=settings.get("unit", 0x12345678 if first else 0x0000BEEF),
        ptoc=settings.get("ptoc", 0),
        gtoc=settings.get("gtoc", 0),
        memory=memory,
        turnaround_us=6.0,
        model=MODELS[settings.get("model", 0)],
    )
    remote.name = "7I77" if first else "7I84"
    for knob, value in settings.items():
        steer(remote, knob, value)
    return remote


def steer(remote: EmulatedRemote, knob: str, value: Any) -> None:
    """Do to the remote what one `set` line says."""
    plain = {
        "recv_size": "receive_size",
        "xmit_size": "transmit_size",
        "ptoc": "ptoc",
        "gtoc": "gtoc",
        "unit": "unit_number",
        "alive": "alive",
        "fault_byte": "fault",
        "fault_word": "fault_word",
        "fault_word_on_enable": "fault_word_on_enable",
        "clrflag_busy_reads": "clear_flag_busy_reads",
        "pid_off_reads": "pid_off_reads",
        "fault_clear_works": "fault_clears",
        "unit_rpc_present": "answers_unit_number",
        "disc_rpc_present": "answers_discovery",
        "cookie": "cookie",
        "bad_cookies": "bad_cookies",
    }
    injected = {
        "bad_crc_replies": "bad_crc",
        "skip_replies": "skip",
        "extra_bytes_once": "extra",
        "short_bytes_once": "truncate",
        "break_once": "framing_break",
    }
    if knob in plain:
        setattr(remote, plain[knob], value)
    elif knob in injected:
        remote.inject(**{injected[knob]: value})
    elif knob == "input_bytes":
        remote.inputs = bytes(int(byte, 16) for byte in value)
    elif knob == "reply_delay_ns":
        remote.turnaround_us = value / 1000
    elif knob == "name_le":
        remote.name = value.to_bytes(4, "little").decode("ascii")
    elif knob == "no_crc":
        remote.crc = not value
    elif knob == "bit_ns":
        remote.baud = round(1e9 / value)
    elif knob not in ("model", "mem_offset"):
        raise ValueError(f"unknown knob {knob}")
