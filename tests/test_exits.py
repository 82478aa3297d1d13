"""Every way out of a process that drives a card turns its outputs off, but for those nobody sees."""

from __future__ import annotations

import functools
import gc
import os
import signal
import struct
import subprocess
import sys
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import hostmot2
from hostmot2 import errors, exits
from hostmot2.board import SafeOff

DDR, DRIVING, OFF = 0x1100, 0x1FFFF, 0

SCRIPT = """
import os, signal, sys, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # as in a terminal, whatever started the tests
signal.signal(signal.SIGHUP, signal.SIG_DFL)
import hostmot2
from hostmot2 import hm2
from hostmot2.board import SafeOff
board = {board}
board.write(0x1100, 0x1FFFF)
board.on_close(lambda: board.write(0x1100, 0), SafeOff.IOPORT)
print("driving", flush=True)
{end}
"""


@pytest.fixture
def card(tmp_path: Path) -> Path:
    image = bytearray(0x10000)
    golden = Path(__file__).parent / "golden/card/idrom_5i25_7i77x2.hex"
    for address, word in map(str.split, golden.read_text().splitlines()):
        struct.pack_into("<I", image, int(address, 16), int(word, 16))
    path = tmp_path / "card.bin"
    path.write_bytes(image)
    return path


def ddr(card: Path) -> int:
    return struct.unpack_from("<I", card.read_bytes(), DDR)[0]


def start(card: Path, end: str, board: str | None = None) -> subprocess.Popen[bytes]:
    script = SCRIPT.format(board=board or f"hostmot2.open('pci://{card}')", end=end)
    environment = os.environ | {"HM2_BOARD": f"pci://{card}"}
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"driving\n"
    return process


@pytest.mark.parametrize(
    ("end", "status"),
    [
        ("board.close()", 0),
        ("pass", 0),
        ("sys.exit(3)", 3),
        ("raise RuntimeError('oops')", 1),
        ("with board: raise RuntimeError('oops')", 1),
        ("signal.raise_signal(signal.SIGINT)", -signal.SIGINT),
    ],
)
def test_outputs_are_off_when_the_program_ends(card: Path, end: str, status: int) -> None:
    process = start(card, end)
    process.communicate(timeout=20)
    assert process.returncode == status
    assert ddr(card) == OFF


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("end", ["time.sleep(30)", "with board: time.sleep(30)"])
def test_outputs_are_off_after_a_signal_nobody_handles(card: Path, number: int, end: str) -> None:
    process = start(card, end)
    assert ddr(card) == DRIVING
    process.send_signal(number)
    process.communicate(timeout=20)
    assert process.returncode == 128 + number
    assert ddr(card) == OFF


def test_a_signal_that_comes_in_a_finalizer_ends_the_program_too(card: Path) -> None:
    """There the interpreter drops the SystemExit that would have ended it."""
    finalizer = "type('T', (), {'__del__': lambda self: signal.raise_signal(signal.SIGTERM) or None})()"
    process = start(card, f"{finalizer}; print('goes on', flush=True); time.sleep(30)")
    out, _ = process.communicate(timeout=20)
    assert (process.returncode, out) == (-signal.SIGTERM, b"")
    assert ddr(card) == OFF


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_program_that_catches_the_end_and_opens_a_board_again_hears_the_next_signal(
    card: Path, number: int
) -> None:
    end = f"""
for _ in range(2):
    try:
        signal.raise_signal({number})
        time.sleep(30)
    except SystemExit:
        board = hostmot2.open('pci://{card}')
        board.write(0x1100, 0x1FFFF)
        board.on_close(lambda: board.write(0x1100, 0), SafeOff.IOPORT)
signal.raise_signal({number})
print('deaf', flush=True)
"""
    process = start(card, end)
    out, _ = process.communicate(timeout=20)
    assert (process.returncode, out) == (128 + number, b"")
    assert ddr(card) == OFF


def test_a_handler_set_behind_the_end_stays_when_a_board_is_opened_again(card: Path) -> None:
    end = f"""
try:
    signal.raise_signal(signal.SIGTERM)
except SystemExit:
    signal.signal(signal.SIGTERM, lambda *_: print('mine', flush=True))
    board = hostmot2.open('pci://{card}')
    signal.raise_signal(signal.SIGTERM)
    time.sleep(0)
"""
    process = start(card, end)
    out, _ = process.communicate(timeout=20)
    assert (process.returncode, out) == (0, b"mine\n")


def test_outputs_are_off_at_once_even_if_a_thread_keeps_the_process_alive(card: Path) -> None:
    thread = "threading.Thread(target=lambda: print(sys.stdin.readline())).start()"
    end = f"{thread}; print('waiting', flush=True); time.sleep(30)"  # the signal must find the thread there
    script = SCRIPT.format(board=f"hostmot2.open('pci://{card}')", end=end + "\n")
    with subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stdout.readline() == b"driving\n"
        assert process.stdout.readline() == b"waiting\n"
        process.send_signal(signal.SIGTERM)
        for _ in range(2000):
            if ddr(card) == OFF:
                break
            signal.sigtimedwait([], 0.01)
        assert ddr(card) == OFF
        assert process.poll() is None
        process.stdin.close()
        process.wait(20)


def test_a_programs_own_handler_stays(card: Path) -> None:
    end = "signal.pause()"
    board = f"(signal.signal(signal.SIGTERM, lambda *_: sys.exit(7)), hostmot2.open('pci://{card}'))[1]"
    process = start(card, end, board)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=20)
    assert process.returncode == 7
    assert ddr(card) == OFF


def test_the_default_board_is_off_at_exit_too(card: Path) -> None:
    process = start(card, "pass", board="hm2")
    process.communicate(timeout=20)
    assert process.returncode == 0
    assert ddr(card) == OFF


def test_a_forked_child_leaves_its_parents_outputs_on(card: Path) -> None:
    end = "pid = os.fork()\nif pid == 0: sys.exit(0)\nos.waitpid(pid, 0); print(hex(board.read(0x1100)))"
    process = start(card, end)
    assert process.communicate(timeout=20)[0] == b"0x1ffff\n"
    assert ddr(card) == OFF


@pytest.mark.parametrize("way", ["sys.exit(0)", "board.close(); os._exit(0)"])
def test_a_forked_child_ends_though_a_thread_of_its_parent_had_the_board(card: Path, way: str) -> None:
    """In the child nobody gives back what that thread held."""
    end = f"""
def use():
    while True:
        board.read(0x400)
threading.Thread(target=use, daemon=True).start()
for _ in range(20):
    pid = os.fork()
    if pid == 0:
        signal.alarm(10)  # ends one that waits for ever
        {way}
    if os.waitpid(pid, 0)[1]: sys.exit("a child hung")
print(hex(board.read(0x1100)))"""
    process = start(card, end)
    assert process.communicate(timeout=40)[0] == b"0x1ffff\n"
    assert ddr(card) == OFF


def test_a_forked_child_cannot_use_its_parents_card(card: Path) -> None:
    end = """
pid = os.fork()
if pid == 0:
    try:
        board.write(0x1100, 0)
    except hostmot2.errors.TransportClosed as refused:
        assert "forked" in str(refused.causes) and board.closed
        os._exit(0)
    os._exit(1)
assert os.waitpid(pid, 0)[1] == 0
board.write(0x1104, 5)
print(hex(board.read(0x1100)))"""
    process = start(card, end)
    assert process.communicate(timeout=40)[0] == b"0x1ffff\n"
    assert process.returncode == 0
    assert ddr(card) == OFF


def test_a_board_that_is_dropped_is_made_safe_with_a_warning(card: Path) -> None:
    board = hostmot2.open(f"pci://{card}")
    board.write(DDR, DRIVING)
    board.on_close(functools.partial(board.write, DDR, OFF), SafeOff.IOPORT)
    del board
    with pytest.warns(ResourceWarning, match="without close"):
        gc.collect()
    assert ddr(card) == OFF
    hostmot2.open(f"pci://{card}").close()


def test_a_killed_process_turns_nothing_off_so_the_watchdog_must(card: Path) -> None:
    process = start(card, "time.sleep(30)")
    process.kill()
    process.communicate(timeout=20)
    assert ddr(card) == DRIVING


def test_the_default_board_is_the_emulated_card_and_says_so() -> None:
    script = "from hostmot2 import hm2; print(hm2); print(hm2.name, len(hm2.pins)); hm2.close(); print(hm2)"
    environment = {key: value for key, value in os.environ.items() if key != "HM2_BOARD"}
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=True
    )
    assert done.stdout.splitlines() == ["<default board, not open>", "5I25 34", "<default board, not open>"]
    assert done.stderr.count("emu://5i25+7i77") == 1


class Closable:
    """Notes that it was closed, and fails at it if it is told to."""

    def __init__(self, error: BaseException | None) -> None:
        self.error, self.closed = error, False

    def close(self) -> None:
        self.closed = True
        if self.error is not None:
            raise self.error

    def disown(self) -> None:
        raise AssertionError("no child is made here")


def test_at_the_end_all_boards_are_closed_whichever_of_them_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    boards = [Closable(None), *(Closable(errors.TransportTimeout("lost")) for _ in range(3)), Closable(None)]
    monkeypatch.setattr(exits, "_open", weakref.WeakSet(boards))
    with pytest.raises(errors.TransportTimeout, match="lost"):
        exits.close_all()
    assert all(board.closed for board in boards)


def test_a_board_may_be_opened_in_any_thread(card: Path) -> None:
    """Signals are the main thread's: another one leaves their handlers alone."""

    def opened() -> str:
        with hostmot2.open(f"pci://{card}") as board:
            return board.name

    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        with ThreadPoolExecutor(1) as threads:
            assert threads.submit(opened).result() == "5I25"
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)
