"""Objects of the C core, freed when nothing in Python refers to them any more."""

from __future__ import annotations

from typing import Any

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
