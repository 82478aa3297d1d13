"""Every error of the package, for `hm2 explain` and the pages of docs/reference/errors."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
from collections.abc import Iterator
from pathlib import Path

import hostmot2
from hostmot2.cli import failure
from hostmot2.errors import NUMBERS, HostMot2Error

_PACKAGE = Path(hostmot2.__path__[0])


def all_errors() -> list[type[HostMot2Error]]:
    """Every error of the package by its code, those of parts not used yet included."""
    for path in sorted(_PACKAGE.rglob("errors.py")):
        _load(path)
    ours = (kind for kind in _with_subclasses(HostMot2Error) if kind.__module__.startswith("hostmot2."))
    return sorted(ours, key=lambda kind: kind.code)


def _load(path: Path) -> None:
    """Import a module of errors, also where the package around it needs what is not installed."""
    name = ".".join(("hostmot2", *path.relative_to(_PACKAGE).with_suffix("").parts))
    try:
        importlib.import_module(name)
    except ImportError:
        if name in sys.modules:
            return
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        assert spec.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])


def _with_subclasses(kind: type[HostMot2Error]) -> Iterator[type[HostMot2Error]]:
    yield kind
    for each in kind.__subclasses__():
        yield from _with_subclasses(each)


def find(name: str) -> type[HostMot2Error] | None:
    """The error of a code (HM2-E021, E021, 21) or of a class's name, in any capitals."""
    wanted = name.strip().upper().removeprefix("HM2-")
    if wanted.isdigit():
        wanted = f"E{int(wanted):03}"
    for kind in all_errors():
        if wanted in (short(kind), kind.__name__.upper()):
            return kind
    return None


def short(kind: type[HostMot2Error]) -> str:
    """The code without its prefix: E021."""
    return kind.code.removeprefix("HM2-")


def meaning(kind: type[HostMot2Error]) -> str:
    """What the class stands for, its first paragraph; the rest of its docstring is for programs."""
    return " ".join(paragraphs(kind)[0].split())


def paragraphs(kind: type[HostMot2Error]) -> list[str]:
    """The class's docstring in paragraphs."""
    return (inspect.getdoc(kind) or "").split("\n\n")


def bases(kind: type[HostMot2Error]) -> list[str]:
    """What an `except` may name to catch it, the nearest first."""
    return [base.__name__ for base in kind.__mro__[1:] if base not in (object, BaseException, Exception)]


def exit_meaning(kind: type[HostMot2Error]) -> str:
    """What the process's status for this error stands for."""
    return failure.EXIT_CODES[failure.exit_code_of(kind)]


def document(kind: type[HostMot2Error]) -> dict[str, object]:
    """Everything about an error, as JSON takes it."""
    return {
        "code": kind.code,
        "error": kind.__name__,
        "meaning": inspect.getdoc(kind) or "",
        "causes": list(kind.causes),
        "fix": kind.fix,
        "evidence": list(NUMBERS),
        "also": bases(kind),
        "exit_code": failure.exit_code_of(kind),
    }


def public_module(kind: type[HostMot2Error]) -> str:
    """Where to import the class from: the package that re-exports it, else its own module."""
    package = kind.__module__.rpartition(".")[0]
    while package in sys.modules:
        if getattr(sys.modules[package], kind.__name__, None) is kind:
            return package
        package = package.rpartition(".")[0] if package.endswith(".errors") else ""
    return kind.__module__
