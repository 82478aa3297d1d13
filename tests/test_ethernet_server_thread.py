"""The emulated card's packets are handled by one C thread: no Python, no interpreter lock for any."""

from __future__ import annotations

import ctypes
import os
import select
import socket
import subprocess
import sys
import threading
import time

import pytest
from scripted_card import ScriptedCard

from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.ethernet import EthernetServer

CLIENT = """
import socket, sys, time
card = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
card.connect(("127.0.0.1", int(sys.argv[1])))
card.settimeout(0.02)
request, end, times = bytes.fromhex(sys.argv[2]), time.monotonic() + float(sys.argv[3]), []
print("ready", flush=True)
while time.monotonic() < end:
    try:
        card.send(request)
        card.recv(2048)
        times.append(time.monotonic())
    except OSError:
        pass
print(*times)
"""
REQUEST = "01420001 8c420035 82c20010 00000000 00000000 89590000".replace(" ", "")
"""Cookie, twelve encoders, a write to the I/O ports, the engine's counters."""
HOLD, EDGE = 0.7, 0.1
"""Seconds; at its edges other threads of Python still have, or have again, the lock."""
LEAST = 1000
"""Answers meanwhile: a round trip takes 30 us, on a busy machine more."""

_holding = ctypes.PyDLL(None)
"""libc without letting go of the interpreter lock, as cffi and ctypes.CDLL do."""


def answers_while_python_stands_still(port: int) -> int:
    """How many answers another process gets while this one's interpreter lock is held by one C call."""
    client = subprocess.Popen(
        [sys.executable, "-c", CLIENT, str(port), REQUEST, str(HOLD + 1.0)], stdout=subprocess.PIPE, text=True
    )
    assert client.stdout
    assert client.stdout.readline() == "ready\n"
    time.sleep(0.2)
    start = time.monotonic()
    _holding.usleep(round(HOLD * 1e6))
    times = [float(word) for word in client.communicate(timeout=60)[0].split()]
    assert times, "no answer at all, not even while Python ran"
    return sum(start + EDGE < at < start + HOLD - EDGE for at in times)


@pytest.fixture
def server():
    with EmulatedBoard("7i92+7i77", clock="real") as board, EthernetServer(board) as server:
        yield server


def test_packets_are_answered_while_the_interpreter_lock_is_held(server: EthernetServer):
    counts = []
    for _ in range(3):  # other programs may have the machine for a while
        counts.append(answers_while_python_stands_still(server.port))
        if counts[-1] >= LEAST:
            return
    raise AssertionError(f"answers while Python stood still: {counts}")


def test_a_server_that_needs_python_is_found_out():
    """The measurement above can fail: this one answers from a Python thread."""
    with ScriptedCard() as card:
        assert 0 in (answers_while_python_stands_still(card.port) for _ in range(3))


def tasks() -> set[str]:
    """Threads of this process, Python's and all others."""
    return set(os.listdir("/proc/self/task"))


def test_there_is_one_thread_and_python_does_not_know_it():
    with EmulatedBoard("7i92+7i77", clock="real") as board:
        before, threads, frames = tasks(), threading.active_count(), len(sys._current_frames())
        with EthernetServer(board) as server:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
                client.connect(("127.0.0.1", server.port))
                client.settimeout(5)
                for _ in range(2000):
                    client.send(bytes.fromhex(REQUEST))
                    assert client.recv(2048)
            assert len(tasks() - before) == 1
            assert threading.active_count() == threads
            assert len(sys._current_frames()) == frames
        assert tasks() <= before  # others may end meanwhile


@pytest.mark.parametrize("wait", ["02", "06"])
def test_a_packet_that_waits_keeps_nobody_from_the_card(wait: str):
    """Its time passes on the card as on any other, for microseconds or for an edge."""
    limit = "01d10400ffff"  # timers, WAIT_LIMIT
    request = bytes.fromhex(limit + f"30d1{wait}00" + "ffff" * 48 + "01420001")  # three seconds
    with (
        EmulatedBoard("7i92+7i77", clock="real") as board,
        EthernetServer(board) as server,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client,
    ):
        client.connect(("127.0.0.1", server.port))
        client.settimeout(60)
        client.send(request)
        while not server.counters.requests:
            time.sleep(0.001)
        time.sleep(0.2)  # it is waiting by now
        for _ in range(20):
            board.sync()
        time.sleep(0.1)  # an answer that was held up by the above only would be there
        assert not select.select([client], [], [], 0)[0], "nobody's turn before the answer"
        assert client.recv(2048)
