"""The exception tree: complete, documented, with stable codes."""

from __future__ import annotations

import inspect
import re

import pytest

from hostmot2 import errors
from hostmot2._core import lib

CLASSES = [
    kind for _, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, errors.HostMot2Error)
]


def tree() -> list[tuple[str, str]]:
    """(class, parent) pairs of the tree drawn in the module's docstring."""
    pairs: list[tuple[str, str]] = []
    path: dict[int, str] = {}
    for line in (errors.__doc__ or "").splitlines():
        found = re.match(r"    ([ |]*)(\+-- )?([A-Z]\w+)", line)
        if found and (found[2] or found[3] == "HostMot2Error"):
            depth = len(found[1]) + len(found[2] or "")
            path = {at: name for at, name in path.items() if at < depth}
            pairs.append((found[3], path[max(path)] if path else "Exception"))
            path[depth] = found[3]
    return pairs


def test_the_drawn_tree_is_the_tree() -> None:
    assert sorted(tree()) == sorted((kind.__name__, kind.__bases__[0].__name__) for kind in CLASSES)


def test_codes_are_well_formed_and_unique() -> None:
    codes = [kind.__dict__.get("code", "") for kind in CLASSES]
    assert all(re.fullmatch(r"HM2-E\d{3}", code) for code in codes)
    assert len(set(codes)) == len(codes)


def test_every_class_says_what_it_means() -> None:
    assert all(kind.__dict__.get("__doc__") for kind in CLASSES)


def test_a_message_starts_with_the_code_and_keeps_its_evidence() -> None:
    error = errors.WrongCookie("text", address=0x100, expected=1, received=2)
    assert str(error) == "HM2-E053: text"
    assert (error.address, error.expected, error.received, error.index) == (0x100, 1, 2, None)


@pytest.mark.parametrize("name", [name for name in dir(lib) if name.startswith("HM2_ERR_")])
def test_every_status_raises(name: str) -> None:
    error = errors.new_error()
    with pytest.raises((errors.HostMot2Error, ValueError, MemoryError)):
        errors.check(getattr(lib, name), error)


def test_timeouts_and_permissions_are_also_the_builtin_kinds() -> None:
    assert issubclass(errors.TransportTimeout, TimeoutError)
    assert issubclass(errors.KernelLockdown, PermissionError)
