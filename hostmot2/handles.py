"""Objects of the C core, freed when nothing in Python refers to them any more."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from hostmot2._bound import bind
from hostmot2._core import ffi


def own(handle: Any, free: Any) -> tuple[Any, object]:
    """The handle, to be freed with `free`, and what to keep beside it.

    cffi frees in a finalizer. In a board that is dropped without close() the collector runs finalizers in any
    order, and `Board.__del__` would then turn outputs off through handles that are gone. The second object,
    which the collector cannot look into, makes the handle outlive every finalizer.
    """
    owned = ffi.gc(handle, free)
    return owned, bind(0, 0, owned)


class _Memory:
    """What numpy makes an array of, and keeps as its base."""

    def __init__(self, address: int, shape: tuple[int, ...], owner: object) -> None:
        self.__array_interface__ = {"data": (address, False), "shape": shape, "typestr": "<u4", "version": 3}
        self._owner = owner


def words_at(pointer: Any, shape: tuple[int, ...], owner: object) -> npt.NDArray[np.uint32]:
    """Words in the core's memory as an array. owner: what keeps that memory; the array keeps it alive.

    A program may hold on to an array for longer than to its board.
    """
    return np.asarray(_Memory(int(ffi.cast("uintptr_t", pointer)), shape, owner))
