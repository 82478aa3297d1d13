"""LBP commands as bytes: headers, sizes, checksum. Pure. Source: lbp_serial.md 2, 3; sserial.md 4."""

from __future__ import annotations

from dataclasses import dataclass

from hostmot2.registers import LbpCommand, LbpHeader, LbpKind, LbpRpc

SIZES = (1, 2, 4, 8)
POLYNOMIAL = 0x8C

_ACCESS = LbpHeader.access


def _crc_table() -> bytes:
    table = []
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (POLYNOMIAL if value & 1 else 0)
        table.append(value)
    return bytes(table)


_CRC = _crc_table()


def crc8(data: bytes) -> int:
    """CRC-8/MAXIM-DOW. 0 over data with its own CRC, and over nothing."""
    crc = 0
    for byte in data:
        crc = _CRC[crc ^ byte]
    return crc


@dataclass(frozen=True, slots=True)
class Command:
    """One LBP command without its CRC, and how many bytes answer it (0: an acknowledge)."""

    data: bytes
    reply: int = 0

    def __str__(self) -> str:
        return self.data.hex(" ").upper()


def data_header(size: int, *, write: bool, address: bool, increment: bool) -> int:
    """First byte of a read or write. ValueError for a size other than 1, 2, 4, 8."""
    if size not in SIZES:
        raise ValueError(f"size {size} is not 1, 2, 4 or 8")
    return (
        _ACCESS.kind.put(LbpKind.DATA)
        | _ACCESS.write.put(write)
        | _ACCESS.increment.put(increment)
        | _ACCESS.address.put(address)
        | _ACCESS.size.put(SIZES.index(size))
    )


def _address(address: int | None, size: int) -> bytes:
    if address is None:
        return b""
    if not 0 <= address <= 0x10000 - size:
        raise ValueError(f"address {address:#x} is outside the remote's 64 KiB")
    return address.to_bytes(2, "little")


def read(address: int | None, size: int, *, increment: bool = False) -> Command:
    """Read `size` bytes at an address, or where the remote's pointer is (None)."""
    header = data_header(size, write=False, address=address is not None, increment=increment)
    return Command(bytes([header]) + _address(address, size), size)


def write(address: int | None, data: bytes, *, increment: bool = False) -> Command:
    """Write 1, 2, 4 or 8 bytes at an address, or where the remote's pointer is (None)."""
    header = data_header(len(data), write=True, address=address is not None, increment=increment)
    return Command(bytes([header]) + _address(address, len(data)) + data)


def read_local(number: int) -> Command:
    """Read local register 0..0x1F."""
    if not 0 <= number <= 0x1F:
        raise ValueError(f"local register {number:#x} is outside 0..0x1F")
    return Command(bytes([LbpCommand.READ_LOCAL | number]), 1)


def write_local(number: int, value: int) -> Command:
    """Write a byte to local register 0..0x1E. (0x1F is the parser reset, which has no data.)"""
    if not 0 <= number <= 0x1E:
        raise ValueError(f"local register {number:#x} is outside 0..0x1E")
    return Command(bytes([LbpCommand.WRITE_LOCAL | number, value]))


def rpc(number: int, data: bytes = b"", reply: int = 0) -> Command:
    """Run stored RPC 0..0x3F with the bytes its writes take from the stream; reply: bytes its reads give."""
    if not 0 <= number <= 0x3F:
        raise ValueError(f"RPC {number} is outside 0..63")
    return Command(bytes([LbpKind.RPC << 6 | number]) + data, reply)


COOKIE = Command(bytes([LbpCommand.READ_COOKIE]), 1)
DISCOVERY = Command(bytes([LbpRpc.DISCOVERY]), 6)
UNIT_NUMBER = Command(bytes([LbpRpc.UNIT_NUMBER]), 4)
RESET_PARSER = bytes([LbpCommand.RESET_PARSER])


def process_data(outputs: bytes, reply: int) -> Command:
    """Exchange process data; reply: bytes the remote answers with, its fault byte included."""
    return Command(bytes([LbpRpc.PROCESS_DATA]) + outputs, reply)


@dataclass(frozen=True, slots=True)
class RpcStep:
    """One access of a stored RPC. data None: a read, or a write whose bytes come with the call."""

    command: Command
    write: bool
    data: bytes | None = None


def rpc_read(address: int | None, size: int, *, increment: bool = False) -> RpcStep:
    """A read for a stored RPC."""
    return RpcStep(read(address, size, increment=increment), write=False)


def rpc_write(
    address: int | None, size: int, data: bytes | None = None, *, increment: bool = False
) -> RpcStep:
    """A write for a stored RPC; data None: its `size` bytes come with the call."""
    if data is not None and len(data) != size:
        raise ValueError(f"{len(data)} bytes are not {size}")
    header = data_header(size, write=True, address=address is not None, increment=increment)
    header |= _ACCESS.rpc_data.put(data is not None)
    return RpcStep(Command(bytes([header]) + _address(address, size) + (data or b"")), True, data)


def rpc_list(steps: list[RpcStep]) -> bytes:
    """The list as it lies in the RPC table, with its end mark."""
    return b"".join(step.command.data for step in steps) + bytes([LbpCommand.END])


def rpc_sizes(steps: list[RpcStep]) -> tuple[int, int]:
    """Bytes a call takes, and bytes it answers."""
    taken = sum(
        SIZES[step.command.data[0] & _ACCESS.size.mask] for step in steps if step.write and step.data is None
    )
    return taken, sum(step.command.reply for step in steps)
