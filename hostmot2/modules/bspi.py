"""Buffered SPI. Source: fact sheet registers 2.11."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.board import SafeOff
from hostmot2.cycle import Order
from hostmot2.modules.instances import Instances
from hostmot2.registers import Bspi as Registers
from hostmot2.registers import Gtag

if TYPE_CHECKING:
    from hostmot2.board import Board

_DEPTH = 16
"""Channels, and words of each FIFO."""
_DESCRIPTOR = Registers.descriptor_fifo
_NO_DELAY = 0x10
_MOST_BITS = 32


class BspiFrame:
    """Words that each exchange sends; `values` are the answers to those of the exchange before."""

    def __init__(self, bspi: Bspi, channels: Sequence[int]) -> None:
        self.channels = tuple(channels)
        self._expected = sum(bspi.has_echo(channel) for channel in channels)
        self._words: Any = ffi.new("uint32_t[]", len(channels))
        self._counts: Any = ffi.new("uint32_t[]", 1)
        self._answers: Any = ffi.new("uint32_t[]", max(1, self._expected))
        self._parts: list[Any] = []
        self._join(bspi.register_address(Registers.count.number), self._counts, lib.HM2_TRANSFER_READ, bspi)
        if self._expected:
            same = lib.HM2_TRANSFER_READ | lib.HM2_TRANSFER_SAME_ADDRESS
            self._join(bspi.register_address(Registers.data.number), self._answers, same, bspi)
        for position, channel in enumerate(channels):
            address = bspi.register_address(Registers.data.number, channel)
            self._join(address, self._words + position, lib.HM2_TRANSFER_WRITE, bspi, 1)

    def _join(self, address: int, words: Any, flags: int, bspi: Bspi, count: int | None = None) -> None:
        block: Any = ffi.new("hm2_cyclic_words *")
        block.transfer.address, block.transfer.flags, block.transfer.words = address, flags, words
        block.transfer.count, block.enabled = len(words) if count is None else count, 1
        part = ffi.new("hm2_cyclic *")
        lib.hm2_cyclic_words_part(block, part)
        bspi.cycle.add(part, (block, part, self), Order.OTHERS)
        self._parts.append(block)

    def __setitem__(self, position: int, word: int) -> None:
        self._words[range(len(self.channels))[position]] = word

    def __len__(self) -> int:
        return len(self.channels)

    @property
    def values(self) -> list[int] | None:
        """The answers of the channels that have one; None if the last exchange found more or less of them."""
        if Registers.count.receive.get(self._counts[0]) != self._expected:
            return None
        return list(self._answers[0 : self._expected])

    def stop(self) -> None:
        """Take no more part in the cycle."""
        for block in self._parts:
            block.enabled = 0


class Bspi:
    """One SPI master with up to 16 channels. Pins are driven from the first `setup` on."""

    def __init__(self, bspis: Bspis, index: int) -> None:
        self._all, self.index = bspis, index
        self._descriptors = [0] * _DEPTH
        self._in_use: set[int] = set()
        self.cycle = bspis.board.cycle

    def setup(
        self,
        channel: int,
        *,
        bits: int,
        frequency: float,
        chip_select: int,
        cpol: bool = False,
        cpha: bool = False,
        select_delay: int | None = None,
        sample_late: bool = False,
        keep_frame: bool = False,
        echo: bool = True,
    ) -> None:
        """Say how words of a channel (0 to 15) are sent; writes all descriptors and clears the FIFOs.

        bits: 1 to 32 of a word, the most significant first. frequency: at most, Hz. chip_select: 0 to 15.
        cpol, cpha: clock polarity and phase. select_delay: clocks between select and word, 1 to 16, None for
        none. keep_frame: the frame stays asserted after the word. echo: whether an answer is kept. Raises
        ValueError.
        """
        self._check(channel)
        if not 1 <= bits <= _MOST_BITS:
            raise ValueError(f"a word has 1 to {_MOST_BITS} bits, not {bits}")
        if select_delay is not None and not 1 <= select_delay <= _NO_DELAY:
            raise ValueError(f"a select delay is 1 to {_NO_DELAY} clocks, not {select_delay}")
        self._descriptors[channel] = (
            _DESCRIPTOR.bits.put(bits - 1)
            | _DESCRIPTOR.cpol.put(cpol)
            | _DESCRIPTOR.cpha.put(cpha)
            | _DESCRIPTOR.divider.put(self._divider(frequency))
            | _DESCRIPTOR.chip_select.put(chip_select)
            | _DESCRIPTOR.select_delay.put(_NO_DELAY if select_delay is None else select_delay - 1)
            | _DESCRIPTOR.sample_late.put(sample_late)
            | _DESCRIPTOR.keep_frame.put(keep_frame)
            | _DESCRIPTOR.no_echo.put(not echo)
        )
        self._in_use.add(channel)
        self.configure()
        self._all.drive(self.index, f"bspi {self.index}")

    def _divider(self, frequency: float) -> int:
        """Of the fastest clock that is not faster."""
        divider = -int(-self._all.clock // (2 * frequency)) - 1 if frequency > 0 else -1
        divider = max(divider, 0) if frequency > 0 else -1
        if not 0 <= divider <= _DESCRIPTOR.divider.maximum:
            slowest = self._all.clock / 2 / (_DESCRIPTOR.divider.maximum + 1)
            raise ValueError(f"an SPI clock of {frequency} Hz is below {slowest:.0f} Hz")
        return divider

    def frequency(self, channel: int) -> float:
        """Hz of a channel's clock as the hardware makes it."""
        self._check(channel)
        return self._all.clock / (2 * (_DESCRIPTOR.divider.get(self._descriptors[channel]) + 1))

    def has_echo(self, channel: int) -> bool:
        """Whether an answer to a channel's words is kept. Raises ValueError before its setup."""
        self._check(channel)
        if channel not in self._in_use:
            raise ValueError(f"bspi {self.index}: channel {channel} is not set up")
        return not _DESCRIPTOR.no_echo.get(self._descriptors[channel])

    def _check(self, channel: int) -> None:
        if not 0 <= channel < _DEPTH:
            raise ValueError(f"bspi {self.index}: there are channels 0 to {_DEPTH - 1}, no {channel}")

    def configure(self) -> None:
        """Write the descriptors, 15 first, and clear the FIFOs."""
        if self._in_use:
            for descriptor in reversed(self._descriptors):
                self._all.write(_DESCRIPTOR.number, descriptor, self.index)
            self.clear()

    def clear(self) -> None:
        """Empty both FIFOs."""
        self._all.write(Registers.count.number, 0, self.index)

    def register_address(self, register: int, channel: int = 0) -> int:
        """The byte address of a register; of the data register that of a channel."""
        return self._all.address(register, self.index, channel)

    def transfer(self, words: Sequence[tuple[int, int]]) -> list[int]:
        """Send (channel, word) pairs, 16 at most, and return the answers of the channels that have one.

        Clears the FIFOs first. Not while a frame of this master takes part in the cycle. Raises ValueError,
        and ModuleTimeout if the words do not go out.
        """
        if not 1 <= len(words) <= _DEPTH:
            raise ValueError(f"1 to {_DEPTH} words at a time, not {len(words)}")
        expected = sum(self.has_echo(channel) for channel, _ in words)
        with self._all.board.lock:
            self.clear()
            for channel, word in words:
                self._all.write(Registers.data.number, word, self.index, channel)
            self._await(expected, self._seconds(words))
            return [self._all.read(Registers.data.number, self.index) for _ in range(expected)]

    def _seconds(self, words: Sequence[tuple[int, int]]) -> float:
        descriptors = [self._descriptors[channel] for channel, _ in words]
        clocks = sum(
            (_DESCRIPTOR.bits.get(d) + 1) * 2 * (_DESCRIPTOR.divider.get(d) + 1) + _NO_DELAY
            for d in descriptors
        )
        return clocks / self._all.clock

    def _await(self, expected: int, seconds: float) -> None:
        for _ in range(10):
            count = self._all.read(Registers.count.number, self.index)
            if not Registers.count.transmit.get(count) and Registers.count.receive.get(count) == expected:
                return
            self._all.board.pause(seconds)
        raise errors.ModuleTimeout(
            f"bspi {self.index}: {expected} answers were expected, the FIFOs hold 0x{count:X}",
            address=self.register_address(Registers.count.number),
            expected=expected,
            received=count,
        )

    def frame(self, channels: Sequence[int]) -> BspiFrame:
        """Words for these channels in each exchange from now on. Raises ValueError."""
        if not 1 <= len(channels) <= _DEPTH:
            raise ValueError(f"1 to {_DEPTH} words in a frame, not {len(channels)}")
        self.clear()
        return BspiFrame(self, channels)

    def __repr__(self) -> str:
        return f"<Bspi {self.index} channels {sorted(self._in_use)}>"


class Bspis(Instances[Bspi]):
    """The card's buffered SPI masters: BSPI, or DBSPI with decoded selects. A bite leaves their pins off."""

    def __init__(self, board: Board) -> None:
        decoded = any(module.gtag == Gtag.DBSPI for module in board.modules)
        plain = any(module.gtag == Gtag.BSPI for module in board.modules)
        super().__init__(board, Gtag.DBSPI if decoded and not plain else Gtag.BSPI)
        self._instances = [Bspi(self, n) for n in range(self.descriptor.instances)]
        board.on_restore(self._restore)
        board.on_close(self._off, SafeOff.GENERATORS)

    def _restore(self) -> None:
        for bspi in self._instances:
            bspi.configure()

    def _off(self) -> None:
        for bspi in self._instances:
            bspi.clear()
