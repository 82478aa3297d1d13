"""hm2 explain: error codes and status words in words."""

from __future__ import annotations

import click

from hostmot2.cli import catalogue
from hostmot2.cli.session import Session, reports, rows
from hostmot2.errors.base import HostMot2Error, numbered
from hostmot2.sserial import ChannelStatus


@click.command()
@click.argument("what", required=False, metavar="[CODE|CS=WORD]")
@reports
def explain(session: Session, what: str | None) -> None:
    """What an error code (HM2-E021, E021 or NoRemote) or a channel's status word (CS=0x04422140) means.

    Without an argument all codes are listed.
    """
    if what is None:
        known = catalogue.all_errors()
        document = [catalogue.document(error) for error in known]
        lines = [(error.code, error.__name__, catalogue.meaning(error)) for error in known]
        session.report(document, rows(("code", "error", "meaning"), lines))
    elif what.upper().startswith("CS="):
        _explain_status(session, what[3:])
    else:
        found = _find(what)
        session.report(
            catalogue.document(found),
            f"{found.code} {found.__name__}",
            catalogue.meaning(found),
            *numbered(found.causes),
            found.fix,
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
    found = catalogue.find(what)
    if found is None:
        raise click.UsageError(f"there is no error {what!r}; `hm2 explain` lists all")
    return found
