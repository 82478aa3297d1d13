"""Where a remote is: behind an adapter (--port), or on a channel of the card (--channel)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

import click

from hostmot2.cli.serial_remote import remote_at
from hostmot2.cli.session import Session
from hostmot2.cli.sserial import port_of
from hostmot2.lbp import LbpRemote, describe
from hostmot2.remotes.discovery import RemoteDescription
from hostmot2.remotes.parameters import Parameters

if TYPE_CHECKING:
    from hostmot2.sserial import SserialPort

Place = tuple[int, int]
PLACE = re.compile(r"(?:(\d)\.)?(\d)")


def parse_place(text: str) -> Place:
    """PORT.CHANNEL or CHANNEL of port 0. ValueError for anything else."""
    found = PLACE.fullmatch(text)
    if not found:
        raise ValueError(f"{text!r} is no PORT.CHANNEL such as 0.1")
    return int(found[1] or 0), int(found[2])


def _channel(_context: click.Context, _parameter: click.Parameter, text: str | None) -> Place | None:
    try:
        return parse_place(text) if text else None
    except ValueError as mistake:
        raise click.BadParameter(str(mistake)) from None


def place_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """--channel."""
    return click.option(
        "-c",
        "--channel",
        callback=_channel,
        metavar="PORT.CHANNEL",
        help="On the card (--board), such as 0.1; instead of --port.",
    )(command)


def _port(stack: ExitStack, session: Session, place: Place) -> SserialPort:
    _, port = stack.enter_context(port_of(session, place[0]))
    if place[1] >= len(port.channels):
        raise click.UsageError(f"there is no channel {place[1]}: port {place[0]} has {len(port.channels)}")
    return port


@contextmanager
def remote_in_place(
    session: Session, channel: Place | None, port: str | None, baud: int | None, *, flash: bool = False
) -> Iterator[LbpRemote]:
    """The remote, spoken to by LBP. flash: a card uses the rate of set-up mode, as an update needs."""
    if channel is None:
        with remote_at(port, baud) as remote:
            yield remote
        return
    from hostmot2.lbp.card import check_flash_revision, open_channel, setup_rate

    with ExitStack() as stack:
        card_port = _port(stack, session, channel)
        if flash:
            stack.enter_context(setup_rate(card_port, channel[1], baud or 115200))
        remote = stack.enter_context(open_channel(card_port, channel[1]))
        if flash:
            check_flash_revision(card_port, remote.name)
        yield remote


@contextmanager
def parameters_in_place(
    session: Session, channel: Place | None, port: str | None, baud: int | None
) -> Iterator[tuple[RemoteDescription, Parameters]]:
    """What the remote is, and its parameters; with neither --port nor --channel those of channel 0.0."""
    with ExitStack() as stack:
        if channel is None and port is not None:
            remote = stack.enter_context(remote_at(port, baud))
            found = describe(remote)
            found.raise_for_parameters()
            yield found, Parameters(remote, found.parameters, found.aliases)
            return
        place = channel or (0, 0)
        card_channel = _port(stack, session, place).channels[place[1]]
        found = card_channel.discover()
        yield found, card_channel.parameters
