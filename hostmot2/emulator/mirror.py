"""An emulated card in one process, a driver in another, shared memory between them: pci:///dev/shm/card.

`python -m hostmot2.emulator.mirror 5i25+7i77 /dev/shm/card` serves a card until it gets SIGINT or SIGTERM; it
prints `ready PATH` when the driver may come.

What a mirror cannot do, because loads and stores of another process cannot be intercepted:

* A write is noticed at the next look, some 70 microseconds later, and only if the word differs from
  what the card shows there. Writing the value that is already shown goes unnoticed; this matters for
  registers that read something else than was written (ioport data, SSERIAL interface data).
* Of several writes to one register between two looks the last one counts. Writes to different registers are
  taken in the order of their addresses, SSERIAL commands last.
* Reading has no side effects: FIFOs do not pop, the DPLL is not sampled. Such registers show UNDRIVEN.
* Times are as exact as the looks are frequent. The driver's limits for SSERIAL commands are fractions of a
  millisecond: on a busy machine, where this process may be kept from looking for longer, it will say that
  commands hang.

The in-process card (emu://) and the Ethernet server have none of these limits.
"""

from __future__ import annotations

import mmap
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.errors import check, new_error
from hostmot2.registers import MODULES, Gtag

SIZE = 0x10000
PAUSE_NS = 10_000
"""Between two looks; the kernel adds some 50,000."""
LOOKS = 500
"""Before looking whether to stop."""
_SSERIAL = (Gtag.SSERIAL, Gtag.SSERIAL_B)
_SSERIAL_CHANNELS = 8


class Mirror:
    """Shows `board` in the file `path` and takes writes from there. One thread calls look() or run()."""

    def __init__(self, board: EmulatedBoard, path: str | Path) -> None:
        self._board = board
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        os.ftruncate(self._file, SIZE)
        self._map = mmap.mmap(self._file, SIZE)
        self._map[:] = bytes(SIZE)
        self._shared = ffi.from_buffer(self._map)
        words = _words(board)
        self._words: Any = ffi.new("hm2_mirror_word[]", words)
        self._seen = ffi.new("uint32_t[]", len(words))
        self._error = new_error()
        self.look()

    def look(self) -> None:
        """Take what the driver has written and show what the card has now."""
        status = lib.hm2_emulator_mirror(
            self._board.handle, self._shared, self._words, self._seen, len(self._words), self._error
        )
        check(status, self._error)

    def run(self, stop: threading.Event) -> None:
        """Look until `stop` is set."""
        while not stop.is_set():
            status = lib.hm2_emulator_mirror_looks(
                self._board.handle, self._shared, self._words, self._seen, len(self._words),
                LOOKS, PAUSE_NS, self._error,
            )  # fmt: skip
            check(status, self._error)

    def close(self) -> None:
        """Let the file go; it stays as it is."""
        ffi.release(self._shared)
        self._map.close()
        os.close(self._file)


def _words(board: EmulatedBoard) -> list[tuple[int, int, int]]:
    """(address, shown, readable) of everything the card decodes, SSERIAL commands last."""
    idrom = _word(board, 0x10C)
    readable = dict.fromkeys([*range(0x100, 0x110, 4), *range(idrom, idrom + 0x400, 4), 0x800], True)
    strides = [_word(board, idrom + 0x30 + 4 * i) for i in range(4)]
    commands: dict[int, bool] = {}
    at = idrom + _word(board, idrom + 4)
    while at + 12 <= SIZE and _word(board, at) & 0xFF:
        for address, register, gtag in _module(board, at, strides):
            is_command = gtag in _SSERIAL and register == 0
            (commands if is_command else readable).setdefault(address, _readable(gtag, register))
        at += 12
    return [(address, 0, int(can)) for address, can in (readable | commands).items()]


def _word(board: EmulatedBoard, address: int) -> int:
    word = board.read(address)
    assert isinstance(word, int)
    return word


def _module(board: EmulatedBoard, at: int, strides: list[int]) -> Iterator[tuple[int, int, int]]:
    """(address, register number, gtag) of every word of a module; strides: instance 0, 1, register 0, 1."""
    function, location, multiple = (_word(board, at + 4 * i) for i in range(3))
    gtag, instances = function & 0xFF, function >> 24
    base, registers = location & 0xFFFF, location >> 16 & 0xFF
    register_stride, instance_stride = strides[2 + (location >> 24 & 1)], strides[location >> 28 & 1]
    for register in range(registers):
        repeats = gtag in _SSERIAL or multiple >> register & 1
        channels = _SSERIAL_CHANNELS if gtag in _SSERIAL and register >= 2 else 1
        for instance in range(instances if repeats else 1):
            for channel in range(channels):
                address = base + register * register_stride + instance * instance_stride + 4 * channel
                if address < SIZE:
                    yield address, register, gtag


def _readable(gtag: int, number: int) -> bool:
    registers = MODULES[gtag].by_number().get(number, ()) if gtag in MODULES else ()
    return any(register.readable and not register.read_effect for register in registers)


def main(arguments: list[str]) -> int:
    """Serve the card `arguments[0]` in the file `arguments[1]`."""
    spec, path = arguments
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    mirror = Mirror(EmulatedBoard(spec, clock="real"), path)
    print(f"ready {path}", flush=True)
    mirror.run(stop)
    mirror.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
