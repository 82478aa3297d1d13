"""hm2 explain: error codes and status words in words."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator

import click

import hostmot2
from hostmot2.cli.session import Session, reports, rows
from hostmot2.errors import HostMot2Error
from hostmot2.sserial import ChannelStatus


@click.command()
@click.argument("what", required=False, metavar="[CODE|CS=WORD]")
@reports
def explain(session: Session, what: str | None) -> None:
    """What an error code (HM2-E021, E021 or NoRemote) or a channel's status word (CS=0x04422140) means.

    Without an argument all codes are listed.
    """
    if what is None:
        known = sorted(_errors(), key=lambda error: error.code)
        document = [_document(error) for error in known]
        lines = [(error.code, error.__name__, _first_line(error)) for error in known]
        session.report(document, rows(("code", "error", "meaning"), lines))
    elif what.upper().startswith("CS="):
        _explain_status(session, what[3:])
    else:
        found = _find(what)
        session.report(
            _document(found), f"{found.code} {found.__name__}", inspect.getdoc(found) or "", found.fix
        )


def _explain_status(session: Session, text: str) -> None:
    try:
        status = ChannelStatus(int(text, 0) & 0xFFFFFFFF)
    except ValueError:
        raise click.UsageError(f"{text!r} is not a number") from None
    document = {"cs": status.word, "state": status.state, "live": status.live, "sticky": status.sticky}
    lines = [
        ("state", status.state),
        ("now", ", ".join(status.live) or "nothing wrong"),
        ("since the last stop", ", ".join(status.sticky) or "nothing"),
    ]
    session.report(document, rows((), lines))


def _find(what: str) -> type[HostMot2Error]:
    wanted = what.upper().removeprefix("HM2-")
    for error in _errors():
        if wanted in (error.code.removeprefix("HM2-"), error.__name__.upper()):
            return error
    raise click.UsageError(f"there is no error {what!r}; `hm2 explain` lists all")


def _errors() -> Iterator[type[HostMot2Error]]:
    """Every error that has a code of its own, those of parts not used yet included."""
    for module in pkgutil.walk_packages(hostmot2.__path__, "hostmot2."):
        if module.name.endswith(".errors"):
            importlib.import_module(module.name)
    waiting: list[type[HostMot2Error]] = [HostMot2Error]
    while waiting:
        error = waiting.pop()
        waiting += error.__subclasses__()
        if "code" in vars(error):
            yield error


def _first_line(error: type[HostMot2Error]) -> str:
    return (inspect.getdoc(error) or "").partition("\n")[0]


def _document(error: type[HostMot2Error]) -> dict[str, str]:
    return {
        "code": error.code,
        "error": error.__name__,
        "meaning": inspect.getdoc(error) or "",
        "fix": error.fix,
    }
