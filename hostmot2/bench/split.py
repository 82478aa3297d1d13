"""A DOIT split into host, bus, wire and firmware time, beside the computed floor of its channels."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median
from typing import Any

from hostmot2._core import ffi, lib
from hostmot2.board import Board
from hostmot2.errors import check, new_error
from hostmot2.histogram import PERCENTILES, Histogram
from hostmot2.registers import Sserial
from hostmot2.sserial import SserialPort

CHARACTER_US = 4.0  # 10 bits at 2.5 Mbaud (fact sheet sserial.md 10)
PCI_READ_US, PCI_WRITE_US = 1.0, 0.2  # one register, as in the literature (performance.md 6)
PROBES = 200

TITLE = (
    "a DOIT from Python, us: medians of its parts; the floor is the wire's and, of a PCI card, bus and wire"
)
COLUMNS = ("p50", "p99", "p99.9", "max", "host", "bus", "wire", "firmware", "floor", "PCI floor")
NOTE = (
    "host: the call but for what follows; bus: the words moved, at what the same words take by themselves; "
    "wire: characters of the longest channel at 4 us; firmware: the rest, with the remote's turnaround and, "
    f"on an emulated card, its own work; floor: wire, and bus at {PCI_READ_US:g} us a read, "
    f"{PCI_WRITE_US:g} us a write"
)


@dataclass(frozen=True, slots=True)
class Parts:
    """Medians in us; the first four are of the whole."""

    p50: float
    p99: float
    p99_9: float
    maximum: float
    host: float
    bus: float
    wire: float
    firmware: float
    floor: float
    pci_floor: float

    def cells(self) -> list[float | None]:
        """In the order of COLUMNS."""
        whole = [self.p50, self.p99, self.p99_9, self.maximum]
        return [*whole, self.host, self.bus, self.wire, self.firmware, self.floor, self.pci_floor]


def wire_us(port: SserialPort, mask: int) -> float:
    """Time on the line of the longest channel: command, data and CRC out, fault byte, data and CRC back."""
    described = [channel.description for channel in port.channels if mask >> channel.number & 1]
    sizes = [1 + each.transmit_size + 1 + each.receive_size + 1 for each in described if each]
    return CHARACTER_US * max(sizes, default=0)


def words_of(port: SserialPort, mask: int) -> tuple[int, int]:
    """Registers that an exchange reads and writes: COMMAND, DATA, CS and inputs; outputs and COMMAND."""
    layouts = {n: layout for n, layout in port.process_data.layouts.items() if mask >> n & 1}
    inputs = sum((layout.input_bits + 31) // 32 for layout in layouts.values())
    outputs = sum((layout.output_bits + 31) // 32 for layout in layouts.values())
    return 2 + len(layouts) + inputs, outputs + 1


def parts(board: Board, mask: int, whole: Histogram, inside: Histogram) -> Parts:
    """Takes apart what was measured. inside: from before DOIT's write to before the look that saw its end."""
    port = board.sserial[0]
    reads, writes = words_of(port, mask)
    read_us, write_us = _accesses_us(board, port, reads, writes)
    p50, p99, p99_9 = (whole.percentile(percent) / 1000 for percent in PERCENTILES)
    waited, wire = inside.percentile(50) / 1000, wire_us(port, mask)
    return Parts(
        p50=p50,
        p99=p99,
        p99_9=p99_9,
        maximum=whole.maximum / 1000,
        host=max(p50 - waited - read_us, 0.0),
        bus=read_us + write_us,
        wire=wire,
        firmware=max(waited - write_us - wire, 0.0),
        floor=wire,
        pci_floor=wire + reads * PCI_READ_US + writes * PCI_WRITE_US,
    )


def _accesses_us(board: Board, port: SserialPort, reads: int, writes: int) -> tuple[float, float]:
    """What as many words take, read and written as an exchange moves them.

    DATA is read; the first output word is written as it is, and goes nowhere before the next DOIT.
    """
    data = port.register_address(Sserial.data.number)
    user = port.register_address(Sserial.user0.number)
    return _exchange_us(board, data, reads, False), _exchange_us(board, user, writes, True)


def _exchange_us(board: Board, address: int, count: int, write: bool) -> float:
    flags = lib.HM2_TRANSFER_WRITE if write else lib.HM2_TRANSFER_READ
    words: Any = ffi.new("uint32_t[]", [board.read(address)] * count)
    transfers: Any = ffi.new("hm2_transfer[]", count)
    for index in range(count):
        transfers[index] = (address, 1, flags, words + index)
    times, error = ffi.new("uint64_t[]", PROBES), new_error()
    with board.lock:
        check(lib.hm2_floor_exchanges(board.handle, transfers, count, PROBES, times, error), error)
    return float(median(times)) / 1000
