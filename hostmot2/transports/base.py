"""What every transport hands to a Board."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class LinkCounters:
    """What happened on the link to an Ethernet card since it was opened (hm2_udp_counters in csrc/hm2.h).

    exchanges: came back whole. requests: datagrams sent. replies: taken. missed: given up without a reply.
    requests_lost: never carried out, as the card says. writes_lost: events after which writes are in doubt.
    discarded: replies that were late or came twice. malformed: of a wrong length. repeated: requests that
    reached the card twice. out_of_order: old requests carried out after newer ones. foreign: another program
    used the card in between. retries: requests sent again. error_level, failed: see LinkFailed.
    """

    exchanges: int
    requests: int
    replies: int
    missed: int
    requests_lost: int
    writes_lost: int
    discarded: int
    malformed: int
    repeated: int
    out_of_order: int
    foreign: int
    retries: int
    error_level: int
    failed: bool


@dataclass
class Transport:
    """A bus to one card, opened.

    bus: `hm2_bus *`, taken over by the board. url: as the user wrote it, for messages. model: the board's
    name as the transport knows it ("5I25", "7I80HD-16"), None when only the IDROM can tell. keep: objects
    that must live as long as the bus. virtual_time: its clock stands still unless somebody waits on it.
    on_close: called once, after the bus is closed. on_recover: called before a link that was given up is used
    again. on_give_up: called when that did not succeed. given_up: whether the link is. link_counters: what
    happened on a network; None where there is none.
    """

    bus: Any
    url: str
    model: str | None = None
    read_only: bool = False
    keep: tuple[object, ...] = ()
    virtual_time: bool = False
    on_close: list[Callable[[], None]] = field(default_factory=list)
    on_recover: list[Callable[[], None]] = field(default_factory=list)
    on_give_up: list[Callable[[], None]] = field(default_factory=list)
    given_up: Callable[[], bool] = lambda: False
    link_counters: Callable[[], LinkCounters] | None = None
