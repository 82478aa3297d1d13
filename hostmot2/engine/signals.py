"""What an engine moves: names, and the places in the parts' memory they stand for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from hostmot2._core import ffi, lib
from hostmot2.errors import EngineError
from hostmot2.fields import Direction, FieldKind
from hostmot2.layout import COUNTERS
from hostmot2.process_data import ProcessData
from hostmot2.registers import Gtag

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.sserial import SserialPort

Doubles = npt.NDArray[np.float64]

_F64, _I64, _U64, _I32, _U32 = (
    lib.HM2_SIGNAL_F64,
    lib.HM2_SIGNAL_I64,
    lib.HM2_SIGNAL_U64,
    lib.HM2_SIGNAL_I32,
    lib.HM2_SIGNAL_U32,
)


@dataclass(frozen=True, slots=True)
class Signal:
    """One number. place: in memory that only the engine uses, None: in the vector alone. mirror: where
    `Channel.inputs` and `Channel.outputs` have it. hold: keeps its value while outputs are off.
    """

    name: str
    place: Any = None
    type: int = _F64
    bit: int = -1
    hold: bool = False
    mirror: Any = None
    unit: str = ""


def c_signals(signals: Sequence[Signal], *, mirrors: bool = False) -> Any:
    """The `hm2_signal[]` of some signals, or of their mirrors."""
    array: Any = ffi.new("hm2_signal[]", max(1, len(signals)))
    for entry, signal in zip(array, signals, strict=False):
        entry.place = ffi.NULL if (place := signal.mirror if mirrors else signal.place) is None else place
        entry.type, entry.bit, entry.hold = signal.type, signal.bit, signal.hold
    return array


class Names(Mapping[str, int]):
    """Index by name, in any capitals. The end of a dotted name will do where it is unique: "analogout0"."""

    def __init__(self, names: Iterable[str]) -> None:
        self.names = list(names)
        self._found: dict[str, int] = {}
        ends: dict[str, set[int]] = {}
        for index, name in enumerate(self.names):
            parts = name.casefold().split(".")
            for first in range(1, len(parts)):
                ends.setdefault(".".join(parts[first:]), set()).add(index)
        for end, indices in ends.items():
            if len(indices) == 1:
                self._found[end] = indices.pop()
        self._found |= {name.casefold(): index for index, name in enumerate(self.names)}

    def __getitem__(self, name: str) -> int:
        index = self._found.get(name.casefold())
        if index is None:
            several = [full for full in self.names if full.casefold().endswith(f".{name.casefold()}")]
            raise KeyError(f"no signal {name!r}" + (f": {', '.join(several)}" if several else ""))
        return index

    def has(self, name: str) -> bool:
        """Whether this is a whole name, in any capitals."""
        return name.casefold() in (each.casefold() for each in self.names)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


class Readings(Mapping[str, float]):
    """Values by name; `array` is all of them, in the order of the names."""

    __slots__ = ("_names", "array")

    def __init__(self, names: Names, array: Doubles) -> None:
        self._names = names
        self.array = array

    def __getitem__(self, name: str) -> float:
        return float(self.array[self._names[name]])

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def index(self, name: str) -> int:
        """Where a value lies in `array`. KeyError: no such name, or several end so."""
        return self._names[name]

    def __repr__(self) -> str:
        return "\n".join(f"{name} {value:g}" for name, value in self.items())


class Commands(Readings, MutableMapping[str, float]):
    """Values to be sent, by name or through `array`. They go out with Engine.write()."""

    __slots__ = ()

    def extend(self, names: Names) -> None:
        """Further values at the end, 0, as `names` has them."""
        self.array = np.append(self.array, np.zeros(len(names) - len(self.array)))
        self._names = names

    def __setitem__(self, name: str, value: float) -> None:
        self.array[self._names[name]] = value

    def __delitem__(self, name: str) -> None:
        raise TypeError("an output cannot be deleted")


def _member(state: Any, name: str) -> Any:
    return ffi.addressof(state[0], name)


def encoder_signals(board: Board) -> list[Signal]:
    """Position, velocity and count of every encoder, if the card has any."""
    if board.read_only or not any(m.gtag in (Gtag.ENCODER, Gtag.MUXED_ENCODER) for m in board.modules):
        return []  # to set them up is to write
    signals = []
    for number, encoder in enumerate(board.encoders):
        state, name = encoder._state, f"encoder{number}"
        signals += [
            Signal(f"{name}.position", _member(state, "position")),
            Signal(f"{name}.velocity", _member(state, "velocity")),
            Signal(f"{name}.raw_count", _member(state, "raw_count"), _I64, unit="counts"),
        ]
    return signals


def stepgen_signals(board: Board) -> tuple[list[Signal], list[Signal]]:
    """Of the step generators, if the program has used them: inputs and outputs."""
    inputs, outputs = [], []
    for number, stepgen in enumerate(board.stepgens if "stepgens" in board._parts else ()):
        state, name = stepgen._state, f"stepgen{number}"
        inputs += [
            Signal(f"{name}.position", _member(state, "position")),
            Signal(f"{name}.velocity", _member(state, "velocity")),
        ]
        outputs += [
            Signal(f"{name}.position_command", _member(state, "position_command"), hold=True),
            Signal(f"{name}.velocity_command", _member(state, "velocity_command")),
            Signal(f"{name}.enable", _member(state, "enable"), _I32),
        ]
    return inputs, outputs


def stepgen_states(board: Board) -> list[tuple[str, Any]]:
    """Name of the position command and `hm2_stepgen *` of the step generators that the program has used."""
    stepgens = board.stepgens if "stepgens" in board._parts else ()
    return [(f"stepgen{number}.position_command", each._state) for number, each in enumerate(stepgens)]


def gpio_signals(board: Board) -> list[Signal]:
    """The levels of all pads, if the program has used the I/O ports: a word per port."""
    if "ioport" not in board._parts:
        return []
    pads = board.ioport._pads
    return [Signal(f"ioport{n}.pads", ffi.addressof(pads, n), _U32) for n in range(board.ioport.ports)]


class PortData:
    """A port's process data in memory of the engine's own, so that programs may assign at any time."""

    def __init__(self, port: SserialPort) -> None:
        self.port = port
        self.mask = port.started
        self.theirs = port.process_data
        core = port._core
        self.ours = ProcessData(
            self.theirs.layouts, input_image=core._words("inputs"), output_image=core._words("outputs")
        )
        self.inputs = self._signals(Direction.INPUT)
        self.outputs = self._signals(Direction.OUTPUT)
        self._counters = [
            index
            for index, (channel, element) in enumerate(self.theirs._elements)
            if element.direction is Direction.INPUT
            and element.field.kind in COUNTERS
            and self.mask >> channel & 1
        ]

    def _signals(self, direction: Direction) -> list[Signal]:
        signals = []
        for index, (channel, element) in enumerate(self.theirs._elements):
            if element.direction is not direction or not element.is_visible or not self.mask >> channel & 1:
                continue
            whole = element.field.kind in (FieldKind.BITS, FieldKind.STREAM)
            signals.append(
                Signal(
                    f"sserial{self.port.number}.{channel}.{element.name}",
                    _place(self.ours, index, whole),
                    _U64 if whole else _F64,
                    mirror=_place(self.theirs, index, whole),
                    unit=element.field.unit,
                )
            )
        return signals

    def take(self) -> None:
        """From now on transfers use our memory. Until the first one readings are those of the last before."""
        self.ours.carry_on(self.theirs)
        self.theirs.stand_in = self.ours
        lib.hm2_sserial_set_process_data(self.port._core.handle, self.ours._plan)
        self.port.cyclic = self.mask

    def raise_if_changed(self) -> None:
        """EngineError if other channels run than when the engine was made, or other remotes."""
        if self.port.process_data is not self.theirs or self.port.started != self.mask:
            raise EngineError(
                f"{self.port.label}: channels were started or stopped since this engine was made "
                f"(0x{self.mask:02X} then, 0x{self.port.started:02X} now): make another one"
            )

    def give_back(self) -> None:
        """Transfers use the program's memory again, its outputs at zero.

        That of today: a port that was started anew may have found other remotes.
        """
        if self.theirs.stand_in is not self.ours:
            return
        self.port.cyclic = 0
        self.theirs.stand_in = None
        self.theirs.carry_on(self.ours)
        current = self.port.process_data
        for outputs in current.outputs.values():
            outputs.off()
        lib.hm2_sserial_set_process_data(self.port._core.handle, current._plan)

    def show_counts(self) -> None:
        """What the program sees of counters as raw counts, from the positions it sees."""
        for index in self._counters:
            count = self.theirs.values[index] * self.theirs._scalings[index].scale
            if abs(count) < 2.0**53:
                self.theirs.raw[index] = round(count) % (1 << 64)


def _place(data: ProcessData, index: int, whole: bool) -> Any:
    if whole:
        return ffi.cast("uint64_t *", data.raw.ctypes.data) + index
    return ffi.cast("double *", data.values.ctypes.data) + index
