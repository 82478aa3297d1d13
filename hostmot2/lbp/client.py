"""LbpRemote: one remote at the other end of a link: its memory, local registers and RPCs.

Source: lbp_serial.md 2, 3, 5; 8I20 and 7I77 manuals, LBP.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from hostmot2.lbp import frame
from hostmot2.lbp.conversation import Conversation
from hostmot2.lbp.errors import LineSilent, NotLbp, WrongAnswer
from hostmot2.lbp.frame import Command, RpcStep
from hostmot2.lbp.link import NORMAL_S
from hostmot2.register_map import Register
from hostmot2.registers import (
    LbpCapability,
    LbpClearFault,
    LbpCookie,
    LbpLocal,
    LbpReset,
    LbpSpace,
    LbpStatus,
)

EEPROM_S = 1.0
"""A write to EEPROM is answered within this."""

FLASH_S = 5.0
"""Erasing or programming flash is over within this."""

CLEAR_READS = 1000


def _pieces(count: int) -> Iterator[tuple[int, int]]:
    """Offsets and sizes of 8, 4, 2 and 1 bytes that make up `count`."""
    at = 0
    for size in reversed(frame.SIZES):
        while count - at >= size:
            yield at, size
            at += size


@dataclass(frozen=True, slots=True)
class Discovery:
    """What the discovery RPC answers: process data sizes in bytes, and where the tables are."""

    receive_size: int
    transmit_size: int
    ptoc: int
    gtoc: int


class LbpRemote(Conversation):
    """One remote behind a link. Not thread-safe; one program at a time may use a line.

    Opening probes for the cookie, with CRC and without. Raises LineSilent, NotLbp.
    """

    # -- memory

    def read_remote(self, address: int, size: int = 1, *, space: int = LbpSpace.RAM) -> int:
        """A value of 1, 2, 4 or 8 bytes from RAM (0), EEPROM (1) or flash window (2); unsigned.

        Raises RemoteRefused (no such address), LineSilent, WrongAnswer, ValueError for the arguments.
        """
        return int.from_bytes(self.read_bytes(address, size, space=space), "little")

    def write_remote(self, address: int, value: int, size: int = 1, *, space: int = LbpSpace.RAM) -> None:
        """Write a value of 1, 2, 4 or 8 bytes; negative ones as two's complement. Errors as `read_remote`."""
        if not -(1 << 8 * size - 1) <= value < 1 << 8 * size:
            raise ValueError(f"{value} does not fit into {size} bytes")
        self.write_bytes(address, (value & (1 << 8 * size) - 1).to_bytes(size, "little"), space=space)

    def read_bytes(self, address: int, size: int, *, space: int = LbpSpace.RAM) -> bytes:
        """1, 2, 4 or 8 bytes, as `read_remote`."""
        command = frame.read(address, size)

        def operation() -> bytes:
            self._select(space)
            return self._once(command)

        with self._back_to_ram():
            return self._stable(operation)

    def write_bytes(self, address: int, data: bytes, *, space: int = LbpSpace.RAM) -> None:
        """1, 2, 4 or 8 bytes, as `write_remote`."""
        command = frame.write(address, data)
        timeout_s = EEPROM_S if space == LbpSpace.EEPROM else NORMAL_S

        def operation() -> None:
            self._select(space)
            self._once(command, timeout_s)

        with self._back_to_ram():
            self._confirmed(operation)

    def write_block(self, address: int, data: bytes, *, space: int) -> None:
        """Any number of bytes in pieces of 8 and less; confirmed, and repeated, as a whole."""
        pieces = [frame.write(address + at, data[at : at + size]) for at, size in _pieces(len(data))]

        def operation() -> None:
            self._select(space)
            for piece in pieces:
                self._once(piece)

        with self._back_to_ram():
            self._confirmed(operation)

    def sync(self, timeout_s: float = FLASH_S) -> None:
        """Wait until the remote has done what it is at: its cookie comes. Raises LineSilent, NotLbp."""
        if (cookie := self._once(frame.COOKIE, timeout_s)[0]) != LbpCookie.VALUE:
            self._sick = True
            raise NotLbp(f"{self}: cookie {cookie:02X}", expected=LbpCookie.VALUE, received=cookie)

    def commit(self, address: int, code: int, *, space: int) -> None:
        """Write a byte that starts something, once, and wait until it is done.

        For what must not be repeated on its own. Raises LineSilent, WrongAnswer, RemoteRefused.
        """
        try:
            if self._sick or self._space != space:
                raise WrongAnswer(f"{self}: not in memory space {space}")
            self._once(frame.write(address, bytes([code])))
            self.sync()
            misheard = self._misheard()
        except (LineSilent, WrongAnswer, NotLbp):
            self._sick = True
            raise
        if misheard:
            self._sick = True
            raise self._refused(misheard)

    # -- the address pointer

    @property
    def pointer(self) -> int:
        """The remote's address pointer: used by `read_next` and `write_next`."""
        low, high = LbpLocal.address_low.number, LbpLocal.address_high.number
        return self.read_local(low) | self.read_local(high) << 8

    @pointer.setter
    def pointer(self, address: int) -> None:
        if not 0 <= address <= 0xFFFF:
            raise ValueError(f"address {address:#x} is outside the remote's 64 KiB")
        self._confirmed(lambda: self._point(address))

    def _point(self, address: int) -> None:
        self._once(frame.write_local(LbpLocal.address_low.number, address & 0xFF))
        self._once(frame.write_local(LbpLocal.address_high.number, address >> 8))

    def advance_pointer(self, count: int) -> None:
        """Add 0..255 to the pointer."""
        start = self.pointer
        self._moving(start, count, frame.write_local(LbpLocal.version.number, count))

    def read_next(self, size: int = 1) -> bytes:
        """`size` bytes at the pointer, which moves behind them."""
        return self._moving(self.pointer, size, frame.read(None, size, increment=True))

    def write_next(self, data: bytes) -> None:
        """1, 2, 4 or 8 bytes at the pointer, which moves behind them."""
        self._moving(self.pointer, len(data), frame.write(None, data, increment=True))

    def _moving(self, start: int, count: int, command: Command) -> bytes:
        """A command that moves the pointer: repeated from where it stood until it stands where it should."""

        def operation() -> bytes:
            self._point(start)
            answer = self._once(command)
            ends = (LbpLocal.address_low.number, LbpLocal.address_high.number)
            low, high = (self._once(frame.read_local(number))[0] for number in ends)
            if low | high << 8 != (start + count) & 0xFFFF:
                raise WrongAnswer(f"{self}: the pointer stands at 0x{high:02X}{low:02X} after {command}")
            return answer

        return self._stable(operation) if command.reply else self._confirmed(operation)

    # -- local registers

    def read_local(self, number: int | Register) -> int:
        """One local register, 0..255."""
        command = frame.read_local(number if isinstance(number, int) else number.number)
        return self._stable(lambda: self._once(command))[0]

    def write_local(self, number: int | Register, value: int) -> None:
        """Write one local register. ValueError for a value outside 0..255."""
        if not 0 <= value <= 0xFF:
            raise ValueError(f"{value} is outside 0..255")
        command = frame.write_local(number if isinstance(number, int) else number.number, value)
        if command.data[0] & 0x1F == LbpLocal.memory_space.number:
            self._space, self._away = None, True
        self._confirmed(lambda: self._once(command))

    @property
    def name(self) -> str:
        """The card's name, such as "7I77"."""
        if not self._known_name:
            registers = (LbpLocal.name_0, LbpLocal.name_1, LbpLocal.name_2, LbpLocal.name_3)
            characters = bytes(self.read_local(register) for register in registers)
            self._known_name = characters.rstrip(b"\0 ").decode("ascii", "replace")
        return self._known_name

    @property
    def status(self) -> LbpStatus:
        """The LBP status, every bit named; `clear_status` clears it."""
        return LbpStatus(self.read_local(LbpLocal.status))

    def clear_status(self) -> None:
        """Forget the LBP errors, the watchdog's bit too."""
        self.write_local(LbpLocal.status, 0)

    @property
    def capability(self) -> LbpCapability:
        """What the remote can do; 0 where it does not tell."""
        return LbpCapability(self.read_local(LbpLocal.capability))

    @property
    def software_revision(self) -> int:
        """Revision of the remote's firmware (newer remotes; the 8I20 has a parameter SWREVISION)."""
        return self.read_local(LbpLocal.software_revision)

    @property
    def fault(self) -> int:
        """The remote's fault byte (not 8I20, 7I64)."""
        return self.read_local(LbpLocal.fault)

    @property
    def software_mode(self) -> int:
        """The process data mode; set it before `discovery`."""
        return self.read_local(LbpLocal.software_mode)

    @software_mode.setter
    def software_mode(self, mode: int) -> None:
        self.write_local(LbpLocal.software_mode, mode)

    @property
    def crc_errors(self) -> int:
        """Commands with a wrong CRC that the remote has seen, up to 255."""
        return self.read_local(LbpLocal.crc_errors)

    @property
    def lbp_version(self) -> int:
        """Version of LBP."""
        return self.read_local(LbpLocal.version)

    def clear_faults(self) -> None:
        """Clear the remote's faults and wait until that is done. Raises WrongAnswer if it never is."""
        self.write_local(LbpLocal.clear_fault, LbpClearFault.SET)
        for _ in range(CLEAR_READS):
            if self.read_local(LbpLocal.clear_fault) == 0:
                return
        raise WrongAnswer(f"{self}: the clear-faults flag stays set")

    def reset_processor(self) -> None:
        """Restart the remote's firmware. It does not answer that; its parameters are as after power-up."""
        with suppress(LineSilent, WrongAnswer):
            self._once(frame.write_local(LbpLocal.rpc_size_high.number, LbpReset.KEY))
        self._space, self._sick, self._known_name = None, True, ""

    # -- RPCs

    @property
    def unit_number(self) -> int:
        """The remote's unit number, 32 bits."""
        return int.from_bytes(self._stable(lambda: self._once(frame.UNIT_NUMBER)), "little")

    def discovery(self) -> Discovery:
        """Sizes and tables. 8I20 and 7I64, which predate it, refuse (RemoteRefused or LineSilent)."""
        found = self._stable(lambda: self._once(frame.DISCOVERY))
        pointers = int.from_bytes(found[2:4], "little"), int.from_bytes(found[4:6], "little")
        return Discovery(found[0], found[1], *pointers)

    @property
    def rpc_pitch(self) -> int:
        """Bytes from one RPC's place in the table to the next one's."""
        return self.read_local(LbpLocal.rpc_pitch)

    @property
    def rpc_size(self) -> int:
        """Bytes of the RPC table."""
        return self.read_local(LbpLocal.rpc_size_low) | self.read_local(LbpLocal.rpc_size_high) << 8

    @contextmanager
    def rpc_table(self) -> Iterator[None]:
        """While open, data accesses go to the RPC table instead of RAM, and no RPC runs."""
        self.write_local(LbpLocal.rpc_memory_access, 1)
        try:
            yield
        finally:
            self.write_local(LbpLocal.rpc_memory_access, 0)

    def store_rpc(self, number: int, steps: list[RpcStep]) -> None:
        """Write a list of accesses into the table as RPC `number`, 0..63, and read it back.

        Raises ValueError where it does not fit, WrongAnswer if it reads back differently.
        """
        frame.rpc(number)
        listed = frame.rpc_list(steps)
        start = number * self.rpc_pitch
        if start + len(listed) > self.rpc_size:
            raise ValueError(f"RPC {number} of {len(listed)} bytes runs over the table's {self.rpc_size}")
        with self.rpc_table():
            for offset, byte in enumerate(listed):
                self.write_bytes(start + offset, bytes([byte]))
            back = bytes(self.read_remote(start + offset) for offset in range(len(listed)))
        if back != listed:
            raise WrongAnswer(f"{self}: RPC {number} was written as {listed.hex(' ')}, reads {back.hex(' ')}")

    def run_rpc(self, number: int, data: bytes = b"", reply: int = 0) -> bytes:
        """Run a stored RPC once: its accesses may have effects, so it is never repeated.

        data: what its writes take from the stream; reply: bytes its reads answer. Errors as `read_remote`.
        """
        if self._sick:
            self._confirmed(lambda: None)
        try:
            answer = self._once(frame.rpc(number, data, reply))
            misheard = self._misheard()
        except (LineSilent, WrongAnswer) as failure:
            self._sick = True
            if refusal := self._ask_why():
                raise self._refused(refusal) from failure
            raise
        if misheard:
            self._sick = True
            raise self._refused(misheard)
        return answer

    def process_data(self, outputs: bytes, reply: int) -> bytes:
        """Exchange process data once. reply: bytes of the answer, the fault byte included."""
        if self._sick:
            self._confirmed(lambda: None)
        try:
            return self._once(frame.process_data(outputs, reply))
        except (LineSilent, WrongAnswer):
            self._sick = True
            raise

    @property
    def label(self) -> str:
        """Which remote, in a few words."""
        return str(self)
