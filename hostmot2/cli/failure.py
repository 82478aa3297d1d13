"""Errors as people and scripts see them: a message, what helps, and an exit code."""

from __future__ import annotations

import json
from typing import Any

import click

from hostmot2 import errors
from hostmot2.lbp import errors as lbp

USAGE, NOT_FOUND, PERMISSION, COMMUNICATION, DEVICE, BUSY = 2, 3, 4, 5, 6, 7

# The first that fits; what derives from another comes before it.
_EXIT_CODES: tuple[tuple[type[BaseException], int], ...] = (
    (errors.CardNotFound, NOT_FOUND),
    (lbp.AdapterMissing, NOT_FOUND),
    (errors.ModuleMissing, NOT_FOUND),
    (errors.PermissionDenied, PERMISSION),
    (errors.CardBusy, BUSY),
    (lbp.AdapterBusy, BUSY),
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

EVIDENCE = ("address", "index", "expected", "received", "os_errno")


def exit_code(error: BaseException) -> int:
    """The process's status for an error; 1 for one that is a fault of this program."""
    return next((code for kind, code in _EXIT_CODES if isinstance(error, kind)), 1)


def document(error: BaseException) -> dict[str, Any]:
    """The error for --json."""
    found: dict[str, Any] = {"type": type(error).__name__, "message": message(error)}
    if isinstance(error, errors.HostMot2Error):
        found["code"] = error.code
        found["fix"] = error.fix
        found["evidence"] = {name: getattr(error, name) for name in EVIDENCE}
    return {"error": found | {"exit_code": exit_code(error)}}


def message(error: BaseException) -> str:
    """What happened, on a line; a KeyError without its quotes."""
    if isinstance(error, KeyError) and error.args:
        return str(error.args[0])
    return str(error) or type(error).__name__


def show(error: BaseException, *, as_json: bool) -> int:
    """Prints the error on stderr (with --json also as a document on stdout) and gives the exit code."""
    if as_json:
        click.echo(json.dumps(document(error), indent=2))
    click.echo(f"hm2: {message(error)}", err=True)
    for note in getattr(error, "__notes__", ()):
        click.echo(f"  {note}", err=True)
    if isinstance(error, errors.HostMot2Error):
        if error.fix and error.fix not in message(error):
            click.echo(f"  {error.fix}", err=True)
        click.echo(f"  more: hm2 explain {error.code}", err=True)
    return exit_code(error)


def show_usage(error: click.ClickException, *, as_json: bool) -> int:
    """The same for what was typed wrongly: how the command is used goes to stderr."""
    if as_json:
        found = {
            "type": type(error).__name__,
            "message": error.format_message(),
            "exit_code": error.exit_code,
        }
        click.echo(json.dumps({"error": found}, indent=2))
    error.show()
    return error.exit_code
