"""UARTs: transmitter and receiver of one number together. Source: fact sheet registers 2.12."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, overload

from hostmot2 import errors
from hostmot2.board import SafeOff
from hostmot2.modules.instances import ModuleAccess, whole
from hostmot2.registers import Gtag, UartRx, UartTx

if TYPE_CHECKING:
    from hostmot2.board import Board

_FIFO = 16
"""Entries of a transmitter, bytes of a receiver."""
_WORD = 4
_BITS_PER_BYTE = 10
_WORST_BAUD = 0.02


def dds_rate(baud: float, clock: int, bits: int, width: int) -> int:
    """The rate register for `baud`: baud * 2^bits / clock in `width` bits. Raises ValueError if 2 % off."""
    rate = whole(baud * 2**bits / clock)
    if not 1 <= rate < 1 << width or abs(rate * clock / 2**bits / baud - 1) > _WORST_BAUD:
        raise ValueError(f"{baud} baud cannot be made from {clock} Hz")
    return rate


class Uart:
    """One UART, 8 data bits, no parity, one stop bit. Call `setup` first."""

    def __init__(self, uarts: Uarts, index: int) -> None:
        self._tx, self._rx, self._board = uarts.tx, uarts.rx, uarts.board
        self.index = index
        self._rate = self._tx_mode = self._rx_mode = 0

    def setup(
        self, baud: float, *, drive_delay: int = 0, auto_drive: bool = True, half_duplex: bool = False
    ) -> None:
        """Set the speed, clear both FIFOs and switch the pins.

        drive_delay: clocks from the drive enable to the first byte, 0 to 15. auto_drive: the driver is
        enabled only while something is sent, else always. half_duplex: the receiver is deaf meanwhile. Raises
        ValueError.
        """
        mode = UartTx.mode
        rate = dds_rate(baud, self._tx.clock, 20, UartTx.bit_rate.rate.width)
        tx_mode = mode.drive_delay.put(drive_delay)
        tx_mode |= mode.drive_auto.mask if auto_drive else mode.drive_enable.mask
        rx_mode = UartRx.mode.mask_enable.put(half_duplex)
        self._rate, self._tx_mode, self._rx_mode = rate, tx_mode, rx_mode
        self.configure()
        self._tx.drive(self.index, f"uart {self.index}")
        if self._rx:
            self._board.ioport.claim(self._rx.pins(self.index), f"uart {self.index}")

    @property
    def is_set_up(self) -> bool:
        """Whether setup has been called."""
        return self._rate != 0

    @property
    def baud(self) -> float:
        """Bits per second as the hardware makes them; 0 before setup."""
        return self._rate * self._tx.clock / 2**20

    def configure(self) -> None:
        """Write rates and modes, the FIFOs cleared in between."""
        if not self.is_set_up:
            return
        self._tx.write(UartTx.bit_rate.number, self._rate, self.index)
        if self._rx:
            self._rx.write(UartRx.bit_rate.number, self._rate, self.index)
            self._rx.write(UartRx.mode.number, 0, self.index)
            self._rx.write(UartRx.count.number, 0, self.index)
        self._tx.write(UartTx.count.number, 0, self.index)
        self._tx.write(UartTx.mode.number, self._tx_mode, self.index)
        if self._rx:
            self._rx.write(UartRx.mode.number, self._rx_mode, self.index)

    def send(self, data: bytes) -> None:
        """Send bytes. Returns when the last is in the transmitter's FIFO.

        That takes all but the last 64 bytes' time: the board's exchanges must go on meanwhile, or its
        watchdog bites.

        Raises ValueError before setup and ModuleTimeout if the FIFO does not drain.
        """
        self._must_be_set_up()
        room = 0
        for start in range(0, len(data), _WORD):
            part = data[start : start + _WORD]
            if room == 0:
                room = self._await_room()
            word = int.from_bytes(part, "little")
            self._tx.write(UartTx.data.number, word, self.index, len(part) - 1)
            room -= 1

    def _must_be_set_up(self) -> None:
        if not self.is_set_up:
            raise ValueError(f"uart {self.index}: call setup first")

    def _await_room(self) -> int:
        entry = _WORD * _BITS_PER_BYTE / self.baud
        for _ in range(2 * _FIFO):
            room = _FIFO - self.pending
            if room > 0:
                return room
            self._board.pause(entry)
        raise errors.ModuleTimeout(
            f"uart {self.index}: its FIFO stays full",
            address=self._tx.address(UartTx.count.number, self.index),
            received=_FIFO,
        )

    @property
    def pending(self) -> int:
        """Entries of one to four bytes that wait to be sent."""
        return UartTx.count.count.get(self._tx.read(UartTx.count.number, self.index))

    def read(self, most: int | None = None) -> bytes:
        """The bytes received so far, at most `most`; empty if there are none.

        Call it often: 16 bytes are kept. Raises DataLost once if bytes were lost since the last call, and
        ValueError before setup.
        """
        self._must_be_set_up()
        receiver = self._receiver()
        self._check_lost(receiver)
        left = UartRx.count.count.get(receiver.read(UartRx.count.number, self.index))
        left = left if most is None else min(left, most)
        data = b""
        while left:
            count = min(left, _WORD)
            word = receiver.read(UartRx.data.number, self.index, count - 1)
            data += (word & (1 << 8 * count) - 1).to_bytes(count, "little")
            left -= count
        return data

    def _receiver(self) -> ModuleAccess:
        if not self._rx:
            raise errors.ModuleMissing(f"uart {self.index} has no receiver")
        return self._rx

    def _check_lost(self, receiver: ModuleAccess) -> None:
        mode = receiver.read(UartRx.mode.number, self.index)
        lost = UartRx.mode.overrun.mask | UartRx.mode.fifo_error.mask | UartRx.mode.lost_data.mask
        if mode & lost:
            receiver.write(UartRx.mode.number, self._rx_mode, self.index)
            raise errors.DataLost(
                f"uart {self.index}: bytes were lost, more than {_FIFO} came between two reads",
                address=receiver.address(UartRx.mode.number, self.index),
                received=mode,
                index=self.index,
            )

    def off(self) -> None:
        """Send no more."""
        if self.is_set_up:
            self._tx.write(UartTx.count.number, 0, self.index)
            self._tx.write(UartTx.mode.number, 0, self.index)

    def __repr__(self) -> str:
        return f"<Uart {self.index} {f'{self.baud:.0f} baud' if self.is_set_up else 'not set up'}>"


class Uarts(Sequence[Uart]):
    """The card's UARTs. Nothing is sent any more when the board closes and after a watchdog bite."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.tx = ModuleAccess(board, Gtag.UART_TX)
        has_receiver = any(module.gtag == Gtag.UART_RX for module in board.modules)
        self.rx = ModuleAccess(board, Gtag.UART_RX) if has_receiver else None
        self._uarts = [Uart(self, n) for n in range(self.tx.descriptor.instances)]
        board.on_restore(self._restore)
        board.on_close(self._off, SafeOff.GENERATORS)

    def _restore(self) -> None:
        for uart in self._uarts:
            uart.configure()

    def _off(self) -> None:
        for uart in self._uarts:
            uart.off()

    def __len__(self) -> int:
        return len(self._uarts)

    @overload
    def __getitem__(self, index: int) -> Uart: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Uart]: ...
    def __getitem__(self, index: int | slice) -> Uart | Sequence[Uart]:
        return self._uarts[index]

    def __repr__(self) -> str:
        return "\n".join(map(repr, self._uarts))
