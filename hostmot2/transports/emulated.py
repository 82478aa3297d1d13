"""emu://: an emulated card in this process. The only file that imports both sides."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from urllib.parse import parse_qsl, unquote, urlsplit

from hostmot2 import dump
from hostmot2._core import ffi, lib
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.described import DescribedRemote
from hostmot2.transports.base import Transport

_OPTIONS = {"clock": ("real", "virtual"), "wire": ("on", "off"), "firmware": ("a", "b")}
_CHANNELS = ("silent", "setup")
"""Options whose values are smart-serial channels: `1`, `0.1` (port, channel) or several with commas."""


def open_transport(url: str) -> Transport:
    """Make the emulated card that `url` describes, such as emu://5i25+7i77?clock=virtual&wire=off.

    silent=0 takes the power from the remote on that smart-serial channel; setup=1 has its set-up jumper in
    place. emu:///path/board.hm2dump makes one with the IDROM of that dump: the same modules and pins, in
    power-up state, with nothing connected.
    """
    parts = urlsplit(url)
    spec = parts.netloc + parts.path
    options = dict(parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query)))
    for name, value in options.items():
        if name not in (*_OPTIONS, *_CHANNELS):
            known = ", ".join((*_OPTIONS, *_CHANNELS))
            raise ValueError(f"{url}: unknown option {name!r}; there are {known}")
        if name in _OPTIONS and value not in _OPTIONS[name]:
            raise ValueError(f"{url}: {name} must be {' or '.join(_OPTIONS[name])}, not {value!r}")
    card = _card(spec, options)
    for remote in _remotes(card, options.get("silent", ""), f"{url}: silent"):
        remote.alive = False
    for remote in _remotes(card, options.get("setup", ""), f"{url}: setup"):
        remote.setup_jumper = True
        remote.power_cycle()
    return transport_of(card, url)


def _card(name: str, options: dict[str, str]) -> EmulatedBoard:
    clock: Any = options.get("clock", "real")
    wire: Any = options.get("wire", "on")
    spec = dump.load(unquote(name)).idrom_words() if name.startswith("/") else name
    return EmulatedBoard(spec, clock=clock, wire=wire, firmware=options.get("firmware"))


def _remotes(card: EmulatedBoard, places: str, where: str) -> Iterator[DescribedRemote]:
    for text in filter(None, places.split(",")):
        port, _, channel = text.rpartition(".")
        try:
            remote = card.sserial[int(port or 0)].remote(int(channel))
        except (ValueError, LookupError):
            remote = None
        if not isinstance(remote, DescribedRemote):
            raise ValueError(f"{where}={text}: there is no remote; PORT.CHANNEL, such as 0.1")
        yield remote


def transport_of(card: EmulatedBoard, url: str | None = None) -> Transport:
    """A driver's transport on an emulated card that someone else owns; closing leaves the card running."""
    bus = ffi.new("hm2_bus *")
    lib.hm2_emulator_bus(card.handle, bus)
    name = card.description.name if card.description else "custom"
    return Transport(bus=bus, url=url or f"emu://{name}", keep=(card,), virtual_time=card.clock == "virtual")
