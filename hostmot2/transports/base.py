"""What every transport hands to a Board."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Transport:
    """A bus to one card, opened.

    bus: `hm2_bus *`, taken over by the board. url: as the user wrote it, for messages. model: the board's
    name as the transport knows it ("5I25", "7I80HD-16"), None when only the IDROM can tell. keep: objects
    that must live as long as the bus. virtual_time: its clock stands still unless somebody waits on it.
    on_close: called once, after the bus is closed. on_recover: called before a link that was given up is used
    again. on_give_up: called when that did not succeed. given_up: whether the link is.
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
