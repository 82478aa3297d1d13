"""Errors as people and scripts see them: what, evidence, likely causes, what to do, and an exit code."""

from __future__ import annotations

import json
import re
import shutil
import sys
from contextlib import suppress
from typing import Any

import click

from hostmot2 import errors
from hostmot2.cli.style import bold_red
from hostmot2.lbp import errors as lbp

USAGE, NOT_FOUND, PERMISSION, COMMUNICATION, DEVICE, BUSY = 2, 3, 4, 5, 6, 7

# The first that fits; what derives from another comes before it.
_EXIT_CODES: tuple[tuple[type[BaseException], int], ...] = (
    (errors.CardNotFound, NOT_FOUND),
    (lbp.AdapterMissing, NOT_FOUND),
    (errors.ModuleMissing, NOT_FOUND),
    (errors.NotInDump, NOT_FOUND),
    (errors.PermissionDenied, PERMISSION),
    (errors.CardBusy, BUSY),
    (lbp.AdapterBusy, BUSY),
    (errors.LiveError, BUSY),
    (errors.ReadOnly, USAGE),
    (errors.BrokenDump, DEVICE),
    (errors.FirmwareTooOld, DEVICE),
    (errors.FlashError, DEVICE),
    (lbp.RemoteRefused, DEVICE),
    (lbp.FirmwareRefused, DEVICE),
    (errors.TransportError, COMMUNICATION),
    (errors.HostMot2Error, DEVICE),
    (FileNotFoundError, NOT_FOUND),
    (PermissionError, PERMISSION),
    (ImportError, NOT_FOUND),
    (ValueError, USAGE),
    (KeyError, USAGE),
    (OSError, COMMUNICATION),
)
_CARD_MISPLACED = re.compile("(Got unexpected extra argument|No such command).*://|No such option.*--board")
EXIT_CODES = {
    USAGE: "usage",
    NOT_FOUND: "not found",
    PERMISSION: "permission",
    COMMUNICATION: "communication",
    DEVICE: "device fault",
    BUSY: "busy",
}
"""What each status of the process means, beside 0."""


def exit_code(error: BaseException) -> int:
    """The process's status for an error; 1 for one that is a fault of this program."""
    return exit_code_of(type(error))


def exit_code_of(kind: type[BaseException]) -> int:
    """The process's status for errors of a class; 1 for those that are a fault of this program."""
    return next((code for known, code in _EXIT_CODES if issubclass(kind, known)), 1)


def document(error: BaseException) -> dict[str, Any]:
    """The error for --json."""
    found: dict[str, Any] = {"type": type(error).__name__, "message": message(error)}
    if isinstance(error, errors.HostMot2Error):
        found["code"] = error.code
        found["causes"] = list(error.causes)
        found["fix"] = error.fix
        found["evidence"] = {name: getattr(error, name) for name in errors.NUMBERS}
        found["evidence_lines"] = list(error.evidence)
    return {"error": found | {"exit_code": exit_code(error)}}


def message(error: BaseException) -> str:
    """What happened, in words; a KeyError without its quotes, an OSError without its number."""
    if isinstance(error, errors.HostMot2Error):
        return error.message
    if isinstance(error, KeyError) and error.args:
        return str(error.args[0])
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error) or type(error).__name__


def show(error: BaseException, *, as_json: bool, verbose: bool = False) -> int:
    """Prints the error on stderr (with --json also as a document on stdout) and gives the exit code."""
    if as_json:
        _print(document(error))
    first, *rest = _lines(error)
    click.echo(bold_red("hm2: " + first), err=True)
    for line in rest:
        click.echo(line, err=True)
    if verbose:
        for line in _history(error):
            click.echo(line, err=True)
    return exit_code(error)


def _print(found: dict[str, Any]) -> None:
    """The document on stdout; where that takes nothing (a full disk), the words on stderr must do."""
    with suppress(OSError):
        click.echo(json.dumps(found, indent=2))


def _lines(error: BaseException) -> list[str]:
    width = min(shutil.get_terminal_size().columns, 110) if sys.stderr.isatty() else 110
    if isinstance(error, errors.HostMot2Error):
        return error.report(width).splitlines()
    return [message(error), *(f"  {line}" for line in getattr(error, "__notes__", ()))]


def _history(error: BaseException) -> list[str]:
    """What led to the error, the first last: where it was raised, and each cause behind it."""
    lines = []
    seen: BaseException | None = error
    while seen is not None:
        trace = seen.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        place = f" at {trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}" if trace else ""
        lines.append(f"  raised: {type(seen).__name__}{place}")
        seen = seen.__cause__ or (None if seen.__suppress_context__ else seen.__context__)
        if seen is not None:
            lines.append(f"  because of: {message(seen)}")
    return lines


def show_usage(error: click.ClickException, *, as_json: bool) -> int:
    """The same for what was typed wrongly: how the command is used goes to stderr."""
    if as_json:
        found = {
            "type": type(error).__name__,
            "message": error.format_message(),
            "exit_code": error.exit_code,
        }
        _print({"error": found})
    error.show()
    if _CARD_MISPLACED.match(error.message):
        click.echo("Which card comes before the command: hm2 --board URL COMMAND", err=True)
    return error.exit_code
