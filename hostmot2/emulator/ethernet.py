"""An emulated Ethernet card: the LBP16 engine in front of an emulated board, and its UDP server.

Packets are handled by one C thread; Python only starts, steers and stops it.
"""

from __future__ import annotations

import ipaddress
import logging
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Any, Final, Protocol, Self

from hostmot2 import flash_layout
from hostmot2._core import ffi, lib
from hostmot2.emulator.cards import CARD_NAMES
from hostmot2.errors import TransportClosed, check, new_error
from hostmot2.handles import own

log = logging.getLogger(__name__)

REQUESTS: Final = lib.HM2_ETHERNET_REQUESTS
REPLIES: Final = lib.HM2_ETHERNET_REPLIES


class Emulator(Protocol):
    """What the engine needs of an emulated board."""

    @property
    def handle(self) -> Any:
        """The `hm2_emulator *`, valid as long as the board lives."""


@dataclass(frozen=True)
class EthernetDescription:
    """What an Ethernet card says of itself beside its HostMot2 registers (lbp16.md 5, boards.md 1)."""

    name: str
    """Up to 16 ASCII characters, as in the card's information space; clients decide by it."""
    flash_id: int = 0x14
    """Electronic signature of the flash: 0x14 is 16 Mbit."""
    efinix: bool = False
    """A T card: other flash layout and reload words."""
    mac: str = "00:60:1b:10:12:34"
    ip: str = "10.10.10.10"
    """The address in the EEPROM; used by jumper setting 1."""
    jumpers: int = 1
    """0 fixed 192.168.1.121, 1 EEPROM address, 2 BOOTP."""
    lbp_version: int = 3
    firmware_version: int = 15
    erase_us: int = 0
    """Time a sector erase takes (a real part: about half a second)."""
    restart_us: int = 100_000
    """Silence after an engine reset."""
    reload_us: int = 200_000
    """Silence after an FPGA reload (a real card: about two seconds)."""


DESCRIPTIONS: Final[dict[str, EthernetDescription]] = {
    "7i92": EthernetDescription("7I92"),
    "7i76e": EthernetDescription("7I76E-16"),
    "7i96": EthernetDescription("7I96"),
    "7i80hd": EthernetDescription("7I80HD-16"),
}
"""By the first part of a card spec; of those cards only that have an emulated firmware."""


def _first(spec: str) -> str:
    return spec.lower().split("+")[0]


def description(spec: str) -> EthernetDescription:
    """The description for a card spec such as `7i92+7i77`; ValueError when there is no such Ethernet card."""
    if _first(spec) not in DESCRIPTIONS:
        served = ", ".join(name for name in CARD_NAMES if _first(name) in DESCRIPTIONS)
        raise ValueError(f"no emulated Ethernet card {spec!r}; there are {served}")
    return DESCRIPTIONS[_first(spec)]


def _mac_bytes(mac: str) -> bytes:
    octets = bytes.fromhex(mac.replace(":", "").replace("-", ""))
    if len(octets) != 6 or octets[0] & 1 or not any(octets):
        raise ValueError(f"{mac} is no station's MAC address")
    return octets


def _c_config(description: EthernetDescription) -> Any:
    name = description.name.encode("ascii")
    if len(name) > 16:
        raise ValueError(f"card name {description.name} is longer than 16 characters")
    if not 0 <= description.jumpers <= 3:
        raise ValueError(f"IP jumpers are 0 to 3, not {description.jumpers}")
    return ffi.new(
        "hm2_ethernet_config *",
        {
            "name": name.ljust(16, b"\0"),
            "mac": list(_mac_bytes(description.mac)),
            "ip": list(ipaddress.IPv4Address(description.ip).packed),
            "jumpers": description.jumpers,
            "flash_id": description.flash_id,
            "efinix": description.efinix,
            "lbp_version": description.lbp_version,
            "firmware_version": description.firmware_version,
            "erase_us": description.erase_us,
            "restart_us": description.restart_us,
            "reload_us": description.reload_us,
        },
    )


class EthernetCard:
    """The LBP16 engine of a card: datagrams in, datagrams out. Safe from any thread.

    `board` is an emulated board, or None for a register file of plain memory.
    """

    IMAGES: Final = {
        lib.HM2_ETHERNET_IMAGE_USER: "user",
        lib.HM2_ETHERNET_IMAGE_FALLBACK: "fallback",
        lib.HM2_ETHERNET_IMAGE_NONE: "none",
    }

    def __init__(self, description: EthernetDescription, board: Emulator | None = None) -> None:
        flash_layout.flash_size(description.flash_id)
        self.description = description
        self._board = board  # the C side borrows it
        self._card: Any = ffi.NULL
        if board is not None:
            self._card = ffi.new("hm2_ethernet_card *")
            lib.hm2_ethernet_emulator(board.handle, self._card)
        self._engine = ffi.gc(lib.hm2_ethernet_new(_c_config(description), self._card), lib.hm2_ethernet_free)
        if self._engine == ffi.NULL:
            raise MemoryError("emulated Ethernet card")
        self._reply = ffi.new("uint8_t[]", lib.HM2_LBP16_MAX_PAYLOAD)
        self._load_images()

    def _load_images(self) -> None:
        """Made-up images where a shipped card has real ones, so that reload finds something to boot."""
        user = flash_layout.user_address(self.description.flash_id)
        if self.description.efinix:
            stand_in = b"Made-up Efinix image".ljust(64, b"\0")
            self.flash_write(0, stand_in)
        else:
            stand_in = b"\xff" * 16 + flash_layout.SYNC_WORD + b"Made-up Xilinx image".ljust(44, b"\0")
            self.flash_write(0, flash_layout.boot_block(user).ljust(flash_layout.PAGE_SIZE, b"\0"))
            self.flash_write(flash_layout.FALLBACK_ADDRESS, stand_in)
        self.flash_write(user, stand_in)

    @contextmanager
    def hold(self) -> Iterator[None]:
        """While the block runs no packet is processed.

        For everything that touches the emulated board, its pins and its remotes while a server runs.
        """
        lib.hm2_ethernet_hold(self._engine)
        try:
            yield
        finally:
            lib.hm2_ethernet_release(self._engine)

    @property
    def handle(self) -> Any:
        """The C engine, for the server."""
        return self._engine

    def process(self, request: bytes) -> bytes | None:
        """One datagram's answer, or None for silence. One caller at a time."""
        length = lib.hm2_ethernet_process(self._engine, request, len(request), self._reply)
        return bytes(ffi.buffer(self._reply, length)) if length else None

    def peek(self, space: int, address: int) -> int:
        """A 16-bit word of space 2, 4, 6 or 7 without its side effects."""
        return int(lib.hm2_ethernet_peek(self._engine, space, address))

    def poke(self, space: int, address: int, value: int) -> None:
        """Set such a word; no key is asked for."""
        lib.hm2_ethernet_poke(self._engine, space, address, value)

    @property
    def flash_size(self) -> int:
        """Bytes of the flash."""
        return int(lib.hm2_ethernet_flash_size(self._engine))

    def flash_read(self, address: int, count: int) -> bytes:
        """The flash as it is, beside the protocol; ValueError past its end."""
        data = ffi.new("uint8_t[]", count)
        if lib.hm2_ethernet_flash_read(self._engine, address, data, count) != lib.HM2_OK:
            raise ValueError(f"flash 0x{address:X} + {count} bytes")
        return bytes(ffi.buffer(data))

    def flash_write(self, address: int, data: bytes) -> None:
        """Set flash bytes beside the protocol; ValueError past its end."""
        if lib.hm2_ethernet_flash_write(self._engine, address, data, len(data)) != lib.HM2_OK:
            raise ValueError(f"flash 0x{address:X} + {len(data)} bytes")

    @property
    def image(self) -> str:
        """What the FPGA last booted: `user`, `fallback`, or `none` (dead until `power_up`)."""
        return self.IMAGES[lib.hm2_ethernet_image(self._engine)]

    def power_up(self) -> None:
        """Power off and on: EEPROM and flash stay."""
        lib.hm2_ethernet_power_up(self._engine)


_UNITS_US: Final = {"us": 1.0, "ms": 1000.0, "s": 1e6}


def _microseconds(text: str) -> int:
    match = re.fullmatch(r"([\d.]+)(us|ms|s)", text)
    if match is None:
        raise ValueError(f"{text}: a time is a number with us, ms or s")
    return round(float(match[1]) * _UNITS_US[match[2]])


def _probability(text: str) -> float:
    value = float(text[:-1]) / 100 if text.endswith("%") else float(text)
    if not 0 <= value <= 1:
        raise ValueError(f"{text}: a probability is 0 to 1 or 0% to 100%")
    return value


@dataclass(frozen=True)
class Fault:
    """What happens to datagrams. Probabilities 0 to 1, drawn for each datagram; times in microseconds."""

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    delay_us: int = 0
    jitter_us: int = 0
    requests: bool = True
    """Acts on what the card receives."""
    replies: bool = True
    """Acts on what the card sends."""
    seed: int | None = None
    """Of the generator; None leaves it running."""

    @classmethod
    def parse(cls, text: str) -> Fault:
        """From `loss=1%,dup=0.5%,reorder=1%,delay=200us,jitter=1ms,direction=replies,seed=7`."""
        setters: dict[str, Callable[[str], dict[str, Any]]] = {
            "loss": lambda value: {"loss": _probability(value)},
            "dup": lambda value: {"duplicate": _probability(value)},
            "reorder": lambda value: {"reorder": _probability(value)},
            "delay": lambda value: {"delay_us": _microseconds(value)},
            "jitter": lambda value: {"jitter_us": _microseconds(value)},
            "direction": _direction,
            "seed": lambda value: {"seed": int(value, 0)},
        }
        fault = cls()
        for item in filter(None, text.split(",")):
            key, _, value = item.strip().partition("=")
            if key not in setters:
                raise ValueError(f"{key}: faults are {', '.join(setters)}")
            fault = replace(fault, **setters[key](value))
        return fault


def _direction(text: str) -> dict[str, Any]:
    if text not in ("requests", "replies", "both"):
        raise ValueError(f"{text}: a direction is requests, replies or both")
    return {"requests": text != "replies", "replies": text != "requests"}


@dataclass(frozen=True)
class ServerCounters:
    """Datagrams since the server was made; lost, duplicated, reordered: by fault injection."""

    requests: int
    replies: int
    send_errors: int
    lost: int
    duplicated: int
    reordered: int
    overflows: int


def _describe(board: Any, given: EthernetDescription | None) -> EthernetDescription:
    if given is not None:
        return given
    if board is None:
        return DESCRIPTIONS["7i92"]
    if board.description is None:
        raise ValueError("a board made from IDROM words needs a description=")
    return description(board.description.name)


class EthernetServer:
    """An emulated card on a UDP socket: `with EthernetServer(board) as server: udp://{server.url}`.

    Listens on loopback unless told otherwise; whoever reaches another address can drive the card, so
    that is logged as a warning. `port` 0 takes a free one. While it runs, single calls to the board, to its
    encoders and to a remote's elements and memory come between two packets; what belongs together, pins and
    everything else of a remote only inside `with server.card.hold():`, which keeps packets waiting.
    `fifo_priority` needs the right to real-time scheduling. `board` is an emulated board, an
    `EthernetCard`, or None for plain registers.
    """

    def __init__(
        self,
        board: Any = None,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        description: EthernetDescription | None = None,
        spin_us: int = 30,
        fifo_priority: int = 0,
        cpu: int = -1,
    ) -> None:
        self.host = host
        self.card = (
            board if isinstance(board, EthernetCard) else EthernetCard(_describe(board, description), board)
        )
        self._thread = (spin_us, fifo_priority, cpu)
        self._closed = False
        error = new_error()
        out: Any = ffi.new("struct hm2_ethernet_server **")
        address = "127.0.0.1" if host == "localhost" else host
        check(lib.hm2_ethernet_server_open(self.card.handle, address.encode(), port, out, error), error)
        self._server, self._kept = own(out[0], lib.hm2_ethernet_server_free)
        self.port = int(lib.hm2_ethernet_server_port(self._server))
        if not self.is_loopback:
            log.warning("emulated card on %s:%d can be driven from the network", host, self.port)

    def _handle(self) -> Any:
        if self._closed:
            raise TransportClosed("emulated Ethernet card: the server is closed")
        return self._server

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine reaches the card."""
        return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback

    @property
    def url(self) -> str:
        """For `hostmot2.open`."""
        return f"udp://{self.host}:{self.port}"

    def start(self) -> Self:
        """Start the thread. Starting twice does nothing."""
        error = new_error()
        check(lib.hm2_ethernet_server_start(self._handle(), *self._thread, error), error)
        return self

    def stop(self) -> None:
        """End the thread; the socket stays bound until the server is closed."""
        lib.hm2_ethernet_server_stop(self._handle())

    def close(self) -> None:
        """Stop and close the socket. The card can be served again by another server."""
        if not self._closed:
            self._closed = True
            ffi.release(self._server)

    def set_fault(self, fault: Fault | str) -> None:
        """Faults from now on, replacing those before; `Fault()` ends them."""
        if isinstance(fault, str):
            fault = Fault.parse(fault)
        if fault.seed is not None:
            lib.hm2_ethernet_server_set_seed(self._handle(), fault.seed)
        active = {
            "loss_ppm": round(fault.loss * 1e6),
            "duplicate_ppm": round(fault.duplicate * 1e6),
            "reorder_ppm": round(fault.reorder * 1e6),
            "delay_us": fault.delay_us,
            "jitter_us": fault.jitter_us,
        }
        for direction, affected in ((REQUESTS, fault.requests), (REPLIES, fault.replies)):
            c_fault = ffi.new("hm2_ethernet_fault *", active if affected else {})
            lib.hm2_ethernet_server_set_fault(self._handle(), direction, c_fault)

    @property
    def counters(self) -> ServerCounters:
        """What passed so far."""
        counters: Any = ffi.new("hm2_ethernet_server_counters *")
        lib.hm2_ethernet_server_get_counters(self._handle(), counters)
        return ServerCounters(*(getattr(counters, name) for name in ServerCounters.__dataclass_fields__))

    def __enter__(self) -> Self:
        """Start the server."""
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop and close."""
        self.close()
