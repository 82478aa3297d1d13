"""The vectors of an engine: which numbers there are, and how they follow what is said through cards."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hostmot2._core import ffi, lib
from hostmot2.engine import signals as signal
from hostmot2.engine.signals import Commands, Doubles, Names, Signal

if TYPE_CHECKING:
    from hostmot2.board import Board


def doubles(array: Doubles) -> Any:
    """The `double *` of an array."""
    return ffi.cast("double *", array.ctypes.data)


class Vectors:
    """Inputs and outputs of everything in use on a board, and the commands for them.

    `Channel.inputs`, `Channel.outputs` and the like are mirrors: they show the inputs last read, and what is
    assigned to them goes out with the next write.
    """

    def __init__(self, board: Board, ports: list[signal.PortData]) -> None:
        self._ports = ports
        stepgen_inputs, stepgen_outputs = signal.stepgen_signals(board)
        self.inputs = signal.encoder_signals(board) + stepgen_inputs
        self.outputs = list(stepgen_outputs)
        for port in ports:
            self.inputs += port.inputs
            self.outputs += port.outputs
        self.inputs += signal.gpio_signals(board)
        names = Names(each.name for each in self.outputs)
        self.commands = Commands(names, np.zeros(len(names)))
        """What is to go out, by name."""
        self._steppers = [(names[name], state) for name, state in signal.stepgen_states(board)]
        self._positions = [index for index, _ in self._steppers]
        self._mirrored = np.zeros(len(self.outputs))  # what the mirrors had when they were last looked at
        self._name()
        self._mirrored = self._told()
        self.commands.array[self._has_mirror] = self._mirrored[self._has_mirror]
        self.commands.array[self._positions] = np.nan

    def _name(self) -> None:
        self.input_names = Names(each.name for each in self.inputs)
        self.output_names = Names(each.name for each in self.outputs)
        self.commands.extend(self.output_names)
        self._mirrors_in = signal.c_signals(self.inputs, mirrors=True)
        self._mirrors_out = signal.c_signals(self.outputs, mirrors=True)
        self._has_mirror = np.array([each.mirror is not None for each in self.outputs], bool)
        self._mirrored = np.append(self._mirrored, np.zeros(len(self.outputs) - len(self._mirrored)))

    def _told(self) -> Doubles:
        told = self._mirrored.copy()
        lib.hm2_signals_load(self._mirrors_out, len(self.outputs), doubles(told))
        return told

    def add_input(self, added: Signal) -> None:
        """One more input. Raises ValueError for a name there is."""
        if self.input_names.has(added.name):
            raise ValueError(f"there is an input {added.name!r} already")
        self.inputs.append(added)
        self._name()

    def add_command(self, name: str) -> None:
        """One more output, for controllers only. Raises ValueError for a name there is."""
        if self.output_names.has(name):
            raise ValueError(f"there is an output {name!r} already")
        self.outputs.append(Signal(name, hold=True))
        self._name()

    def add_position(self, name: str) -> None:
        """A command with no value until it is given one: nobody but the user knows where an axis shall be."""
        self.add_command(name)
        self._positions.append(len(self.outputs) - 1)
        self.commands[name] = np.nan

    def take_commands(self) -> Doubles:
        """What shall go out: of the commands and what was told to cards, whatever has changed.

        Raises ValueError for what is no finite number.
        """
        array, count = self.commands.array, len(self.outputs)
        theirs = self._told()
        changed = (theirs != self._mirrored) & self._has_mirror
        array[changed] = theirs[changed]
        self._mirrored = theirs  # also if this is refused: what is said to `commands` from now on is newer
        array = self._where_none_is_asked_for(array)
        if not np.isfinite(array).all():
            bad = [name for name, index in self.output_names.items() if not np.isfinite(array[index])]
            raise ValueError(f"not a number: {', '.join(bad)}{self._say_where(bad)}")
        lib.hm2_signals_store(self._mirrors_out, count, doubles(array))
        self._mirrored[:] = array
        return array

    def _where_none_is_asked_for(self, array: Doubles) -> Doubles:
        """A step generator under velocity control needs no position: where it is, should that ever count."""
        idle = [each for each in self._steppers if not each[1].position_control and np.isnan(array[each[0]])]
        if idle:
            array = array.copy()
        for index, state in idle:
            array[index] = state.position
        return array

    def _say_where(self, names: list[str]) -> str:
        axes = {list(self.output_names)[index] for index in self._positions}.intersection(names)
        return "; before outputs can go on, say where each axis shall be" if axes else ""

    def show(self, inputs: Doubles) -> None:
        """Let the board's channels show what was read."""
        lib.hm2_signals_store(self._mirrors_in, len(inputs), doubles(inputs))
        for port in self._ports:
            port.show_counts()

    def clear(self) -> None:
        """All commands zero, but positions, which are to be given anew. What cards were told is zero, too."""
        self.commands.array[:] = 0.0
        self.commands.array[self._positions] = np.nan
        self._mirrored[:] = 0.0
