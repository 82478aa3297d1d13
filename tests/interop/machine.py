"""What the tests with foreign clients make for themselves: network namespaces, a served card, a HAL session.

Everything happens in namespaces of its own: nothing of the machine's own network is touched. Needs root.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from hostmot2.emulator.control import ask

CARD_IP, HOST_IP, MAC = "10.10.10.10", "10.10.10.1", "00:60:1b:10:12:34"
HM2 = [sys.executable, "-c", "from hostmot2.cli import main; main()"]
NOBODY = 65534
HOST_CPU, CARD_CPU = min(os.sched_getaffinity(0)), max(os.sched_getaffinity(0))
"""A card does not take turns with the host's processor. Real-time threads that the system moves from one
processor to another, after each thing above them, are late by the moves."""


def run(*command: str, timeout: float = 60, check: bool = True, **options: Any) -> str:
    """A command's output; AssertionError with what it said when it fails."""
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=timeout, errors="replace", **options
    )
    assert not check or done.returncode == 0, (
        f"{' '.join(command)}: {done.returncode}\n{done.stdout}{done.stderr}"
    )
    return done.stdout


class Network:
    """Two namespaces joined by a veth pair: the card's, whose end has the card's MAC, and the host's."""

    def __init__(self) -> None:
        self.card, self.host = f"hm2card{os.getpid()}", f"hm2host{os.getpid()}"

    def __enter__(self) -> Network:
        for name in (self.card, self.host):
            run("ip", "netns", "add", name)
            run("ip", "-n", name, "link", "set", "lo", "up")
        run(
            *("ip", "link", "add", "card0", "netns", self.card, "address", MAC),
            *("type", "veth", "peer", "name", "host0", "netns", self.host),
        )
        for name, link, address in ((self.card, "card0", CARD_IP), (self.host, "host0", HOST_IP)):
            run("ip", "-n", name, "addr", "add", f"{address}/24", "dev", link)
            run("ip", "-n", name, "link", "set", link, "up")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for name in (self.card, self.host):
            run("ip", "netns", "del", name, check=False)

    def in_card(self, *command: str) -> list[str]:
        """A command in the card's namespace."""
        return ["ip", "netns", "exec", self.card, *command]

    def in_host(self, *command: str) -> list[str]:
        """A command in the host's namespace."""
        return ["ip", "netns", "exec", self.host, *command]


class ServedCard:
    """`hm2 emulate` in the card's namespace, with its control socket.

    Its thread is real-time, above LinuxCNC's: a real card does not wait for the host's processor. mesaflash
    gives it 2 ms for its first answer.
    """

    def __init__(self, network: Network, directory: Path, spec: str = "7i92+7i77", *options: str) -> None:
        self.network = network
        self.control, self._log = directory / "control", directory / "card.err"
        self._command = [*HM2, "emulate", spec, "--listen", CARD_IP, "--mac", MAC]
        self._command += ["--priority", "45", "--cpu", str(CARD_CPU)]
        self._command += ["--control", str(self.control), *options]

    def __enter__(self) -> ServedCard:
        with self._log.open("w") as log:
            self._process = subprocess.Popen(
                self.network.in_card(*self._command), stdout=subprocess.PIPE, stderr=log, text=True
            )
        assert self._process.stdout
        if not self._process.stdout.readline().startswith("ready"):
            self.__exit__(None, None, None)
            raise AssertionError(f"the emulated card does not start: {self._log.read_text()}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        self.status = self._process.wait(20)
        assert self._process.stdout
        self._process.stdout.close()

    def get(self, key: str) -> float:
        """What `hm2 emu get` prints."""
        return float(ask(self.control, "get", key))

    def set(self, key: str, value: float) -> None:
        """As `hm2 emu set`."""
        ask(self.control, "set", key, repr(value))

    def hm2(self, *arguments: str) -> Any:
        """What our own driver reports of this card: `hm2 --json ...` in the card's namespace."""
        command = [*HM2, "--json", "--board", f"udp://{CARD_IP}", *arguments]
        return json.loads(run(*self.network.in_card(*command)))

    def mesaflash(self, *arguments: str, device: str = "7I92", check: bool = True, priority: int = 0) -> str:
        """What mesaflash prints. It hangs for ever on an unanswered read, hence the time limit."""
        realtime = ["chrt", "-f", str(priority)] if priority else []
        command = [*realtime, "mesaflash", "--device", device, "--addr", CARD_IP, *arguments]
        return run(*self.network.in_card(*command), timeout=60, check=check)


class HalError(AssertionError):
    """LinuxCNC did not do what it was told."""


class Pins(dict[str, float]):
    """Pins and parameters of LinuxCNC; one that is not there says so."""

    def __missing__(self, name: str) -> float:
        raise HalError(f"LinuxCNC has no pin or parameter {name}: it has not found that part of the card")


class Hal:
    """A HAL session of LinuxCNC in the host's namespace, with shared memory of its own.

    rtapi_app refuses to run as root, so it runs as nobody and gets its rights from its setuid bit.
    """

    def __init__(self, network: Network, directory: Path) -> None:
        self.network = network
        # not below directory: nobody may not go through pytest's
        self.home = Path(tempfile.mkdtemp(prefix="hm2-hal-"))
        shutil.chown(self.home, NOBODY)
        self.directory = directory
        self._numbers = itertools.count()

    def _as_nobody(self, *command: str) -> list[str]:
        return [
            *("setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"),
            *(
                "env",
                f"HOME={self.home}",
                f"RTAPI_FIFO_PATH={self.home}/fifo",
                f"RTAPI_CPU_NUMBER={HOST_CPU}",
                "PATH=/usr/bin:/bin:/usr/sbin:/sbin",
            ),
            *command,
        ]

    def __enter__(self) -> Hal:
        # keeps the namespaces; halrun itself would refuse to run beside another session of the machine
        self._process = subprocess.Popen(
            self.network.in_host("unshare", "--ipc", *self._as_nobody("sleep", "infinity"))
        )
        own = os.readlink("/proc/self/ns/ipc")
        assert until(lambda: os.readlink(f"/proc/{self._inside()}/ns/ipc") != own)
        self._namespace = os.readlink(f"/proc/{self._inside()}/ns/ipc")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(HalError):
            self.halcmd("stop", "unloadrt all")
        self._end()
        for pid in self._of_this_session():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._process.wait()
        shutil.rmtree(self.home, ignore_errors=True)

    def _inside_run(self, *command: str, lines: Sequence[str] = (), output: Any = subprocess.DEVNULL) -> int:
        done = subprocess.run(
            ["nsenter", f"--target={self._inside()}", "--ipc", "--net", *self._as_nobody(*command)],
            input="\n".join(lines) + "\n",
            stdout=output,
            stderr=output,
            text=True,
            timeout=30,
        )
        return done.returncode

    def _end(self) -> None:
        self._inside_run("rtapi_app", "exit")
        until(lambda: not self._of_this_session("rtapi_app"), 10)

    def kill(self) -> None:
        """End LinuxCNC's real-time process as a crash would: none of its code runs any more."""
        for pid in self._of_this_session("rtapi_app"):
            os.kill(pid, signal.SIGKILL)
        assert until(lambda: not self._of_this_session("rtapi_app"), 10), "it is still there"

    @contextlib.contextmanager
    def held_up(self) -> Iterator[None]:
        """LinuxCNC's real-time process does not run in this block, as on a machine that stalls."""
        pids = self._of_this_session("rtapi_app")
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        try:
            yield
        finally:
            for pid in pids:
                os.kill(pid, signal.SIGCONT)

    def last_words(self) -> str:
        """End LinuxCNC, so that what its drivers have printed is there; the lines about the card."""
        self._end()
        return "\n".join(line for line in self.said().splitlines() if "hm2" in line)

    def spawn(self, *command: str, output: Path) -> subprocess.Popen[bytes]:
        """A program of LinuxCNC that goes on, its output in a file."""
        inside = ["nsenter", f"--target={self._inside()}", "--ipc", "--net", *self._as_nobody(*command)]
        with output.open("wb") as file:
            return subprocess.Popen(inside, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT)

    def said(self) -> str:
        """What LinuxCNC has printed; its own messages come when it ends."""
        return "".join(path.read_text(errors="replace") for path in sorted(self.directory.glob("*.log")))

    def halcmd(self, *lines: str) -> str:
        """Commands in one halcmd of their own; what it prints. Raises HalError.

        Into a file: the first loadrt leaves rtapi_app behind, which would hold a pipe open.
        """
        path = self.directory / f"halcmd{next(self._numbers):06}.log"
        with path.open("w") as output:
            status = self._inside_run("halcmd", "-s", "-f", lines=lines, output=output)
        text = path.read_text(errors="replace")
        if status:
            raise HalError(f"{lines}: {text}")
        if not lines[0].startswith("loadrt"):
            path.unlink()
        return text

    def _inside(self) -> int:
        """The process that keeps the session's namespaces."""
        return self._process.pid

    def pins(self, pattern: str = "") -> dict[str, float]:
        """All pins and parameters whose name begins so, as numbers."""
        text = self.halcmd(f"show pin {pattern}*", f"show param {pattern}*")
        found = Pins()
        for line in text.splitlines():
            words = line.split()
            if len(words) >= 5:
                found[words[4]] = _number(words[3])
        return found

    def set(self, **pins: float) -> None:
        """setp for each; names with __ for dots."""
        self.set_pins({name.replace("__", "."): value for name, value in pins.items()})

    def set_pins(self, pins: dict[str, float]) -> None:
        """setp for each, in one go."""
        self.halcmd(*(f"setp {name} {value:g}" for name, value in pins.items()))

    def realtime(self, priority: int) -> None:
        """SCHED_FIFO for LinuxCNC's threads, which are not real-time without its own kernel."""
        for pid in self._of_this_session("rtapi_app"):
            run("chrt", "-f", "-a", "-p", str(priority), str(pid), check=False)

    def _of_this_session(self, name: str = "") -> list[int]:
        """Processes of this session: by its namespace, so that no other is touched."""
        found = []
        for directory in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                command = (directory / "comm").read_text().strip() if directory.name.isdigit() else ""
                if command.startswith(name) and os.readlink(directory / "ns/ipc") == self._namespace:
                    found.append(int(directory.name))
        return found


def _number(text: str) -> float:
    if text in ("TRUE", "FALSE"):
        return float(text == "TRUE")
    try:
        return float(int(text, 16)) if text.startswith("0x") else float(text)
    except ValueError:
        return float("nan")


def until(condition: Any, timeout: float = 2.0) -> bool:
    """Whether the condition comes true within the time."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.01)
    return bool(condition())


def blocks(text: str, start: str) -> list[str]:
    """Text cut at each line that matches `start`."""
    return re.split(f"(?m)^(?={start})", text)[1:]


def missing_programs(names: Sequence[str]) -> list[str]:
    """Those that are not installed."""
    return [name for name in names if shutil.which(name) is None]
