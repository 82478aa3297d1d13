"""An encoder plugged into an emulated card."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hostmot2._core import ffi, lib

if TYPE_CHECKING:
    from hostmot2.emulator.board import EmulatedBoard


class EmulatedEncoder:
    """An encoder at one of the card's encoder inputs. Asking for it plugs it in, with A, B and Z at 0.

    Every change takes effect as time goes on from now, and starts at the position reached.
    """

    def __init__(self, board: EmulatedBoard, number: int) -> None:
        self._board = board
        self.number = number

    def run(self, edge_period_ns: float, counts: int) -> None:
        """Quadrature: `counts` edges, one every `edge_period_ns`; A leads B when positive."""
        period = round(edge_period_ns * 1000)
        self._do(lib.hm2_emulator_encoder_run(self._board.handle, self.number, period, counts))

    def pulses(self, period_ns: float, count: int) -> None:
        """Step and direction: `count` pulses on A of 50 %; B is 1 when positive, 0 when negative."""
        period = round(period_ns * 1000)
        self._do(lib.hm2_emulator_encoder_pulses(self._board.handle, self.number, period, count))

    def set_rate(self, counts_per_second: float) -> None:
        """Quadrature at this rate until told otherwise. Fractions of a count are kept through changes."""
        rate = round(counts_per_second * (1 << 20))
        self._do(lib.hm2_emulator_encoder_rate(self._board.handle, self.number, rate))

    def set(self, a: int | None, b: int | None, z: int | None) -> None:
        """Levels that stay until it moves: 0, 1, or None for a line let go."""
        levels = [-1 if level is None else level for level in (a, b, z)]
        self._do(lib.hm2_emulator_encoder_set(self._board.handle, self.number, *levels))

    def index_every(self, counts: int, width: int = 1) -> None:
        """Z is high while position modulo `counts` is less than `width`; 0 counts: no pattern."""
        self._do(lib.hm2_emulator_encoder_index(self._board.handle, self.number, counts, width))

    @property
    def position(self) -> int:
        """Where the encoder is, in counts; setting it jumps there (no edges are made up in between)."""
        out = ffi.new("int64_t *")
        self._do(lib.hm2_emulator_encoder_position(self._board.handle, self.number, out))
        return int(out[0])

    @position.setter
    def position(self, counts: int) -> None:
        self._do(lib.hm2_emulator_encoder_preset(self._board.handle, self.number, counts))

    def unplug(self) -> None:
        """Take it off: its lines float."""
        self._do(lib.hm2_emulator_encoder_plug(self._board.handle, self.number, 0))

    def _do(self, status: int) -> None:
        if status != lib.HM2_OK:
            raise ValueError("out of range for an encoder")
