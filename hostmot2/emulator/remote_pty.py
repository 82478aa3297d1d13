"""An emulated remote on a pseudo terminal: what a serial adapter with a remote behind it looks like."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import termios
import tty
from collections.abc import Callable
from types import FrameType

from hostmot2.emulator.described import DescribedRemote
from hostmot2.emulator.remote_state import RemoteState
from hostmot2.emulator.serial_line import SerialLine

CHUNK = 4096
SPEED = 4  # place of the input speed in termios attributes

_BAUDS = {
    getattr(termios, name): int(name[1:]) for name in dir(termios) if name[:1] == "B" and name[1:].isdigit()
}


class PtyRemote:
    """The remote behind a pseudo terminal; `path` is what a serial program opens.

    A program that opens it at another rate than the remote's is not heard, as on a wire. Commands on
    `commands` (a file descriptor, None: none), one a line: power-cycle, setup, operate, crc on, crc off,
    set NAME VALUE, get NAME, quit. SIGUSR1 cycles the power, SIGINT and SIGTERM end it.
    """

    def __init__(
        self,
        remote: DescribedRemote,
        state: RemoteState | None = None,
        *,
        commands: int | None = None,
        say: Callable[[str], None] = print,
    ) -> None:
        self.remote = remote
        self._state = state
        self._line = SerialLine(remote)
        self._commands = commands
        self._partial = b""
        self._say = say
        self._power_cycles = 0
        self._ended = False
        self._host, self._port = os.openpty()
        tty.setraw(self._port)
        self._set_speed()
        os.set_blocking(self._host, False)
        self.path = os.ttyname(self._port)

    def _set_speed(self) -> None:
        speed = next((code for code, baud in _BAUDS.items() if baud == self.remote.baud), termios.B115200)
        attributes = termios.tcgetattr(self._port)
        attributes[SPEED] = attributes[SPEED + 1] = speed
        termios.tcsetattr(self._port, termios.TCSANOW, attributes)

    def run(self, ready: Callable[[str], None]) -> None:
        """Tell `ready` the path, then serve until told to end."""
        previous = {number: signal.signal(number, self._signalled) for number in self._SIGNALS}
        try:
            if self._state is not None:
                self._state.save()
            ready(self.path)
            while not self._ended:
                self._wait()
                self._serve()
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)
            if self._state is not None:
                self._state.save()
            os.close(self._host)
            os.close(self._port)

    _SIGNALS = (signal.SIGUSR1, signal.SIGINT, signal.SIGTERM)

    def _signalled(self, number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGUSR1:
            self._power_cycles += 1
        else:
            self._ended = True

    def _wait(self) -> None:
        sources = [self._host] if self._commands is None else [self._host, self._commands]
        due_s = self._line.due_in_s()
        select.select(sources, [], [], 0.1 if due_s is None else due_s)  # signals are seen ten times a second

    def _serve(self) -> None:
        if self._power_cycles:
            self._power_cycles = 0
            self.remote.power_cycle()
        if self._commands is not None and select.select([self._commands], [], [], 0)[0]:
            self._take_commands(self._commands)
        with contextlib.suppress(BlockingIOError):
            baud = _BAUDS.get(termios.tcgetattr(self._port)[SPEED], self.remote.baud)
            self._line.receive(os.read(self._host, CHUNK), baud)
        answer = self._line.take()
        if self._state is not None:
            self._state.save()  # before the answer tells that it is done
        if answer:
            with contextlib.suppress(BlockingIOError):  # nobody reads: lost, as on a wire
                os.write(self._host, answer)

    # -- commands

    def _take_commands(self, source: int) -> None:
        data = os.read(source, CHUNK)
        if not data:
            self._commands = None
            return
        *lines, self._partial = (self._partial + data).split(b"\n")
        for line in lines:
            words = line.decode("utf-8", "replace").split()
            if words:
                try:
                    self._obey(words)
                except (KeyError, ValueError, OverflowError) as mistake:
                    self._say(f"error {mistake}")

    def _obey(self, words: list[str]) -> None:
        match words:
            case ["power-cycle"]:
                self.remote.power_cycle()
            case ["setup" | "operate" as jumper]:
                self.remote.setup_jumper = jumper == "setup"
                self.remote.power_cycle()
            case ["crc", "on" | "off" as switch]:
                self.remote.crc = switch == "on"
            case ["set", name, value]:
                self.remote.set(name, float(value) if "." in value else int(value, 0))
            case ["get", name]:
                self._say(f"{name} {self.remote.get(name)}")
                return
            case ["quit"]:
                self._ended = True
            case _:
                raise ValueError("power-cycle, setup, operate, crc on|off, set NAME VALUE, get NAME, quit")
        self._say("ok")


def serve(
    remote: DescribedRemote, state: RemoteState | None = None, *, ready: Callable[[str], None] = print
) -> None:
    """Put the remote on a pseudo terminal, tell `ready` its path, serve until SIGINT or SIGTERM.

    Commands are read from standard input, if there is one.
    """
    try:
        commands: int | None = sys.stdin.fileno()
    except (AttributeError, ValueError, OSError):
        commands = None
    port = PtyRemote(remote, state, commands=commands, say=lambda text: print(text, flush=True))
    port.run(ready)
