"""Which URL opens which transport.

A transport is a function `open_transport(url: str) -> Transport`. The rows below are imported when first
used; other packages add theirs with an entry point of the group `hostmot2.transports`, its name being the
URL's scheme.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from importlib.metadata import entry_points
from typing import cast
from urllib.parse import urlsplit

from hostmot2.errors import CardNotFound
from hostmot2.transports.base import Transport

TRANSPORTS: dict[str, str] = {
    "emu": "hostmot2.transports.emulated",
    "pci": "hostmot2.transports.pci",
    "dump": "hostmot2.transports.dump",
    "udp": "hostmot2.transports.udp",
}
"""URL scheme -> module with a function open_transport(url), and open_unlocked(url) if that locks the card."""

ENTRY_POINTS = "hostmot2.transports"


def schemes() -> list[str]:
    """The URL schemes that can be opened, those of other packages included."""
    return sorted({*TRANSPORTS, *(point.name for point in entry_points(group=ENTRY_POINTS))})


def open_transport(url: str, *, read_only: bool = False) -> Transport:
    """Open the transport that `url` names. read_only: only to look, beside whoever drives the card.

    Raises ValueError for a URL without a known scheme, CardNotFound when the transport is not there,
    and what the transport itself raises.
    """
    scheme = urlsplit(url).scheme
    opener = _opener(scheme, read_only=read_only)
    if opener is None:
        raise ValueError(
            f"{url!r}: the scheme must be one of {', '.join(f'{name}://' for name in schemes())}"
        )
    return opener(url)


def _opener(scheme: str, *, read_only: bool) -> Callable[[str], Transport] | None:
    if scheme in TRANSPORTS:
        try:
            module = importlib.import_module(TRANSPORTS[scheme])
        except ModuleNotFoundError as error:
            raise CardNotFound(f"the {scheme}:// transport cannot be used here: {error}") from error
        driving: Callable[[str], Transport] = module.open_transport
        return getattr(module, "open_unlocked", driving) if read_only else driving
    for point in entry_points(group=ENTRY_POINTS, name=scheme):
        return cast("Callable[[str], Transport]", point.load())
    return None
