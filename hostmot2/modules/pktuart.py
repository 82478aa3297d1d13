"""Packet UARTs: whole frames, as Modbus needs them. Source: fact sheet registers 2.13."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args, overload

from hostmot2 import errors
from hostmot2.board import SafeOff
from hostmot2.modules.instances import ModuleAccess
from hostmot2.modules.uart import dds_rate
from hostmot2.registers import Gtag, PktuartCommand, PktuartRx, PktuartTx

if TYPE_CHECKING:
    from hostmot2.board import Board

Parity = Literal["none", "even", "odd"]

_FRAMES = 16
_FRAME_BYTES = 1023
_FIFO_BYTES = 1024
"""What is pushed at most before the transmitter is empty; firmware has up to twice that."""
_WORD = 4
_TX, _RX = PktuartTx.mode, PktuartRx.mode


@dataclass(frozen=True, slots=True)
class Frame:
    """A received frame and what the receiver says of it. longest_gap: bit times, version 3 only."""

    data: bytes
    start_error: bool = False
    overrun: bool = False
    parity_error: bool = False
    longest_gap: int = 0

    @property
    def is_good(self) -> bool:
        """Whether no error is flagged."""
        return not (self.start_error or self.overrun or self.parity_error)


class Pktuart:
    """One packet UART. Call `setup` first."""

    def __init__(self, pktuarts: Pktuarts, index: int) -> None:
        self._tx, self._rx, self._board = pktuarts.tx, pktuarts.rx, pktuarts.board
        self.index, self._version = index, pktuarts.version
        self._rate = self._tx_mode = self._rx_mode = self._bits = self._filter = self._queued = 0

    def setup(
        self,
        baud: float,
        *,
        parity: Parity = "none",
        two_stop_bits: bool = False,
        inter_frame: int = 20,
        drive_delay: int = 0,
        filter_clocks: int = 0,
    ) -> None:
        """Set speed and framing, clear the FIFOs, switch the pins and listen.

        inter_frame: bit times of silence that end a received frame and follow a sent one, 0 to 255.
        drive_delay: clocks from the drive enable to the first byte, 0 to 15. filter_clocks: of the input, 0
        to 255, from version 2 on to 65535. Raises ValueError, and UnsupportedFirmware for two stop bits
        before version 3.
        """
        if parity not in get_args(Parity):
            raise ValueError(f"parity is one of {', '.join(get_args(Parity))}, not {parity!r}")
        if two_stop_bits and self._version < 3:
            raise errors.UnsupportedFirmware(
                f"packet UART version {self._version} has no second stop bit",
                expected=3,
                received=self._version,
            )
        if not 0 <= filter_clocks <= (0xFFFF if self._version >= 2 else 0xFF):
            raise ValueError(f"packet UART {self.index}: filter of {filter_clocks} clocks")
        bits = 24 if self._version >= 2 else 20
        rate = dds_rate(baud, self._tx.clock, bits, bits)
        tx_mode = _TX.drive_auto.mask | _TX.drive_delay.put(drive_delay)
        rx_mode = _RX.receive_enable.mask | _RX.filter_low.put(filter_clocks & 0xFF)
        odd, checked = parity == "odd", parity != "none"
        framing = _TX.parity.put(checked) | _TX.parity_odd.put(odd)
        framing |= _TX.two_stop_bits.put(two_stop_bits) | _TX.inter_frame.put(inter_frame)
        self._rate, self._tx_mode, self._rx_mode = rate, tx_mode | framing, rx_mode | framing  # the same bits
        self._bits, self._filter = 10 + (parity != "none") + two_stop_bits, filter_clocks
        self.configure()
        self._tx.drive(self.index, f"pktuart {self.index}")
        self._board.ioport.claim(self._rx.pins(self.index), f"pktuart {self.index}")

    @property
    def baud(self) -> float:
        """Bits per second as the hardware makes them; 0 before setup."""
        return self._rate * self._tx.clock / 2 ** (24 if self._version >= 2 else 20)

    def configure(self) -> None:
        """Write rates and modes, the FIFOs cleared in between."""
        if not self._rate:
            return
        high = self._filter >> 8
        self._tx.write(PktuartTx.bit_rate.number, self._rate, self.index)
        self._rx.write(
            PktuartRx.bit_rate.number, self._rate | PktuartRx.bit_rate.filter_high.put(high), self.index
        )
        self._clear(self._tx, _TX.number, self._tx_mode)
        self._clear(self._rx, _RX.number, self._rx_mode)

    def _clear(self, module: ModuleAccess, register: int, mode: int) -> None:
        module.write(register, PktuartCommand.CLEAR, self.index)
        module.write(register, mode, self.index)

    def _must_be_set_up(self) -> None:
        if not self._rate:
            raise ValueError(f"pktuart {self.index}: call setup first")

    def send(self, frame: bytes) -> None:
        """Send a frame of 1 to 1023 bytes. Returns when it is in the transmitter's FIFO.

        That may take as long as the frames before it: the board's exchanges must go on meanwhile, or its
        watchdog bites.

        Raises ValueError, and ModuleTimeout if earlier frames do not go out.
        """
        self._must_be_set_up()
        if not 1 <= len(frame) <= _FRAME_BYTES:
            raise ValueError(f"a frame has 1 to {_FRAME_BYTES} bytes, not {len(frame)}")
        self._await_room(len(frame))
        for start in range(0, len(frame), _WORD):
            word = int.from_bytes(frame[start : start + _WORD], "little")
            self._tx.write(PktuartTx.data.number, word, self.index)
        self._tx.write(PktuartTx.frame_count.number, len(frame), self.index)
        self._queued += -(-len(frame) // _WORD) * _WORD

    def _await_room(self, size: int) -> None:
        """All that was pushed may still be in the FIFO until the transmitter has nothing left."""
        longest = (2 * _FIFO_BYTES * self._bits + _FRAMES * 255) / self.baud
        step = self._bits * _WORD / self.baud
        deadline = self._board.now_ns() + round(1e9 * (longest + 0.01))
        while True:
            mode = self._tx.read(_TX.number, self.index)
            waiting = _TX.frames_waiting.get(mode)
            if not waiting and not _TX.busy.get(mode):
                self._queued = 0
            if waiting < _FRAMES and self._queued + size <= _FIFO_BYTES:
                return
            if self._board.now_ns() > deadline:
                raise errors.ModuleTimeout(
                    f"pktuart {self.index}: {waiting} frames do not go out",
                    address=self._tx.address(_TX.number, self.index),
                    received=mode,
                )
            self._board.pause(step)

    @property
    def pending(self) -> int:
        """Frames that wait to be sent."""
        return _TX.frames_waiting.get(self._tx.read(_TX.number, self.index))

    def read(self) -> list[Frame]:
        """The frames received so far, errors flagged; empty if there are none.

        Raises DataLost once if frames were lost since the last call (16 are kept); what else was there is
        gone, too, as counts and data no longer belong together. ValueError before setup.
        """
        self._must_be_set_up()
        mode = self._rx.read(_RX.number, self.index)
        if _RX.frame_fifo_error.get(mode) or _RX.pop_error.get(mode):
            self._clear(self._rx, _RX.number, self._rx_mode)
            raise errors.DataLost(
                f"pktuart {self.index}: frames were lost: more came between two reads than are kept",
                address=self._rx.address(_RX.number, self.index),
                received=mode,
                index=self.index,
            )
        return [self._read_frame() for _ in range(_RX.frames_waiting.get(mode))]

    def _read_frame(self) -> Frame:
        fields = PktuartRx.frame_count
        word = self._rx.read(fields.number, self.index)
        size = fields.bytes.get(word)
        data = b"".join(
            self._rx.read(PktuartRx.data.number, self.index).to_bytes(_WORD, "little")
            for _ in range(-(-size // _WORD))
        )
        return Frame(
            data[:size],
            bool(fields.start_error.get(word)),
            bool(fields.overrun.get(word)),
            bool(fields.parity_error.get(word)),
            fields.longest_gap.get(word) if self._version >= 3 else 0,
        )

    def off(self) -> None:
        """Send and receive no more."""
        if self._rate:
            self._clear(self._tx, _TX.number, 0)
            self._clear(self._rx, _RX.number, 0)

    def __repr__(self) -> str:
        return f"<Pktuart {self.index} {f'{self.baud:.0f} baud' if self._rate else 'not set up'}>"


class Pktuarts(Sequence[Pktuart]):
    """The card's packet UARTs. Nothing is sent any more when the board closes and after a watchdog bite."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.tx = ModuleAccess(board, Gtag.PKTUART_TX)
        self.rx = ModuleAccess(board, Gtag.PKTUART_RX)
        self.version = min(self.tx.descriptor.version, self.rx.descriptor.version)
        if self.tx.descriptor.version != self.rx.descriptor.version:
            raise errors.UnsupportedFirmware(
                f"{board.name}: packet UART transmitters have version {self.tx.descriptor.version}, "
                f"receivers {self.rx.descriptor.version}"
            )
        count = min(self.tx.descriptor.instances, self.rx.descriptor.instances)
        self._pktuarts = [Pktuart(self, n) for n in range(count)]
        board.on_restore(self._restore)
        board.on_close(self._off, SafeOff.GENERATORS)

    def _restore(self) -> None:
        for pktuart in self._pktuarts:
            pktuart.configure()

    def _off(self) -> None:
        for pktuart in self._pktuarts:
            pktuart.off()

    def __len__(self) -> int:
        return len(self._pktuarts)

    @overload
    def __getitem__(self, index: int) -> Pktuart: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Pktuart]: ...
    def __getitem__(self, index: int | slice) -> Pktuart | Sequence[Pktuart]:
        return self._pktuarts[index]

    def __repr__(self) -> str:
        return "\n".join(map(repr, self._pktuarts))
