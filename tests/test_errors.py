"""The exception tree: complete, documented, with stable codes, likely causes and what to do."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
import traceback
from pathlib import Path

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2._core import lib
from hostmot2.cli.catalogue import all_errors, find
from hostmot2.lbp.errors import UpdateFailed
from hostmot2.sserial.errors import BrokenTable, NotStarted, SetupJumper

ROOT = Path(__file__).parent.parent
CODES = Path(__file__).parent / "error_codes.txt"
CLASSES = [
    kind for _, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, errors.HostMot2Error)
]
ALL = all_errors()


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


def test_the_catalogue_has_every_error_of_the_package() -> None:
    """A module of errors is called `errors`; one that is defined elsewhere would not be explained."""
    for module in pkgutil.walk_packages(hostmot2.__path__, "hostmot2."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    waiting, found = [errors.HostMot2Error], set()
    while waiting:
        kind = waiting.pop()
        waiting += kind.__subclasses__()
        found |= {kind} if kind.__module__.startswith("hostmot2.") else set()
    assert {kind.__name__ for kind in found} == {kind.__name__ for kind in ALL}
    assert all(".errors" in kind.__module__ for kind in found)


def test_codes_are_well_formed_and_unique() -> None:
    codes = [vars(kind).get("code", "") for kind in ALL]
    assert all(re.fullmatch(r"HM2-E\d{3}", code) for code in codes)
    assert len(set(codes)) == len(codes)


def test_codes_never_change() -> None:
    """tests/error_codes.txt is only ever added to; a code given up stays there as `retired`."""
    kept = dict(line.split() for line in CODES.read_text().splitlines() if not line.startswith("#"))
    assert len(kept) == sum(not line.startswith("#") for line in CODES.read_text().splitlines())
    now = {kind.code: kind.__name__ for kind in ALL}
    for code, name in kept.items():
        assert now.get(code, "retired") == name, f"{code} meant {name}"
    assert set(now) <= set(kept), f"add to {CODES.name}: {sorted(set(now) - set(kept))}"


@pytest.mark.parametrize("kind", ALL, ids=lambda kind: kind.__name__)
def test_every_error_says_what_why_and_what_to_do(kind: type[errors.HostMot2Error]) -> None:
    assert vars(kind).get("__doc__")
    assert vars(kind).get("causes"), "likely causes of its own"
    assert vars(kind).get("fix"), "a remedy of its own"
    assert not isinstance(kind.causes, str)
    assert all(cause == cause.strip() and cause for cause in (*kind.causes, kind.fix))


@pytest.mark.parametrize("kind", ALL, ids=lambda kind: kind.__name__)
def test_commands_named_in_advice_exist(kind: type[errors.HostMot2Error]) -> None:
    from hostmot2.cli.main import COMMANDS

    for text in (*kind.causes, kind.fix):
        for name in re.findall(r"hm2 ([a-z][a-z-]*)", text):
            assert name in {*COMMANDS, "doctor"}, text


def test_a_message_starts_with_the_code_and_keeps_its_evidence() -> None:
    error = errors.WrongCookie("text", address=0x100, expected=1, received=2)
    assert str(error) == "HM2-E053: text"
    assert (error.address, error.expected, error.received, error.index) == (0x100, 1, 2, None)


def test_a_report_has_its_parts_in_order() -> None:
    error = errors.TransportTimeout(
        "no answer", address=0x100, received=0xFFFFFFFF, os_errno=110, evidence=("three of ten came back",)
    )
    error.add_note("tried 8 times")
    parts = [line for line in error.report().splitlines() if not line.startswith(" " * 4)]
    heads = [line.split()[0] for line in parts]
    assert heads == ["HM2-E011", "Evidence:", "Likely:", "Do:", "More:"]
    assert parts[0] == "HM2-E011 TransportTimeout: no answer"
    assert "at 0x0100, received 0xFFFFFFFF (4294967295), errno 110" in parts[1]
    assert "three of ten came back" in error.report()
    assert error.report().count("tried 8 times") == 1
    assert error.report().count(error.fix[:20]) == 1
    assert parts[2].split(maxsplit=1)[1].startswith("1. ")
    assert parts[4].endswith("hm2 explain E011")


@pytest.mark.parametrize(
    ("error", "named"),
    [
        (NotStarted("text", index=2), "channel 2"),
        (SetupJumper("text", index=0), "channel 0"),
        (BrokenTable("text", index=3), "entry 3"),
        (errors.DataLost("text", index=1), "instance 1"),
        (errors.PinInUse("text", index=17), "pin 17"),
        (errors.UnsupportedModule("text", index=5), "descriptor 5"),
        (errors.PinOutOfRange("text", index=40), "pin 40"),
        (errors.BrokenDump("text", index=12), "line 12"),
        (errors.NotInDump("text", index=4), "transfer 4"),
        (UpdateFailed("text", index=7), "block 7"),
        (errors.HostMot2Error("text", index=9), "index 9"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Exception) else "",
)
def test_a_report_says_what_the_index_counts(error: errors.HostMot2Error, named: str) -> None:
    assert f"  Evidence: {named}\n" in error.report()


def test_an_error_may_know_its_causes_better_than_its_class() -> None:
    error = errors.TransportTimeout("no answer", causes=("the moon",), fix="Wait.")
    assert error.causes == ("the moon",)
    assert errors.TransportTimeout.causes[0].startswith("the card")
    assert "the moon" in str(error)
    assert "Wait." in error.report()


def test_a_traceback_shows_what_to_do() -> None:
    with pytest.raises(errors.CardBusy) as caught:
        raise errors.CardBusy("5I25 is driven by pid 4121")
    text = "".join(traceback.format_exception(caught.value))
    assert "end the process named in the message" in text
    assert "hm2 explain E013" in text


@pytest.mark.parametrize("name", ["E053", "HM2-E053", "wrongcookie", "53", "hm2-e053"])
def test_an_error_is_found_by_any_of_its_names(name: str) -> None:
    assert find(name) is errors.WrongCookie
    assert find("E999") is None


@pytest.mark.parametrize("name", [name for name in dir(lib) if name.startswith("HM2_ERR_")])
def test_every_status_raises(name: str) -> None:
    builtin = {"HM2_ERR_RANGE": ValueError, "HM2_ERR_ALIGN": ValueError, "HM2_ERR_NO_MEMORY": MemoryError}
    with pytest.raises(builtin.get(name, errors.HostMot2Error)):
        errors.check(getattr(lib, name), errors.new_error())


def test_timeouts_and_permissions_are_also_the_builtin_kinds() -> None:
    assert issubclass(errors.TransportTimeout, TimeoutError)
    assert issubclass(errors.KernelLockdown, PermissionError)
