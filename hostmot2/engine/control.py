"""Controllers that users compile: what `Engine.add_control` takes for a function and its context."""

from __future__ import annotations

from typing import Any

from hostmot2._bound import bind
from hostmot2._core import ffi, lib

SIGNATURE = "void f(void *context, const double *inputs, double *outputs, double seconds, int enabled)"
ADDRESS_BITS = 8 * int(ffi.sizeof("void *"))
_MADE_IN_PYTHON = type(ffi.new_handle(None))  # cffi's type for whatever leads back into the interpreter


def function_of(function: Any) -> Any:
    """The `hm2_control` of an address, of something with an `address` (numba's cfunc), or of cffi's pointer.

    Raises ValueError for an address that cannot be one, TypeError for anything else than such a function.
    """
    if isinstance(function, ffi.CData):
        return _of_cffi(function)
    return ffi.cast("hm2_control", _address(getattr(function, "address", function)))


def _address(address: Any) -> int:
    if not isinstance(address, int) or isinstance(address, bool):
        raise TypeError(
            f"a controller is a compiled function, as an address or a pointer of cffi, not {address!r}: "
            f"`{SIGNATURE}`. Of ctypes: ctypes.cast(f, ctypes.c_void_p).value"
        )
    if not 0 < address < 1 << ADDRESS_BITS:
        raise ValueError(f"no function is at address {address:#x}")
    return address


def _of_cffi(pointer: Any) -> Any:
    if isinstance(pointer, _MADE_IN_PYTHON):
        raise TypeError("a callback of cffi is Python: every cycle would wait for the interpreter")
    if not _is_controller(ffi.typeof(pointer)):
        raise TypeError(f"{pointer!r} is no pointer to `{SIGNATURE}`")
    if not pointer:
        raise ValueError("a controller at address 0")
    return ffi.cast("hm2_control", pointer)


def _is_controller(kind: Any) -> bool:
    """A `void *` will do: it says as little as an address. Types of another FFI object are not ours."""
    if kind.kind != "function":
        return bool(kind.cname == "void *")
    arguments = [argument.cname for argument in kind.args]
    return (
        kind.result.cname == "void"
        and not kind.ellipsis
        and len(arguments) == 5
        and kind.args[0].kind == "pointer"
        and arguments[1:4] == ["double *", "double *", "double"]
        and arguments[4] in ("int", "int32_t")
    )


def context_of(context: Any) -> Any:
    """What becomes the function's `void *`: an address, a pointer of cffi, or the memory of a writable array.

    Raises TypeError for anything else.
    """
    if context is None:
        return ffi.NULL
    if isinstance(context, ffi.CData) and ffi.typeof(context).kind in ("pointer", "array"):
        return context
    if isinstance(context, int) and not isinstance(context, bool) and 0 <= context < 1 << ADDRESS_BITS:
        return ffi.cast("void *", context)
    try:
        return ffi.from_buffer(context, require_writable=True)
    except (TypeError, ValueError, BufferError):
        raise TypeError(
            f"a context is None, an address, a pointer of cffi or a writable array, not {context!r}"
        ) from None


class Controls:
    """The controllers of an engine, in the order they run."""

    def __init__(self) -> None:
        self.pointers: list[tuple[Any, Any]] = []
        """Function and context of each, for the core."""
        self._kept: list[Any] = []  # hidden from the collector: the thread runs until its board is closed

    def add(self, function: Any, context: Any) -> None:
        """Raises TypeError and ValueError; see Engine.add_control."""
        if len(self.pointers) == lib.HM2_ENGINE_CONTROLS:
            raise ValueError(f"an engine runs {lib.HM2_ENGINE_CONTROLS} compiled controllers at most")
        self.pointers.append((function_of(function), context_of(context)))
        self._kept.append(bind(0, 0, (function, context)))
