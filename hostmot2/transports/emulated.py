"""emu://: an emulated card in this process. The only file that imports both sides."""

from __future__ import annotations

from typing import Any
from urllib.parse import parse_qsl, unquote, urlsplit

from hostmot2 import dump
from hostmot2._core import ffi, lib
from hostmot2.emulator import EmulatedBoard
from hostmot2.transports.base import Transport

_OPTIONS = {"clock": ("real", "virtual"), "wire": ("on", "off"), "firmware": ("a", "b")}


def open_transport(url: str) -> Transport:
    """Make the emulated card that `url` describes, such as emu://5i25+7i77?clock=virtual&wire=off.

    emu:///path/board.hm2dump makes one with the IDROM of that dump: the same modules and pins, in power-up
    state, with nothing connected.
    """
    parts = urlsplit(url)
    spec = parts.netloc + parts.path
    options = dict(parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query)))
    for name, value in options.items():
        if name not in _OPTIONS:
            raise ValueError(f"{url}: unknown option {name!r}; there are {', '.join(_OPTIONS)}")
        if value not in _OPTIONS[name]:
            raise ValueError(f"{url}: {name} must be {' or '.join(_OPTIONS[name])}, not {value!r}")
    return transport_of(_card(spec, options), url)


def _card(name: str, options: dict[str, str]) -> EmulatedBoard:
    clock: Any = options.get("clock", "real")
    wire: Any = options.get("wire", "on")
    spec = dump.load(unquote(name)).idrom_words() if name.startswith("/") else name
    return EmulatedBoard(spec, clock=clock, wire=wire, firmware=options.get("firmware"))


def transport_of(card: EmulatedBoard, url: str | None = None) -> Transport:
    """A driver's transport on an emulated card that someone else owns; closing leaves the card running."""
    bus = ffi.new("hm2_bus *")
    lib.hm2_emulator_bus(card.handle, bus)
    name = card.description.name if card.description else "custom"
    return Transport(bus=bus, url=url or f"emu://{name}", keep=(card,), virtual_time=card.clock == "virtual")
