"""EmulatedRemote: an LBP remote at the end of a smart-serial line, for people who write tests.

Source of its behaviour: fact sheets sserial.md 4 and 7, SSLBP observed (the stand-in remotes of the
recordings). Not thread-safe: use a remote from the thread that advances its board.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from hostmot2._core import ffi, lib
from hostmot2.handles import own

MODELS = {None: lib.HM2_REMOTE_GENERIC, "8i20": lib.HM2_REMOTE_8I20, "7i64": lib.HM2_REMOTE_7I64}
"""Remotes that predate discovery have a process answer of their own and no BB RPC."""

RAM, EEPROM, FLASH = 0, 1, 2
"""Memory spaces, as selected by LBP local register 0xEC."""

PICOSECONDS = 1_000_000
"""Picoseconds in a microsecond."""


class RemoteWrite(NamedTuple):
    """One LBP data write that reached a remote's memory."""

    address: int
    data: bytes
    space: int = RAM
    time_us: float = 0.0


def _knob(number: int, doc: str) -> Any:
    """A property that is one number of the C remote."""

    def get(self: EmulatedRemote) -> int:
        return self._get(number)

    def put(self: EmulatedRemote, value: int) -> None:
        self._set(number, value)

    return property(get, put, doc=doc)


def _flag(number: int, doc: str) -> Any:
    """A property that is one yes or no of the C remote."""

    def get(self: EmulatedRemote) -> bool:
        return bool(self._get(number))

    def put(self: EmulatedRemote, value: bool) -> None:
        self._set(number, 1 if value else 0)

    return property(get, put, doc=doc)


class EmulatedRemote:
    """A stand-in remote: alive, without watchdog or fault, taking any software mode.

    Args:
        name: card name, up to four ASCII characters.
        unit_number: 32 bits.
        receive_size: bytes the remote answers to the process-data RPC, 1..255, **the fault byte
            included** (but for the models below, which have none).
        transmit_size: bytes the host sends with the process-data RPC, 0..255.
        ptoc, gtoc: what the discovery RPC answers.
        memory: byte address -> byte; every other address of the 64 KiB reads 0. A `bytes` starts at 0.
        eeprom: the same for memory space 1 (at most 4096 bytes); without it space 1 is the memory
            at address + 0x400.
        turnaround_us: middle of the command's last stop bit to the start bit of the answer.
        model: "8i20" or "7i64" for the two that predate discovery (receive_size 8, transmit_size 4,
            no discovery RPC), else None.

    Raises:
        ValueError: a number outside its range, an unknown model, a name longer than four characters.
    """

    def __init__(
        self,
        name: str = "TEST",
        unit_number: int = 0,
        receive_size: int | None = None,
        transmit_size: int | None = None,
        ptoc: int = 0,
        gtoc: int = 0,
        memory: Mapping[int, int] | bytes = b"",
        *,
        eeprom: Mapping[int, int] | bytes | None = None,
        turnaround_us: float = 3.0,
        model: str | None = None,
    ) -> None:
        if model not in MODELS:
            raise ValueError(f"model {model!r}: not one of {', '.join(repr(known) for known in MODELS)}")
        handle = lib.hm2_remote_new()
        if handle == ffi.NULL:
            raise MemoryError("emulated remote")
        self._remote, self._kept = own(handle, lib.hm2_remote_free)
        self._card: Any = None
        self.model = model
        old = model is not None
        self.name = name
        self.unit_number = unit_number
        self._set(lib.HM2_REMOTE_MODEL, MODELS[model])
        self.receive_size = receive_size if receive_size is not None else 8 if old else 1
        self.transmit_size = transmit_size if transmit_size is not None else 4 if old else 0
        self.ptoc = ptoc
        self.gtoc = gtoc
        self.answers_discovery = not old
        self.turnaround_us = turnaround_us
        self._load(memory)
        if eeprom is not None:
            self._check(lib.hm2_remote_add_eeprom(self._remote, lib.HM2_REMOTE_EEPROM_MAX))
            for address, value in _items(eeprom):
                self.poke(address, bytes([value]), space=EEPROM)

    # -- the C side

    def _check(self, status: int) -> None:
        if status != lib.HM2_OK:
            raise ValueError(f"emulated remote {self.name}: outside its range")

    def _get(self, knob: int) -> int:
        return int(lib.hm2_remote_get(self._remote, knob))

    def _set(self, knob: int, value: int) -> None:
        if lib.hm2_remote_set(self._remote, knob, value) != lib.HM2_OK:
            raise ValueError(f"emulated remote: {value} is outside its range")

    def _load(self, memory: Mapping[int, int] | bytes) -> None:
        for address, value in _items(memory):
            self._check(lib.hm2_remote_load(self._remote, address, bytes([value]), 1))

    @property
    def handle(self) -> Any:
        """The hm2_remote * for the C emulator; alive as long as this object."""
        return self._remote

    def hangs_on(self, card: Any) -> None:
        """On this hm2_emulator *, which it keeps alive, or None: `peek`, `poke` and its host take turns."""
        self._card = card

    # -- what it is

    @property
    def name(self) -> str:
        """Card name, four characters at most; local registers 0xD0..0xD3."""
        return self._get(lib.HM2_REMOTE_NAME).to_bytes(4, "little").rstrip(b"\0").decode("latin-1")

    @name.setter
    def name(self, name: str) -> None:
        characters = name.encode("latin-1")
        if len(characters) > 4:
            raise ValueError(f"name {name!r} has more than four characters")
        self._set(lib.HM2_REMOTE_NAME, int.from_bytes(characters.ljust(4, b"\0"), "little"))

    unit_number = _knob(lib.HM2_REMOTE_UNIT, "Unit number, 32 bits (RPC 0xBC).")
    receive_size = _knob(lib.HM2_REMOTE_RECEIVE_SIZE, "Bytes of a process answer, 1..255.")
    transmit_size = _knob(lib.HM2_REMOTE_TRANSMIT_SIZE, "Bytes the host sends, 0..255.")
    ptoc = _knob(lib.HM2_REMOTE_PTOC, "Address of the process data table of contents (RPC 0xBB).")
    gtoc = _knob(lib.HM2_REMOTE_GTOC, "Address of the global table of contents (RPC 0xBB).")
    revision = _knob(lib.HM2_REMOTE_REVISION, "Software revision (local register 0xD5).")
    hardware_mode = _knob(lib.HM2_REMOTE_HARDWARE_MODE, "Hardware mode (local register 0xD6).")
    software_mode = _knob(lib.HM2_REMOTE_SOFTWARE_MODE, "Software mode last received (0xE6).")

    # -- process data

    @property
    def inputs(self) -> bytes:
        """What the remote sends: the process answer without the fault byte.

        An 8I20 or 7I64 has no fault byte: all of its answer. Set before it is sent; bytes that are
        missing are sent as 0.
        """
        buffer = ffi.new("uint8_t[]", lib.HM2_REMOTE_DATA_MAX)
        length = lib.hm2_remote_inputs(self._remote, buffer, lib.HM2_REMOTE_DATA_MAX)
        return bytes(ffi.buffer(buffer, length))

    @inputs.setter
    def inputs(self, data: bytes) -> None:
        data = bytes(data)
        self._check(lib.hm2_remote_set_inputs(self._remote, data, len(data)))

    @property
    def outputs(self) -> bytes:
        """The process data last received, `transmit_size` bytes; zeros before that."""
        buffer = ffi.new("uint8_t[]", lib.HM2_REMOTE_DATA_MAX)
        length = lib.hm2_remote_outputs(self._remote, buffer, lib.HM2_REMOTE_DATA_MAX)
        return bytes(ffi.buffer(buffer, length))

    # -- memory

    def peek(self, address: int, size: int = 1, *, space: int = RAM) -> bytes:
        """Read the remote's memory from the inside: no line, no access rights.

        Raises ValueError where there is no such memory.
        """
        buffer = ffi.new("uint8_t[]", max(size, 1))
        card, remote = self._card, self._remote
        if card is None:
            self._check(lib.hm2_remote_peek(remote, space, address, buffer, size))
        else:
            self._check(lib.hm2_emulator_peek_remote(card, remote, space, address, buffer, size))
        return bytes(ffi.buffer(buffer, size))

    def poke(self, address: int, data: bytes, *, space: int = RAM) -> None:
        """Write the remote's memory from the inside; not seen in `writes`.

        Raises ValueError where there is no such memory.
        """
        card, remote = self._card, self._remote
        if card is None:
            self._check(lib.hm2_remote_poke(remote, space, address, bytes(data), len(data)))
        else:
            self._check(lib.hm2_emulator_poke_remote(card, remote, space, address, bytes(data), len(data)))

    @property
    def writes(self) -> list[RemoteWrite]:
        """LBP data writes that reached the memory, oldest first.

        The last 4096 are kept; `write_count` tells how many there were.
        """
        entries = ffi.new("hm2_remote_write[]", lib.HM2_REMOTE_WRITES_KEPT)
        count = ffi.new("size_t *")
        lib.hm2_remote_writes(self._remote, entries, lib.HM2_REMOTE_WRITES_KEPT, count)
        return [
            RemoteWrite(e.address, bytes(e.data[0 : e.size]), e.space, e.time_ps / PICOSECONDS)
            for e in entries[0 : count[0]]
        ]

    @property
    def write_count(self) -> int:
        """How many writes there were since the last `clear_writes`."""
        count = ffi.new("size_t *")
        return int(lib.hm2_remote_writes(self._remote, ffi.NULL, 0, count))

    def clear_writes(self) -> None:
        """Forget `writes`."""
        lib.hm2_remote_clear_writes(self._remote)

    # -- faults of the device

    alive = _flag(lib.HM2_REMOTE_ALIVE, "False: powered off or unplugged; neither hears nor speaks.")
    fault = _knob(lib.HM2_REMOTE_FAULT, "Fault byte, first of every process answer (not 8I20, 7I64).")
    fault_clears = _flag(lib.HM2_REMOTE_FAULT_CLEARS, "False: clearing faults does not help.")
    clear_flag_busy_reads = _knob(
        lib.HM2_REMOTE_CLEAR_BUSY_READS, "So many more reads of the clear-faults flag find it busy."
    )
    fault_word = _knob(lib.HM2_REMOTE_FAULT_WORD, "8I20: FAULT, the word at 0x0852.")
    fault_word_on_enable = _knob(
        lib.HM2_REMOTE_FAULT_WORD_ON_ENABLE, "8I20: what enabling puts into `fault_word`; 0: nothing."
    )
    enable_input = _flag(
        lib.HM2_REMOTE_ENABLE_INPUT, "8I20 of the catalogue: its external enable input is driven."
    )
    fault_output = _flag(
        lib.HM2_REMOTE_FAULT_OUTPUT, "8I20: its fault output, True without an unmasked fault."
    )
    pid_off_reads = _knob(
        lib.HM2_REMOTE_PID_OFF_READS, "8I20: so many more reads of PIDON, the word at 0x08FE, give 0."
    )
    answers_unit_number = _flag(lib.HM2_REMOTE_ANSWERS_UNIT, "False: silent on RPC 0xBC.")
    answers_discovery = _flag(lib.HM2_REMOTE_ANSWERS_DISCOVERY, "False: silent on RPC 0xBB.")
    cookie = _knob(lib.HM2_REMOTE_COOKIE, "What a cookie read gives; 0x5A is right.")
    bad_cookies = _knob(lib.HM2_REMOTE_BAD_COOKIES, "So many more cookie reads give 0x55.")
    lbp_status = _knob(lib.HM2_REMOTE_STATUS, "LBP status (local register 0xC1).")
    crc_errors = _knob(lib.HM2_REMOTE_CRC_ERRORS, "CRC errors seen, up to 255 (local register 0xC3).")

    # -- faults of the line

    crc = _flag(lib.HM2_REMOTE_CRC, "False: no CRC byte either way, and no answer without data.")
    baud = _knob(lib.HM2_REMOTE_BAUD, "Bits per second; a master off by more than 4 % is not heard.")
    timeout_bits = _knob(lib.HM2_REMOTE_TIMEOUT_BITS, "Bit times of silence that end a frame (0xEB).")

    @property
    def turnaround_us(self) -> float:
        """Middle of the command's last stop bit to the start of the answer, microseconds."""
        return self._get(lib.HM2_REMOTE_TURNAROUND_PS) / PICOSECONDS

    @turnaround_us.setter
    def turnaround_us(self, microseconds: float) -> None:
        self._set(lib.HM2_REMOTE_TURNAROUND_PS, round(microseconds * PICOSECONDS))

    def inject(
        self,
        *,
        bad_crc: int | None = None,
        truncate: int | None = None,
        extra: int | None = None,
        framing_break: int | None = None,
        skip: int | None = None,
    ) -> None:
        """Spoil coming answers; what is not named stays as it is, 0 takes an injection back.

        Args:
            bad_crc: so many answers have an inverted CRC.
            truncate: so many bytes are missing at the end of the next answer.
            extra: so many surplus bytes follow the next answer back to back, 0..32.
            framing_break: so many answers have a low stop bit on their last byte.
            skip: so many frames are obeyed but not answered.
        """
        for knob, value in (
            (lib.HM2_REMOTE_INJECT_BAD_CRC, bad_crc),
            (lib.HM2_REMOTE_INJECT_TRUNCATE, truncate),
            (lib.HM2_REMOTE_INJECT_EXTRA, extra),
            (lib.HM2_REMOTE_INJECT_BREAK, framing_break),
            (lib.HM2_REMOTE_INJECT_SKIP, skip),
        ):
            if value is not None:
                self._set(knob, value)

    def exchange(self, frame: bytes) -> bytes:
        """Hand over one whole frame with its CRC and get the answer with its CRC; b"" is silence.

        No time passes on the remote's clock.
        """
        buffer = ffi.new("uint8_t[]", 512)
        length = lib.hm2_remote_exchange(self._remote, bytes(frame), len(frame), buffer, 512)
        return bytes(ffi.buffer(buffer, length))

    def power_cycle(self) -> None:
        """Switch off and on: EEPROM and flash stay, everything else starts afresh."""
        lib.hm2_remote_reset(self._remote)

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} {self.name} unit 0x{self.unit_number:08X}, "
            f"{self.transmit_size} bytes out, {self.receive_size} in>"
        )


def _items(memory: Mapping[int, int] | bytes) -> list[tuple[int, int]]:
    return list(memory.items()) if isinstance(memory, Mapping) else list(enumerate(memory))
