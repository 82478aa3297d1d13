"""Looking into and steering an emulated card that is being served: keys and plain numbers on a Unix socket.

One request a line, `get KEY` or `set KEY VALUE`; one answer a line, a number or `error: ...`.

Keys of the first daughter card (others with their number before: `1.output`): `output` (16-bit, field
outputs), `input` (32-bit, field inputs), `analogout0`..`5` (volts, 0 while its enable is off), `analogena`,
`spinena`, and any element of its remotes by name. Of the card: `encoder0_rate`.. (counts/s, as set here),
`encoder0_position`.. (counts), `led0`.., `requests`, `replies`. Of the network: `fault.loss`, `fault.dup`,
`fault.reorder` (0 to 1), `fault.delay`, `fault.jitter` (microseconds), `fault.requests`, `fault.replies` (0
or 1: the directions it acts on), `fault.seed`.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import socket
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.described import DescribedRemote
from hostmot2.emulator.encoder import EmulatedEncoder
from hostmot2.emulator.ethernet import EthernetServer, Fault

_FAULT_KEYS: Final = {
    "loss": "loss",
    "dup": "duplicate",
    "reorder": "reorder",
    "delay": "delay_us",
    "jitter": "jitter_us",
    "requests": "requests",
    "replies": "replies",
    "seed": "seed",
}


class Controls:
    """The keys of one served card. Safe from any thread.

    Between two packets of its host the card is taken for single calls of the core, never while Python runs:
    the interpreter's threads wait for each other, and a real card answers to the microsecond.
    """

    def __init__(self, board: EmulatedBoard, server: EthernetServer, fault: Fault | None = None) -> None:
        self._board = board
        self._server = server
        self._fault = fault or Fault()
        self._rates: dict[int, float] = {}

    def get(self, key: str) -> float:
        """A key's value. Raises KeyError."""
        if key.startswith("fault."):
            value = getattr(self._fault, self._fault_field(key))
            return 0 if value is None else float(value)
        if key in ("requests", "replies"):
            return float(getattr(self._server.counters, key))
        get = self._getter(key)
        self._board.sync()
        return float(get())

    def set(self, key: str, value: float) -> None:
        """Set a key. Raises KeyError, ValueError for one that is only read or a value out of range."""
        if key.startswith("fault."):
            self._set_fault(key, value)
            return
        change = self._setter(key)
        self._board.sync()
        change(value)

    def _fault_field(self, key: str) -> str:
        name = key.removeprefix("fault.")
        if name not in _FAULT_KEYS:
            raise KeyError(f"no key {key}; faults are {', '.join(_FAULT_KEYS)}")
        return _FAULT_KEYS[name]

    def _set_fault(self, key: str, value: float) -> None:
        field = self._fault_field(key)
        if field in ("loss", "duplicate", "reorder"):
            if not 0 <= value <= 1:
                raise ValueError(f"{key}: a probability is 0 to 1")
        elif value < 0:
            raise ValueError(f"{key}: {value} is negative")
        else:
            value = bool(value) if field in ("requests", "replies") else round(value)
        changes: dict[str, Any] = {field: value}
        fault = replace(self._fault, **changes)
        self._server.set_fault(fault)
        self._fault = replace(fault, seed=None) if field != "seed" else fault

    def _getter(self, key: str) -> Callable[[], float]:
        if match := re.fullmatch(r"encoder(\d+)_(rate|position)", key):
            encoder = self._encoder(int(match[1]))
            if match[2] == "rate":
                return lambda: self._rates.get(encoder.number, 0.0)
            return lambda: encoder.position
        if match := re.fullmatch(r"led(\d+)", key):
            number, leds = int(match[1]), self._board.description.leds if self._board.description else 2
            if number >= leds:
                raise KeyError(f"no {key}: the card has {leds} LEDs")
            return lambda: self._board.leds[number]
        remote, name = self._element(key)
        return lambda: remote.get(name)

    def _setter(self, key: str) -> Callable[[float], None]:
        if match := re.fullmatch(r"encoder(\d+)_(rate|position)", key):
            encoder = self._encoder(int(match[1]))
            if match[2] == "rate":
                return lambda value: self._set_rate(encoder, value)
            return lambda value: setattr(encoder, "position", round(value))
        if re.fullmatch(r"led\d+", key):
            raise ValueError(f"{key} can only be read")
        remote, name = self._element(key)
        return lambda value: remote.set(name, int(value) if value == int(value) else value)

    def _set_rate(self, encoder: EmulatedEncoder, counts_per_second: float) -> None:
        encoder.set_rate(counts_per_second)
        self._rates[encoder.number] = counts_per_second

    def _encoder(self, number: int) -> EmulatedEncoder:
        return self._board.encoder_input(number)

    def _element(self, key: str) -> tuple[DescribedRemote, str]:
        """The remote that has an element of this name, on the daughter card meant."""
        number, _, name = key.rpartition(".")
        if number and not number.isdigit():
            raise KeyError(f"no key {key}")
        for remote in self._remotes(int(number or 0)):
            for element in (*remote.elements, *remote.parameters):
                if element.lower() == name.lower():
                    return remote, element
        raise KeyError(f"no key {key}: no remote of daughter card {number or 0} has such an element")

    def _remotes(self, daughter: int) -> list[DescribedRemote]:
        facts = self._board.description
        daughters = facts.daughters if facts else ()
        if daughter >= len(daughters):
            raise KeyError(f"there is no daughter card {daughter}")
        first = daughters[daughter].sserial_channel
        later = [other.sserial_channel for other in daughters if other.sserial_channel > first]
        port = self._board.sserial[0]
        channels = range(first, min([*later, port.channels]))
        found = [port.remote(channel) for channel in channels]
        return [remote for remote in found if isinstance(remote, DescribedRemote)]


def answer(controls: Controls, line: str) -> str:
    """One request's answer; never raises for what a client can send."""
    words = line.split()
    try:
        match words:
            case ["get", key]:
                return f"{controls.get(key):.12g}"
            case ["set", key, value]:
                controls.set(key, float(int(value, 0)) if re.fullmatch(r"0[xXbB].*", value) else float(value))
                return "ok"
            case _:
                return "error: get KEY, or set KEY VALUE"
    except (KeyError, ValueError, IndexError, OverflowError) as error:
        return f"error: {error.args[0] if error.args else error}"


def _with_path(error: OSError, path: str | Path) -> OSError:
    """The same error, saying which socket; as it is when there is no error number (a path too long)."""
    return OSError(error.errno, error.strerror, os.fspath(path)) if error.errno else error


def _remove_abandoned(path: Path) -> None:
    """A socket whose emulator was killed is in nobody's use; one that answers, or any other file, stays."""
    if not path.is_socket():
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        try:
            client.connect(os.fspath(path))
        except ConnectionRefusedError:
            path.unlink(missing_ok=True)


class ControlServer:
    """The Unix socket. A context manager; leaving it removes the socket, except in a forked child."""

    def __init__(self, path: str | Path, controls: Controls) -> None:
        self.path = Path(path)
        self._controls = controls
        self._owner = os.getpid()
        _remove_abandoned(self.path)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            os.fchmod(self._socket.fileno(), 0o600)  # the file that bind makes is its owner's alone
            self._socket.bind(os.fspath(self.path))
        except OSError as error:
            self._socket.close()
            raise _with_path(error, self.path) from None
        self._socket.listen(8)
        self._thread = threading.Thread(target=self._run, name="hm2 control", daemon=True)

    def _run(self) -> None:
        while True:
            try:
                client, _ = self._socket.accept()
            except OSError:
                return  # closed
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with (
            contextlib.suppress(OSError),  # the client has gone; closing sends what is buffered once more
            client,
            client.makefile("rw", encoding="utf-8", errors="replace") as stream,
        ):
            while line := stream.readline(4096):
                stream.write(answer(self._controls, line) + "\n")
                stream.flush()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if os.getpid() != self._owner:  # the parent goes on listening
            self._socket.close()
            return
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._thread.join(1)
        self.path.unlink(missing_ok=True)


def ask(path: str | Path, *words: str, timeout: float = 5.0) -> str:
    """Send one request to a running emulator; its answer. Raises OSError, ValueError for an error answer."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        client.settimeout(timeout)
        try:
            client.connect(os.fspath(path))
        except OSError as error:
            raise _with_path(error, path) from None
        stream: Any = client.makefile("rw", encoding="utf-8")
        try:
            with stream:
                stream.write(" ".join(words) + "\n")
                stream.flush()
                line = str(stream.readline())
        except (BrokenPipeError, ConnectionResetError):
            line = ""
    if not line.endswith("\n"):
        raise ConnectionResetError(errno.ECONNRESET, "the emulator ended before it answered", os.fspath(path))
    reply = line.strip()
    if reply.startswith("error: "):
        raise ValueError(reply.removeprefix("error: "))
    return reply
