"""SSI absolute encoders. Source: fact sheet registers 2.14."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from hostmot2._core import ffi, lib
from hostmot2.board import SafeOff
from hostmot2.cycle import Order
from hostmot2.modules.absolute_format import AbsoluteField, parse_format
from hostmot2.modules.instances import Instances, whole
from hostmot2.registers import Gtag
from hostmot2.registers import Ssi as Registers

if TYPE_CHECKING:
    from hostmot2.board import Board

_CONTROL = Registers.control
_DATA_BITS = 64


class Ssi:
    """One SSI channel. Readings are those of the last exchange that brought one.

    Nothing is sent until `start` has said what the encoder sends.
    """

    def __init__(self, ssis: Ssis, index: int, state: Any) -> None:
        self._all, self.index, self._state = ssis, index, state
        self._fields: tuple[AbsoluteField, ...] = ()
        self._rate, self._timer = 0, 0
        self._scale = 1.0

    def start(self, encoder_format: str, *, frequency: float = 500e3, timer: int = 0) -> None:
        """Read an encoder from the next exchange on.

        encoder_format: as in absolute_format.parse_format, 1 to 64 bits. frequency: of the clock, Hz. timer:
        0: each exchange starts the transfer that the next one reads; 1 to 4: that timer of the DPLL starts
        it. Raises ValueError.
        """
        fields = parse_format(encoder_format, _DATA_BITS)
        rate = whole(frequency * 65536 / self._all.clock)
        if not 1 <= rate <= _CONTROL.rate.maximum:
            low, high = (self._all.clock * rate / 65536 for rate in (0.5, _CONTROL.rate.maximum))
            raise ValueError(f"SSI {self.index}: {frequency} Hz is outside {low:.0f}..{high:.0f} Hz")
        if not 0 <= timer <= 4:
            raise ValueError(f"there is no DPLL timer {timer}")
        self._fields, self._rate, self._timer = fields, rate, timer
        self._describe()
        self._all.begin(self)

    def stop(self) -> None:
        """Read it no more."""
        self._state.bits = 0
        self._all.begin(self)

    def _describe(self) -> None:
        """Tell the C core where the position is."""
        ffi.memmove(self._state, bytes(ffi.sizeof("hm2_absolute")), ffi.sizeof("hm2_absolute"))
        self._state.bits = sum(field.bits for field in self._fields)
        for field in self._fields:
            if field.kind in "el":
                self._state.low_shift, self._state.low_bits = field.shift, field.bits
                self._state.gray = field.gray
            elif field.kind == "h":
                self._state.high_shift, self._state.high_bits = field.shift, field.bits

    @property
    def frequency(self) -> float:
        """Hz of the clock as the hardware makes it; 0 before start."""
        return self._rate * self._all.clock / 65536

    @property
    def fresh(self) -> bool:
        """Whether the last exchange brought a new reading."""
        return bool(self._state.fresh)

    @property
    def missed(self) -> int:
        """Exchanges in a row without a new reading."""
        return int(self._state.missed)

    @property
    def data(self) -> int | None:
        """All bits of the last reading; None before the first."""
        return int(self._state.data) if self._state.valid else None

    @property
    def values(self) -> dict[str, int | bool]:
        """The last reading by field name; empty before the first."""
        data = self.data
        return {} if data is None else {f.name: f.value(data) for f in self._fields if f.kind != "p"}

    @property
    def count(self) -> int:
        """The position in counts, going on over its wrap; 0 before the first reading."""
        return int(self._state.count)

    @property
    def scale(self) -> float:
        """Counts per unit; not 0."""
        return self._scale

    @scale.setter
    def scale(self, counts: float) -> None:
        if not math.isfinite(counts) or counts == 0:
            raise ValueError(f"SSI {self.index}: scale {counts} counts per unit")
        self._scale = counts

    @property
    def position(self) -> float:
        """`count / scale`."""
        return self.count / self._scale

    @property
    def is_running(self) -> bool:
        """Whether start has been called."""
        return bool(self._state.bits)

    def control_word(self) -> int:
        """The control register."""
        if not self.is_running:
            return 0
        return (
            _CONTROL.bits.put(self._state.bits)
            | _CONTROL.rate.put(self._rate)
            | (_CONTROL.timer_start.mask if self._timer else _CONTROL.program_start.mask)
            | _CONTROL.timer.put(self._timer)
        )

    @property
    def is_started_by_exchange(self) -> bool:
        """Whether exchanges start its transfers, not a timer."""
        return self.is_running and not self._timer

    def __repr__(self) -> str:
        return f"<Ssi {self.index} {self.values if self._state.valid else 'no reading'}>"


class Ssis(Instances[Ssi]):
    """The card's SSI channels."""

    def __init__(self, board: Board) -> None:
        super().__init__(board, Gtag.SSI)
        count = self.descriptor.instances
        self._states: Any = ffi.new("hm2_absolute[]", count)
        self._words: Any = ffi.new("uint32_t[]", 2 + 3 * count)
        self._group: Any = ffi.new("hm2_absolutes *")
        self._instances = [Ssi(self, n, self._states + n) for n in range(count)]
        self._join_cycle()
        self._restore()
        board.on_restore(self._restore)
        board.on_close(self._stop, SafeOff.GENERATORS)

    def _join_cycle(self) -> None:
        group = self._group
        group.channels, group.words, group.count = self._states, self._words, len(self)
        group.busy_address = self.address(Registers.global_start.number)
        group.control_address = self._control_address(0)
        group.high_address = self.address(Registers.data1.number)
        group.low_address = self.address(Registers.data0.number)
        group.control_busy_mask = _CONTROL.busy.mask
        group.control_available_mask = _CONTROL.data_available.mask
        part = ffi.new("hm2_cyclic *")
        lib.hm2_absolutes_part(group, part)
        self.board.cycle.add(part, (self, part), Order.ENCODERS)

    def _control_address(self, index: int) -> int:
        # the descriptor calls the register global, but each channel has one
        return self.address(Registers.control.number) + index * self.descriptor.instance_stride

    def begin(self, channel: Ssi) -> None:
        """Set one channel up and claim its pins, or stop it."""
        self._group.start = any(ssi.is_started_by_exchange for ssi in self._instances)
        if channel.is_running:
            self.board.ioport.claim(self.pins(channel.index), f"ssi {channel.index}", after_bite=True)
        self.board.write(self._control_address(channel.index), channel.control_word())
        self.read(Registers.data0.number, channel.index)  # what is there is of before

    def _restore(self) -> None:
        for ssi in self._instances:
            self.board.write(self._control_address(ssi.index), ssi.control_word())

    def _stop(self) -> None:
        for ssi in self._instances:
            self.board.write(self._control_address(ssi.index), 0)
