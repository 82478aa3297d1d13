"""Made-up FPGA images in the published file formats."""

from __future__ import annotations

import random
import struct


def payload(size: int, seed: int = 1) -> bytes:
    return b"\xff" * 16 + b"\xaa\x99\x55\x66" + random.Random(seed).randbytes(size - 20)


def field(tag: str, text: str) -> bytes:
    data = text.encode() + b"\0"
    return tag.encode() + struct.pack(">H", len(data)) + data


def xilinx(data: bytes, part: str = "6slx9tqg144", fields: str = "abcd") -> bytes:
    texts = {"a": "made_up.ncd;UserID=0xFFFFFFFF", "b": part, "c": "2026/11/22", "d": "12:34:56"}
    head = bytes.fromhex("00090ff00ff00ff00ff0000001") + b"".join(field(tag, texts[tag]) for tag in fields)
    return head + b"e" + struct.pack(">I", len(data)) + data


def efinix(data: bytes, part: str = "T20F256") -> bytes:
    lines = [
        "Version: 2021.2.323", "Date: 2026-11-22 12:34", "Project: made_up", "/nowhere/made_up.xml",
        "Family: Trion", f"Device: {part} C4", "Width: 1", "Mode: active", "Padded Bits: 1000",
    ]  # fmt: skip
    return "\n".join(lines).encode() + b"\n" + data
