"""A motor runs on an emulated Ethernet card in this process; another process drives it and ends, by any way.

However it ends, the amplifier is off within the card's watchdog time (50 ms).
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.ethernet import EthernetServer
from hostmot2.emulator.plant import Motor, couple_dc_motor

WATCHDOG = 0.05
PATIENCE = 20.0
TRIES = 6

DRIVER = """
import os, signal, sys, time
import hostmot2
with hostmot2.open(sys.argv[1]) as board:
    card = board.card("7i77")
    card.start()
    card.analog[0].volts = 4.0
    card.analog_enable = True
    started = time.monotonic()
    told = False
    while time.monotonic() - started < 15:
        card.exchange()
        if not told and time.monotonic() - started > 0.3:
            print("driving", flush=True)
            told = True
            {end}
"""

ENDS = {
    "end of the block": "break",
    "exception": "raise RuntimeError('user')",
    "sys.exit": "sys.exit(0)",
    "SIGTERM": "os.kill(os.getpid(), signal.SIGTERM)",
    "Ctrl-C": "os.kill(os.getpid(), signal.SIGINT)",
    "SIGKILL": "os.kill(os.getpid(), signal.SIGKILL)",
    "os._exit": "os._exit(3)",
    "standing still": "os.kill(os.getpid(), signal.SIGSTOP)",
}


class Bench:
    """The emulated card with its motor, served on a port of this machine."""

    def __init__(self) -> None:
        self.board = EmulatedBoard("7i92+7i77", clock="real")
        self.motor: Motor = couple_dc_motor(self.board)
        self.server = EthernetServer(self.board, port=0)

    def torque(self) -> float:
        with self.server.card.hold():
            return self.motor.torque

    def speed(self) -> float:
        with self.server.card.hold():
            return self.motor.turns_per_second


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    with bench.server:
        yield bench


@contextmanager
def drive(bench: Bench, end: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process that has been driving the motor for a while.

    On a busy machine it may stall for longer than the watchdog allows before it is that far, which is what
    the watchdog is for and not what is asked here: then another one tries.
    """
    script = DRIVER.replace("{end}", end)
    for _ in range(TRIES):
        with subprocess.Popen(
            [sys.executable, "-c", script, bench.server.url],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        ) as process:
            assert process.stdout is not None
            if process.stdout.readline() == b"driving\n":
                try:
                    yield process
                finally:
                    process.send_signal(signal.SIGKILL)
                return
    pytest.skip(f"this machine stalls for more than {WATCHDOG} s again and again")


@pytest.mark.parametrize("end", list(ENDS))
def test_the_amplifier_is_off_within_the_watchdogs_time(bench: Bench, end: str) -> None:
    with drive(bench, ENDS[end]) as process:
        if end != "standing still":
            process.wait(PATIENCE)
        # whatever the machine was doing, the card's own clock has gone on for the watchdog's time by now
        time.sleep(2 * WATCHDOG)
        assert bench.torque() == 0.0
        assert bench.speed() != 0.0, "it had been turning, and runs out"


def test_a_pulled_cable_stops_it_too(bench: Bench) -> None:
    with drive(bench, "pass"):
        bench.server.set_fault("loss=100%")
        time.sleep(2 * WATCHDOG)
        assert bench.torque() == 0.0
