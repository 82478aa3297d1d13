"""hm2 monitor in a real terminal (a pty), on a card in another process: outputs go off on every way out."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hostmot2.emulator.control import ask

pytestmark = pytest.mark.slow
PATIENCE = 40.0
TRIES = 4
STALLED = (b"Outputs went off", b"link given up")
"""What a monitor says whose machine stood still for too long."""


class Card:
    """An emulated Ethernet card in a process of its own."""

    def __init__(self, control: Path) -> None:
        self.control = control
        command = [sys.executable, "-m", "hostmot2", "emulate", "7i92+7i77", "--listen", "127.0.0.1:0"]
        self.process = subprocess.Popen(
            [*command, "--control", str(control)], stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout
        self.url = self.process.stdout.readline().split()[1]

    @property
    def output(self) -> int:
        """The field outputs as the 7I77 drives them."""
        return int(float(ask(self.control, "get", "output")))


class Terminal:
    """A program on a pty of 80x24, and all that it has written."""

    def __init__(self, *arguments: str) -> None:
        self.pid, self.master = pty.fork()
        if self.pid == 0:
            os.environ["TERM"] = "xterm-256color"
            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
            os.execv(sys.executable, [sys.executable, "-m", "hostmot2", *arguments])
        self.written = b""
        self._lock = threading.Lock()
        self.listening = threading.Event()
        self.listening.set()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            while self.listening.wait():
                if select.select([self.master], [], [], 0.1)[0]:
                    data = os.read(self.master, 65536)
                    with self._lock:
                        self.written += data

    def sees(self, text: str, seconds: float = PATIENCE) -> None:
        """Wait until it has written that."""
        try:
            until(lambda: text.encode() in self.written, seconds)
        except AssertionError:
            raise AssertionError(f"no {text!r} in {self.written[-3000:]!r}") from None

    def types(self, text: str) -> None:
        """Press keys."""
        os.write(self.master, text.encode())

    def ended(self) -> int:
        """Wait for the end; the status as a shell gives it."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.05)
        os.kill(self.pid, signal.SIGKILL)
        raise AssertionError("it has not ended")


def until(true: Callable[[], bool], seconds: float = PATIENCE) -> None:
    """Wait, but not for ever."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.fixture
def card(tmp_path: Path) -> Iterator[Card]:
    made = Card(tmp_path / "card")
    with made.process:
        yield made
        made.process.terminate()


def started(card: Card, *options: str) -> Terminal:
    """A monitor that runs the card, its outputs off."""
    terminal = Terminal("--board", card.url, "monitor", "--rate", "100", *options)
    terminal.sees("OUTPUTS OFF")
    return terminal


def armed(card: Card) -> Terminal:
    """A monitor with an output on; once more where the machine stalled and the monitor turned outputs off."""
    for _ in range(TRIES):
        terminal = started(card, "--allow-write")
        terminal.types("w")
        terminal.sees("to go on")
        terminal.types("arm\r")
        with contextlib.suppress(AssertionError):
            terminal.sees("ARMED", 10.0)
            terminal.types("4")
            terminal.sees("[4 Bits]", 10.0)
            terminal.types("\x1b[B\r")
            terminal.sees("(bit 0 first)", 10.0)
            terminal.types("3 on\r")
            until(lambda: card.output == 8, 10.0)
            return terminal
        assert any(why in terminal.written for why in STALLED), terminal.written[-9000:]
        os.kill(terminal.pid, signal.SIGKILL)
        terminal.ended()
    pytest.skip(f"this machine stalled until the monitor turned outputs off, {TRIES} times")


WAYS: dict[str, tuple[Callable[[Terminal], None], int]] = {
    "q": (lambda terminal: terminal.types("q"), 0),
    "ctrl-c": (lambda terminal: terminal.types("\x03"), 0),
    "SIGTERM": (lambda terminal: os.kill(terminal.pid, signal.SIGTERM), 128 + signal.SIGTERM),
    "SIGINT": (lambda terminal: os.kill(terminal.pid, signal.SIGINT), 128 + signal.SIGINT),
    "closed": (lambda terminal: os.close(terminal.master), 128 + signal.SIGHUP),
    "SIGKILL": (lambda terminal: os.kill(terminal.pid, signal.SIGKILL), -signal.SIGKILL),
}


@pytest.mark.parametrize("way", list(WAYS))
def test_every_way_out_has_its_status_and_no_traceback(card: Card, way: str) -> None:
    terminal = started(card, "--start", "all")
    leave, status = WAYS[way]
    leave(terminal)
    assert terminal.ended() == status
    assert b"Traceback" not in terminal.written


def test_a_signal_ends_it_though_the_terminal_takes_nothing(card: Card) -> None:
    terminal = started(card, "--start", "all")
    terminal.listening.clear()
    time.sleep(8)  # until all that lies between the view and the terminal is full
    os.kill(terminal.pid, signal.SIGTERM)
    assert terminal.ended() == 128 + signal.SIGTERM


@pytest.mark.parametrize("way", ["q", "SIGTERM", "closed", "SIGKILL"])
def test_outputs_go_off_on_every_way_out(card: Card, way: str) -> None:
    terminal = armed(card)
    WAYS[way][0](terminal)
    until(lambda: card.output == 0)
    terminal.ended()


def test_a_card_that_vanishes_ends_in_a_typed_error(card: Card) -> None:
    terminal = started(card, "--start", "all")
    card.process.kill()
    terminal.sees("HM2-E")
    terminal.types("q")
    assert terminal.ended() == 5
    assert b"Traceback" not in terminal.written


def test_a_card_that_is_driven_is_looked_at_and_not_taken_over(card: Card) -> None:
    driver = started(card, "--start", "all")
    looking = Terminal("--board", card.url, "monitor")
    looking.sees("READ-ONLY")
    looking.sees("running")
    second = Terminal("--board", card.url, "monitor", "--start", "all")
    assert second.ended() == 7
    assert b"HM2-E013" in second.written
    looking.types("q")
    assert looking.ended() == 0
    driver.types("q")
    assert driver.ended() in (0, 5)  # 5: the machine stalled and the link was lost
