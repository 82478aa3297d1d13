"""Serial ports of the operating system: what goes wrong with them is an error with a name, never a value."""

from __future__ import annotations

import errno
import os
import sys
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial

from hostmot2 import lbp
from hostmot2.errors import PermissionDenied
from hostmot2.lbp import serial_port
from hostmot2.lbp.adapters import adapters
from hostmot2.lbp.errors import AdapterBusy, AdapterMissing, LineSilent
from hostmot2.lbp.opening import open_stream
from hostmot2.lbp.serial_port import SerialStream


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """The other end of a port, and the port's path."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    path = os.ttyname(theirs)
    os.close(theirs)
    yield ours, path
    os.close(ours)


@pytest.mark.parametrize(
    "use",
    [
        lambda stream: stream.send(b"\xdf\x16"),
        lambda stream: stream.receive(1, 0.001),
        lambda stream: stream.flush(),
    ],
    ids=["send", "receive", "flush"],
)
def test_a_port_that_goes_away_is_a_silent_line(use: Callable[[SerialStream], object]) -> None:
    ours, theirs = os.openpty()
    path = os.ttyname(theirs)
    stream = SerialStream(path)
    os.close(theirs)
    os.close(ours)  # as if the adapter was pulled
    with pytest.raises(LineSilent, match=path):
        use(stream)
    stream.close()


@pytest.mark.parametrize(
    ("first", "use"),
    [("write", lambda stream: stream.send(b"\xdf\x16")), ("in_waiting", lambda stream: stream.flush())],
    ids=["send", "flush"],
)
def test_a_port_that_goes_away_within_a_step_is_a_silent_line(
    monkeypatch: pytest.MonkeyPatch, first: str, use: Callable[[SerialStream], object]
) -> None:
    """What termios says then is no OSError."""
    ours, theirs = os.openpty()
    path = os.ttyname(theirs)
    stream = SerialStream(path)
    os.close(theirs)

    def pulled(*_: object) -> int:
        os.close(ours)
        return 2

    monkeypatch.setattr(serial.Serial, first, pulled if first == "write" else property(pulled))
    with pytest.raises(LineSilent, match=path):
        use(stream)
    stream.close()


@pytest.mark.parametrize(
    ("number", "kind", "said"),
    [
        (errno.EACCES, PermissionDenied, "not today"),
        (errno.EPERM, PermissionDenied, "not today"),
        (errno.EBUSY, AdapterBusy, "another program uses it"),
        (errno.ENODEV, AdapterMissing, "no such port"),
        (errno.EIO, AdapterMissing, "not today"),
    ],
)
def test_why_a_port_does_not_open(
    monkeypatch: pytest.MonkeyPatch, number: int, kind: type[Exception], said: str
) -> None:
    def refuse(*_arguments: object, **_options: object) -> None:
        raise serial.SerialException(number, "not today")

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(kind, match=f"/dev/ttyX7: .*{said}") as caught:
        SerialStream("/dev/ttyX7")
    assert caught.value.os_errno == number  # type: ignore[attr-defined]


def test_a_file_is_no_port(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("keep me")
    with pytest.raises(AdapterMissing, match=r"notes\.txt"):
        lbp.open(str(path))
    assert path.read_text() == "keep me"


def test_a_port_is_this_programs_alone(terminal: tuple[int, str]) -> None:
    stream = SerialStream(terminal[1])
    assert str(stream) == terminal[1]
    with pytest.raises(AdapterBusy, match="another program uses it"):
        SerialStream(terminal[1])
    stream.close()


@pytest.mark.parametrize(("before", "after"), [("16\n", "1"), ("1\n", "1\n"), ("odd", "odd")])
def test_a_chip_that_holds_answers_back_is_told_not_to(
    terminal: tuple[int, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: str, after: str
) -> None:
    timer = tmp_path / Path(terminal[1]).name / "latency_timer"
    timer.parent.mkdir()
    timer.write_text(before)
    monkeypatch.setattr(serial_port, "USB_SERIAL", tmp_path)
    SerialStream(terminal[1]).close()
    assert timer.read_text() == after


@pytest.mark.parametrize("port", ["/dev/ttyUSB0", "ftdi:///1"])
def test_without_the_packages_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, port: str) -> None:
    for module in ("hostmot2.lbp.serial_port", "hostmot2.lbp.ftdi"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    for package in ("serial", "pyftdi", "pyftdi.ftdi"):
        monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ModuleNotFoundError) as caught:
        open_stream(port)
    assert any("hostmot2[serial]" in note for note in caught.value.__notes__)


def test_adapters_that_no_package_lists_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("serial.tools", "pyftdi.ftdi"):
        monkeypatch.setitem(sys.modules, package, None)
    assert adapters() == []
