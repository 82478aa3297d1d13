"""What a card is known to answer, for recording dialogues: registers and memories from sheets and recordings.

Nothing here computes: a word is what a source says, or what the driver itself wrote there, or 0. Sources are
named in tests/golden/udp/README.md.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path

from lbp16_reference import Command, parse
from sserial.recorded import BASE, INSTANCE, NAMES, REGISTER, Recorded

GOLDEN = Path(__file__).parent / "golden"
HOSTMOT2, EEPROM, FLASH, TIMER, CONTROL, BOARD = 0, 2, 3, 4, 6, 7
KEY_EEPROM = 0x5A02
BRING_UP = "y5_7i77_bringup"

# lbp16.md 7, vectors 3, 4, 8, and the dialogue made from them (golden/lbp16_trace.txt)
_EEPROM_WORDS = bytes.fromhex(
    "00003412101b6000000000000000000037493932000000000000000000000000 0a0a0a0a 00000000 0000 0000 00000000"
)
_BOARD_WORDS = bytes.fromhex("37493932000000000000000000000000 03000f000100 0000")
_FLASH_ID = 0x14
# lbp16.md 6
_BOOT_BLOCK = bytes.fromhex(
    "ffff" * 5 + "aa995566" + "31e1ffff" + "32610000" + "32810b10" + "32a10000" + "32c10b01"
    "30a10000" + "33012100" + "3201001f" + "30a1000e" + "2000" * 7
)


def registers() -> dict[int, int]:
    """Words of the register file as the published HDL gave them, the latest of each recording."""
    words: dict[int, int] = {}
    for name in ("4d_mux_timestamp", "4a_mux_basic", "2_ioport"):
        for line in (GOLDEN / "card" / f"{name}.jsonl").read_text().splitlines():
            event = json.loads(line)
            if event["op"] == "r":
                words[int(event["addr"], 16)] = int(event["value"], 16)
    for line in (GOLDEN / "card" / "idrom_5i25_7i77x2.hex").read_text().splitlines():
        address, word = line.split()
        words[int(address, 16)] = int(word, 16)
    words[0x0D00] = 1  # card_observed 3: the status after configuration
    return words


class Facts:
    """Answers of one card. `answer(request, now_ns)` is what a RecordingPeer asks for."""

    def __init__(self) -> None:
        self.words = registers()
        self.memory = {
            EEPROM: bytearray(_EEPROM_WORDS.ljust(0x80, b"\0")),
            TIMER: bytearray(0x20),
            CONTROL: bytearray(0x20),
            BOARD: bytearray(_BOARD_WORDS.ljust(0x20, b"\0")),
        }
        self.flash_address = 0
        self.sslbp = _bring_up()

    def answer(self, request: bytes, now_ns: int) -> bytes | None:
        """What the reads of a datagram bring; None if there are none."""
        self.sslbp.now_ns = now_ns
        reply = b"".join(self._run(command) for command in parse(request))
        self.memory[CONTROL][0x1A:0x1C] = bytes(2)  # the key is gone with its datagram
        return reply or None

    def _run(self, command: Command) -> bytes:
        assert command.address is not None
        assert not command.info
        step = command.size if command.increment else 0
        places = [command.address + step * i for i in range(command.count)]
        if not command.write:
            return b"".join(self._read(command.space, place) for place in places)
        for i, place in enumerate(places):
            self._write(command.space, place, command.data[i * command.size : (i + 1) * command.size])
        return b""

    def _read(self, space: int, address: int) -> bytes:
        if space == FLASH:
            return struct.pack("<I", self._flash(address))
        if space != HOSTMOT2:
            return bytes(self.memory[space][address : address + 2])
        if BASE <= address < BASE + 0x600:
            row, channel = NAMES[(address - BASE) // REGISTER], address % INSTANCE // 4
            return struct.pack("<I", self.sslbp._read(row, channel))
        return struct.pack("<I", self.words.get(address, 0))

    def _write(self, space: int, address: int, data: bytes) -> None:
        value = int.from_bytes(data, "little")
        if space == FLASH:
            assert address == 0, "only the address is written"
            self.flash_address = value
        elif space == EEPROM:
            assert int.from_bytes(self.memory[CONTROL][0x1A:0x1C], "little") == KEY_EEPROM, "no key"
            self.memory[EEPROM][address : address + 2] = data
        elif space != HOSTMOT2:
            self.memory[space][address : address + 2] = data
        elif BASE <= address < BASE + 0x600:
            self.sslbp._write(NAMES[(address - BASE) // REGISTER], address % INSTANCE // 4, value)
        elif address == 0x0D00:  # card_observed 3: bit 0 alone is kept, cleared by writing 0 to it
            self.words[address] = value & 1

    def _flash(self, address: int) -> int:
        if address == 8:
            return _FLASH_ID
        assert address == 4
        block = _BOOT_BLOCK if self.flash_address < len(_BOOT_BLOCK) else b""
        word = block[self.flash_address : self.flash_address + 4] or b"\xff\xff\xff\xff"  # erased
        self.flash_address += 4
        return int.from_bytes(word, "little")


def _bring_up() -> Recorded:
    """The real firmware's bring-up of a 7I77: reset, then from its normal start on.

    Its registers were read behind the last DOIT only; they are shown behind each.
    """
    recorded = Recorded(BRING_UP)
    start = next(i for i, step in enumerate(recorded.steps) if step.command == 0x0903)
    before = [i for i in range(start) if recorded.steps[i].command in (0x4000, 0x0001, 0x0800)][:3]
    last = recorded.steps[-1].reads
    for step in recorded.steps[start + 1 :]:
        step.reads = last
    recorded.steps = [recorded.steps[i] for i in before] + recorded.steps[start:]
    local = {
        step.command & 0xFFF: step.data for step in Recorded("a_reset_local").steps if step.command >> 12 == 2
    }
    recorded.locals = {**{k: v for k, v in local.items() if v is not None}, **recorded.locals}
    return recorded
