"""Process data: values in engineering units on one side, register words on the other.

A `Layout` places the elements of one channel, in the order of the remote's PTOC. `ProcessData` compiles the
layouts of all channels of a port into one plan; `unpack()` and `pack()` then convert everything in one call
into the core. Values live in `values` and `raw`, words in `input_image` and `output_image`: arrays made
once and never copied. Source: sserial.md 6.

Thread safety: one thread unpacks and packs. Others may read and assign single elements at any time; each is
one aligned 64-bit store, and takes effect as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from hostmot2._bound import bind
from hostmot2._core import ffi, lib
from hostmot2.bulk import Columns, Records, Source, decode
from hostmot2.elements import Bits, Elements, Inputs, Outputs
from hostmot2.errors import EngineError, check, new_error
from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.layout import Element, Layout, Scaling

__all__ = [
    "Bits",
    "Direction",
    "Element",
    "Elements",
    "Field",
    "FieldKind",
    "Inputs",
    "Layout",
    "Outputs",
    "ProcessData",
    "Scaling",
]

Words = npt.NDArray[np.uint32]


class ProcessData:
    """The process data of some channels of a port.

    `inputs[channel]` and `outputs[channel]` are the elements by name. `unpack()` turns `input_image` into
    `values` and `raw`, `pack()` turns those into `output_image`; both do all channels in one call and
    allocate nothing. The images are uint32 arrays indexed [channel, register]; give your own (views with
    strides are fine) to work in place on the buffers of a transfer. Channel numbers index them.

    Raises ValueError when a layout does not fit into `words` registers per channel.
    """

    def __init__(
        self,
        layouts: Mapping[int, Layout],
        *,
        words: int = 3,
        input_image: Words | None = None,
        output_image: Words | None = None,
    ) -> None:
        self.layouts = dict(sorted(layouts.items()))
        channels = max(self.layouts, default=-1) + 1
        shape = (channels, words)
        self.input_image = np.zeros(shape, np.uint32) if input_image is None else input_image
        self.output_image = np.zeros(shape, np.uint32) if output_image is None else output_image
        self._elements = [(channel, e) for channel, each in self.layouts.items() for e in each.elements]
        self._scalings = [element.default_scaling() for _, element in self._elements]
        # one entry more than needed, so that a port without elements has buffers too
        self.values: npt.NDArray[np.float64] = np.zeros(len(self._elements) + 1)[:-1]
        self.raw: npt.NDArray[np.uint64] = np.zeros(len(self._elements) + 1, np.uint64)[:-1]
        self._values = cast("memoryview[float]", self.values.data)
        self._raw = self.raw.data
        self._plan = self._compile()
        self.unpack = self._bind("hm2_process_data_unpack")
        self.pack = self._bind("hm2_process_data_pack")
        self.stand_in: ProcessData | None = None
        """What transfers use instead, while a cycle engine has them."""
        self.inputs = {channel: Inputs(self, channel, Direction.INPUT) for channel in self.layouts}
        self.outputs = {channel: Outputs(self, channel, Direction.OUTPUT) for channel in self.layouts}

    def restart(self, channel: int) -> None:
        """Counters of a channel as at the beginning, for a remote that was started anew."""
        lib.hm2_process_data_restart(self._plan, channel)

    def clear_inputs(self, channel: int) -> None:
        """Inputs of a channel as if none had come yet."""
        for index, (owner, element) in enumerate(self._elements):
            if owner == channel and element.direction is Direction.INPUT:
                self.values[index], self.raw[index] = 0.0, 0

    def retire(self, error: Exception) -> None:
        """Another has taken its place: who still holds elements of this one gets `error`, not old values."""
        for elements in (*self.inputs.values(), *self.outputs.values()):
            elements.retire(error)

    def carry_on(self, other: ProcessData) -> None:
        """Values of inputs, counts and scalings of `other`, which has the same layouts."""
        for index, scaling in enumerate(other._scalings):
            if scaling != self._scalings[index]:
                self._configure(index, scaling)
        for index, (_, element) in enumerate(self._elements):
            if element.direction is Direction.INPUT:
                self.values[index], self.raw[index] = other.values[index], other.raw[index]
        lib.hm2_process_data_carry_on(self._plan, other._plan)

    def decode(
        self,
        records: Records,
        direction: Direction = Direction.INPUT,
        *,
        dtype: npt.DTypeLike = np.float64,
        out: Mapping[str, npt.NDArray[Any]] | None = None,
    ) -> Columns:
        """Recorded images of one direction to one column per element, with the scaling in use now.

        Keys are element names, with more than one channel `"0.input"`. See `bulk.decode` for the rest.
        """
        image = self.input_image if direction is Direction.INPUT else self.output_image
        shape = (image.shape[0], image.shape[1])
        sources: list[Source] = []
        for channel in self.layouts:
            prefix = f"{channel}." if len(self.layouts) > 1 else ""
            sources += self._sources(channel, direction, channel, prefix)
        return decode(sources, records, shape, dtype, out)

    def _sources(self, channel: int, direction: Direction, row: int, prefix: str) -> list[Source]:
        elements = self.layouts[channel].elements
        sources = []
        for index, (owner, element) in enumerate(self._elements):
            if owner == channel and element.direction is direction and element.is_visible:
                partner = None if element.partner is None else prefix + elements[element.partner].name
                scaling = self._scalings[index]
                sources.append(Source(prefix + element.name, row, element, scaling, partner))
        return sources

    @property
    def plan(self) -> Any:
        """The `struct hm2_process_data *`, for calls into the C core."""
        return self._plan

    def _bind(self, name: str) -> Callable[[], None]:
        """A call that takes the time of the work: handing over the interpreter lock would take longer."""
        function = int(ffi.cast("uintptr_t", ffi.addressof(lib, name)))
        # unpack and pack may outlive this object: they keep alive what the plan points to
        kept = (self._plan, self.values, self.raw, self.input_image, self.output_image)
        return bind(function, int(ffi.cast("uintptr_t", self._plan)), kept)

    def _compile(self) -> Any:
        first = {channel: 0 for channel in self.layouts}
        total = 0
        for channel, layout in self.layouts.items():
            first[channel] = total
            total += len(layout.elements)
        fields = ffi.new("hm2_field[]", max(1, total))
        for index, (channel, element) in enumerate(self._elements):
            _fill_field(fields[index], channel, first[channel], element, self._scalings[index])
        plan, error = ffi.new("struct hm2_process_data **"), new_error()
        status = lib.hm2_process_data_new(
            fields,
            total,
            _image(self.input_image),
            _image(self.output_image),
            ffi.cast("double *", self.values.ctypes.data),
            ffi.cast("uint64_t *", self.raw.ctypes.data),
            plan,
            error,
        )
        if status == lib.HM2_ERR_RANGE and 0 <= error.index < total:
            channel, element = self._elements[error.index]
            raise ValueError(
                f"channel {channel}, {element.name}: {element.field.kind.name} of {element.field.bits} bits "
                f"at bit {element.offset} does not fit: limit {error.expected}, found {error.received}"
            )
        check(status, error)
        # freed without Python: a Ctrl-C that came during it would be lost
        return ffi.gc(plan[0], lib.hm2_process_data_free)

    def _configure(self, index: int, scaling: Scaling) -> None:
        if self.stand_in is not None:
            raise EngineError("scaling and limits stay as they are while a cycle engine runs: stop it first")
        if not scaling.low <= scaling.high:
            raise ValueError(f"limits {scaling.low} .. {scaling.high}")
        name, bits = self._elements[index][1].name, self._elements[index][1].field.bits
        if not 0 <= scaling.invert < 1 << bits:
            raise ValueError(f"{name} has {bits} bits, inversion {scaling.invert} does not fit")
        error = new_error()
        status = lib.hm2_process_data_configure(
            self._plan, index, scaling.scale, scaling.low, scaling.high, scaling.invert, error
        )
        check(status, error)
        self._scalings[index] = scaling


def _fill_field(field: Any, channel: int, first: int, element: Element, scaling: Scaling) -> None:
    field.channel = channel
    field.kind = element.field.kind
    field.direction = element.direction
    field.partner = -1 if element.partner is None else first + element.partner
    field.bits = element.field.bits
    field.offset = element.offset
    field.scale, field.low, field.high = scaling.scale, scaling.low, scaling.high
    field.invert = scaling.invert


def _image(words: Words) -> Any:
    """The shape of an image as the core takes it."""
    if words.ndim != 2 or words.dtype != np.uint32 or any(step < 0 or step % 4 for step in words.strides):
        raise ValueError("an image is a two-dimensional array of uint32: [channel, register]")
    channels, per_channel = words.shape
    if words.size == 0:
        return ffi.new("hm2_image *")
    channel_stride, word_stride = (stride // 4 for stride in words.strides)
    count = (channels - 1) * channel_stride + (per_channel - 1) * word_stride + 1
    address = ffi.cast("uint32_t *", words.ctypes.data)
    return ffi.new("hm2_image *", [address, count, channels, per_channel, channel_stride, word_stride])
