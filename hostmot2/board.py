"""A card: words at addresses, what its IDROM says it contains, and the modules built on both."""

from __future__ import annotations

import importlib
import os
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from enum import IntEnum
from types import TracebackType
from typing import Any, Self

from hostmot2 import errors, exits
from hostmot2._core import ffi, lib
from hostmot2.boards import BoardFacts
from hostmot2.handles import own
from hostmot2.idrom import Idrom, ModuleDescriptor, PinDescriptor
from hostmot2.inventory import Inventory, read_inventory
from hostmot2.parts import PARTS
from hostmot2.registers import Gtag, Id
from hostmot2.transports.base import LinkCounters, Transport

LONGEST_SECONDS = 1e9
"""What may be told in seconds, which the core counts in ns of 64 bits."""


class SafeOff(IntEnum):
    """The order in which close() makes a card safe; lower first.

    What needs the link to remotes goes while it still works, the pins after everything that drives them,
    and the watchdog last, so that it bites even if something before it failed.
    """

    SESSION = 0
    CARDS = 10
    SSERIAL = 20
    GENERATORS = 30
    IOPORT = 40
    LEDS = 50
    WATCHDOG = 60


class Board:
    """An open card.

    Use it as a context manager: leaving the block, by whatever way, turns outputs off and closes the card.
    Boards still open when the interpreter exits are closed the same way, and on SIGTERM and SIGHUP unless
    the program handles those itself (hostmot2/exits.py). In a forked child a board is closed from the
    beginning, without touching the card: that is its parent's.

    Attributes of the card's parts (`sserial`, `encoders`, `watchdog`, ...) are made when first used; the
    table is hostmot2/parts.py.

    Thread-safety: every access takes `lock`, so a board may be used from several threads; a sequence that
    must not be interrupted holds `lock` (it is reentrant) around itself.
    """

    def __init__(
        self,
        transport: Transport,
        *,
        strict: bool = True,
        board: BoardFacts | None = None,
        read_only: bool = False,
    ) -> None:
        self.lock = threading.RLock()
        self.url = transport.url
        self.read_only = transport.read_only or read_only
        """Whether every write is refused with ReadOnly; closing then leaves the card as it is."""
        self.virtual_time = transport.virtual_time
        """Whether time on the card passes only while somebody waits (an emulated card with that clock)."""
        self._transport = transport
        self._parts: dict[str, Any] = {}
        self._restore: list[tuple[int, int, Callable[[], object]]] = []
        self._safe_off: list[tuple[int, int, Callable[[], object]]] = []
        self._safe_off_count = 0
        self._owner = os.getpid()
        self._closing = False
        self._closed = True  # until there is something to close
        self._error = errors.new_error()
        handle = ffi.new("struct hm2_board **")
        errors.check(lib.hm2_board_open(transport.bus, handle, self._error), self._error)
        self._handle, self._kept = own(handle[0], lib.hm2_board_free)
        if self.read_only:
            lib.hm2_board_set_read_only(self._handle)
        self._closed = False
        try:
            self.inventory: Inventory = read_inventory(
                self.read_words, model=transport.model, board=board, strict=strict
            )
        except BaseException:
            self._close_bus()
            raise
        exits.close_at_exit(self)

    @property
    def idrom(self) -> Idrom:
        """The IDROM header: names, clocks, ports."""
        return self.inventory.idrom

    @property
    def modules(self) -> tuple[ModuleDescriptor, ...]:
        """The modules of the loaded firmware, in IDROM order."""
        return self.inventory.modules

    @property
    def pins(self) -> tuple[PinDescriptor, ...]:
        """All I/O pins, in I/O order."""
        return self.inventory.pins

    @property
    def name(self) -> str:
        """The board's name, such as "5I25"."""
        if self._transport.model:
            return self._transport.model
        return self.idrom.board_name.removeprefix("MESA")

    @property
    def handle(self) -> Any:
        """The `struct hm2_board *`, for calls into the C core; hold `lock` during them."""
        return self._handle

    @property
    def closed(self) -> bool:
        """Whether the card has been let go; still False while close() turns outputs off."""
        return self._closed

    @property
    def counters(self) -> dict[str, int]:
        """Exchanges, failures, words read and words written since open."""
        counters = ffi.new("hm2_board_counters *")
        lib.hm2_board_get_counters(self._handle, counters)
        names = ("exchanges", "failures", "words_read", "words_written")
        return {name: getattr(counters, name) for name in names}

    @property
    def link_counters(self) -> LinkCounters | None:
        """What got lost, came late or came twice on the way to an Ethernet card; None on another bus.

        Raises TransportClosed after close().
        """
        tells = self._transport.link_counters
        return None if tells is None else tells()

    def module(self, gtag: int) -> ModuleDescriptor:
        """The module descriptor of `gtag`. Raises ModuleMissing."""
        for module in self.modules:
            if module.gtag == gtag:
                return module
        name = Gtag(gtag).name.lower() if gtag in list(Gtag) else "such"
        raise errors.ModuleMissing(
            f"{self.name}: the loaded firmware has no {name} module (gtag 0x{gtag:02X})"
        )

    def read(self, address: int, count: int = 1) -> Any:
        """The word at `address` (an int), or with `count` a list of that many consecutive words.

        address: byte address, a multiple of 4 below 0x10000. Raises ValueError for other addresses and a
        TransportError if the card cannot be reached; never a made-up value.
        """
        words = self.read_words(address, count)
        return words[0] if count == 1 else words

    def read_words(self, address: int, count: int) -> list[int]:
        """`count` consecutive words from `address` on, always as a list. Errors as for read()."""
        if count < 1:
            raise ValueError(f"count must be at least 1, not {count}")
        if not 0 <= address < lib.HM2_ADDRESS_SPACE or count > lib.HM2_ADDRESS_SPACE // 4:
            raise ValueError(f"{count} words at 0x{address:X} are outside the 64 KiB register file")
        words = ffi.new("uint32_t[]", count)
        with self.lock:
            errors.check(lib.hm2_read(self._handle, address, words, count, self._error), self._error)
        return list(words)

    def write(self, address: int, words: int | Sequence[int]) -> None:
        """Write one word or consecutive words from `address` on, in order.

        words: 0 to 0xFFFFFFFF each. Raises ValueError for addresses and values outside their range, ReadOnly
        on a dump, and a TransportError if the card cannot be reached.
        """
        values = [words] if isinstance(words, int) else list(words)
        if not 0 <= address < lib.HM2_ADDRESS_SPACE:
            raise ValueError(f"address 0x{address:X} is outside the 64 KiB register file")
        for value in values:
            if not 0 <= value <= 0xFFFFFFFF:
                raise ValueError(f"word {value:#x} is outside 0..0xFFFFFFFF")
        with self.lock:
            status = lib.hm2_write(self._handle, address, values, len(values), self._error)
            errors.check(status, self._error)

    def now_ns(self) -> int:
        """Nanoseconds on the card's clock: CLOCK_MONOTONIC, or the emulator's virtual time."""
        return int(lib.hm2_board_now_ns(self._handle))

    def pause(self, seconds: float) -> None:
        """Let `seconds` of the card's clock pass; below 0: none. Other threads may use the board meanwhile.

        Raises ValueError for infinity and what is no number.
        """
        if not seconds < LONGEST_SECONDS:
            raise ValueError(f"a pause of {seconds} s")
        lib.hm2_board_pause_ns(self._handle, round(seconds * 1e9))

    def card(self, name: str) -> Any:
        """The daughter card called `name`, such as "7i77".

        Raises ModuleMissing if it is not there, KeyError for a name this package does not know.
        """
        return self._part("cards")[name]

    def on_close(self, action: Callable[[], object], order: int) -> None:
        """Call `action` when the board closes, before the transport does. order: see SafeOff.

        Actions of one order run in reverse order of registration. All run, even if some fail.
        """
        self._safe_off_count += 1
        self._safe_off.append((order, -self._safe_off_count, action))

    def forget_on_close(self, action: Callable[[], object]) -> None:
        """Do not call `action` any more."""
        self._safe_off = [entry for entry in self._safe_off if entry[2] != action]

    def on_restore(self, action: Callable[[], object], order: int = SafeOff.SESSION) -> None:
        """Call `action` when the card's configuration must be written anew; in order of registration.

        order: as in close(), so that the pins come back after what drives them has been stopped.
        """
        self._restore.append((order, len(self._restore), action))

    def restore(self) -> None:
        """Write the card's configuration anew, as after a watchdog bite or a lost link; outputs stay off.

        A part that fails does not keep others from it; the first exception is raised behind all.
        """
        failed: list[Exception] = []
        with self.lock:
            for _, _, action in sorted(self._restore, key=lambda entry: entry[:2]):
                try:
                    action()
                except Exception as error:
                    failed.append(error)
        if failed:
            raise failed[0]

    def recover(self) -> None:
        """Use the card again after LinkFailed: the link's errors forgotten, the configuration written anew.

        A bite that happened meanwhile is accepted, as by watchdog.acknowledge(), and leaves the watchdog
        disarmed. Outputs stay off and smart serial stopped until you ask for them again. Call it when the
        cause is gone; stop an engine first. Raises TransportError if the card does still not answer: then
        call it again, or close().
        """
        with self.lock:
            has_watchdog = any(module.gtag == Gtag.WATCHDOG for module in self.modules)
            with self._link_taken_up():
                if has_watchdog and self.watchdog.check():
                    self.watchdog.acknowledge()
                else:
                    self.restore()

    @contextmanager
    def _link_taken_up(self) -> Iterator[None]:
        """Its errors forgotten. Given up again if the block fails: nothing goes on from there by itself."""
        for action in self._transport.on_recover:
            action()
        try:
            yield
        except errors.TransportError:
            for action in self._transport.on_give_up:
                action()
            raise

    def close(self) -> None:
        """Turn outputs off, let the transport go. Idempotent.

        The first error of a safe-off action is raised after everything has been tried.
        """
        if os.getpid() != self._owner:
            self.disown()
            return
        with self.lock:
            if self._closed or self._closing:
                return
            self._closing = True
            try:
                lib.hm2_board_set_gate(self._handle, 0)  # making safe is writing, too
                with suppress(Exception):  # making safe will tell what is wrong
                    self._try_link_once_more()
                failed = self._make_safe() if not self.read_only else []
                self._close_bus()
            except BaseException:  # Ctrl-C between two actions: each may be done twice, none may be left out
                self._closing = False
                if self._closed:
                    self._close_bus()
                else:
                    self.close()
                raise
        exits.forget(self)
        if failed:
            for other in failed[1:]:
                failed[0].add_note(f"also: {other!r}")
            raise failed[0]

    def disown(self) -> None:
        """For a forked child: the board is closed, the card left alone. Called by itself."""
        lock: Any = self.lock
        if not lock._is_owned():  # a thread that held it is not there to give it back
            lock._at_fork_reinit()
        if not self._closed:
            self._close_bus()
        exits.forget(self)

    def _make_safe(self) -> list[BaseException]:
        failed: list[BaseException] = []
        for _, _, action in sorted(self._safe_off, key=lambda entry: entry[:2]):
            try:
                action()
            except Exception as error:
                failed.append(error)
            except BaseException as error:  # Ctrl-C, perhaps halfway: what was begun is done
                failed.append(error)
                try:
                    action()
                except BaseException as again:  # even a second one must not leave outputs on
                    failed.append(again)
        return failed

    def _try_link_once_more(self) -> None:
        """One that was given up may be back: then outputs need not be left to the watchdog."""
        if self.read_only or not self._transport.given_up():
            return
        with self._link_taken_up():
            self.read(Id.cookie.number)

    def _close_bus(self) -> None:
        """Each part of it may be done twice: what is closed stays closed."""
        self._closed = True
        lib.hm2_board_close(self._handle)
        while self._transport.on_close:
            self._transport.on_close.pop(0)()

    def __del__(self) -> None:
        if not getattr(self, "_closed", True):
            warnings.warn(f"{self!r} was dropped without close()", ResourceWarning, stacklevel=2)
            self.close()

    def _part(self, name: str) -> Any:
        with self.lock:
            if name not in self._parts:
                module, attribute = PARTS[name]
                self._parts[name] = getattr(importlib.import_module(module), attribute)(self)
            return self._parts[name]

    def __getattr__(self, name: str) -> Any:
        if name in PARTS and not name.startswith("_"):
            return self._part(name)
        raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *PARTS})

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except BaseException as failure:
            self.close()  # nothing is left to do, unless Ctrl-C came before it had begun
            if error is None:
                raise
            error.add_note(f"while closing {self.url}: {failure!r}")

    def __repr__(self) -> str:
        state = "closed" if self._closed else f"{len(self.modules)} modules, {len(self.pins)} pins"
        return f"<Board {self.name} at {self.url}: {state}>"
