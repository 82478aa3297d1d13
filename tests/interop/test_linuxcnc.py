"""LinuxCNC's hm2_eth driving the emulated 7I92 with a 7I77: one minute at 1 kHz, then a bad network.

A run in which the machine itself stalled, so that LinuxCNC's own thread or the card's could not be in time,
says so and is repeated.
"""

from __future__ import annotations

import json
import os
import random
import sys
import time

import pytest
from machine import CARD_IP, Hal, HalError, ServedCard, run, stall_watch, until

CARD = "hm2_7i92.0"
IO, ANALOG = f"{CARD}.7i77.0.0", f"{CARD}.7i77.0.1"
SECONDS = float(os.environ.get("HM2_INTEROP_SECONDS", "60"))
ATTEMPTS = 5
STALL = 0.0006
"""A read may take 0.8 ms, and the exchange itself needs a part of it."""
VOLTS = 2 * 20 / 8191
"""Two steps: LinuxCNC rounds down, and takes a full scale of 4096 where the manual has 4095."""


def start(hal: Hal, *, watchdog_ms: float = 5.0) -> None:
    """Load hm2_eth, a 1 kHz thread at SCHED_FIFO, run."""
    hal.halcmd("loadrt hostmot2", "loadrt threads name1=servo period1=1000000 fp1=1")
    hal.realtime(40)
    for attempt in range(3):
        try:
            hal.halcmd(
                'loadrt hm2_eth board_ip="10.10.10.10" config="num_encoders=6 sserial_port_0=00xxxxxx"'
            )
            break
        except HalError as error:
            # the first batch read has a fixed deadline of 1.6 ms: a stall of the machine misses it
            if "-11" not in str(error) or attempt == 2:
                raise
    hal.halcmd(
        f"setp {CARD}.watchdog.timeout_ns {watchdog_ms * 1e6:.0f}",
        f"addf {CARD}.read servo",
        f"addf {CARD}.write servo",
        "start",
    )
    hal.realtime(40)  # the servo thread was made just now
    assert until(lambda: hal.pins(f"{CARD}.read").get(f"{CARD}.read.time", 0) > 0)


class Plant:
    """Random outputs, inputs, volts and encoder rates, and the check that they get through."""

    def __init__(self, hal: Hal, card: ServedCard, seed: int = 1) -> None:
        self.hal, self.card, self.random = hal, card, random.Random(seed)
        self.rates = [0] * 6
        self.rounds = 0

    def enable(self) -> None:
        self.hal.set_pins({f"{ANALOG}.analogena": 1, f"{ANALOG}.spinena": 1})
        for n in range(6):
            self.hal.set_pins({f"{CARD}.encoder.0{n}.scale": 1, f"{CARD}.encoder.0{n}.filter": 1})

    def round(self) -> None:
        """Everything gets new values, and all must arrive."""
        outputs, inputs = self.random.getrandbits(16), self.random.getrandbits(32)
        volts = [round(self.random.uniform(-10, 10), 3) for _ in range(6)]
        self.rates = [self.random.randrange(-50_000, 50_000) for _ in range(6)]
        pins = {f"{IO}.output-{n:02}": outputs >> n & 1 for n in range(16)}
        pins |= {f"{ANALOG}.analogout{n}": volts[n] for n in range(6)}
        self.hal.set_pins(pins)
        self.card.set("input", inputs)
        for n, rate in enumerate(self.rates):
            self.card.set(f"encoder{n}_rate", rate)
        assert until(lambda: self.card.get("output") == outputs), "field outputs"
        assert until(
            lambda: all(abs(got - set) <= VOLTS for got, set in zip(self.volts(), volts, strict=True))
        )
        assert until(lambda: self.inputs() == inputs), "field inputs"
        assert until(self.velocities_right), f"velocities: {self.velocities()} at {self.rates}"
        self.rounds += 1

    def volts(self) -> list[float]:
        return [self.card.get(f"analogout{n}") for n in range(6)]

    def inputs(self) -> int:
        pins = self.hal.pins(f"{IO}.input")
        return sum(int(pins[f"{IO}.input-{n:02}"]) << n for n in range(32))

    def velocities(self) -> list[float]:
        pins = self.hal.pins(f"{CARD}.encoder")
        return [pins[f"{CARD}.encoder.0{n}.velocity"] for n in range(6)]

    def velocities_right(self) -> bool:
        pairs = zip(self.velocities(), self.rates, strict=True)
        return all(abs(got - rate) <= 20 + abs(rate) * 0.01 for got, rate in pairs)

    def counts_right(self) -> None:
        """Stopped, the counts are where the encoders are."""
        for n in range(6):
            self.card.set(f"encoder{n}_rate", 0)
        offsets = [self.card.get(f"encoder{n}_position") for n in range(6)]

        def equal() -> bool:
            pins = self.hal.pins(f"{CARD}.encoder")
            return [pins[f"{CARD}.encoder.0{n}.count"] for n in range(6)] == offsets

        assert until(equal), (self.hal.pins(f"{CARD}.encoder"), offsets)


def faults(hal: Hal) -> dict[str, float]:
    """Everything by which LinuxCNC says that something went wrong."""
    pins = hal.pins(CARD)
    names = (
        "packet-error-total",
        "packet-error-exceeded",
        "watchdog.has_bit",
        "sserial.port-0.fault-count",
        "io_error",
    )
    return {name: pins[f"{CARD}.{name}"] for name in names}


NO_FAULTS = {
    "packet-error-total": 0,
    "packet-error-exceeded": 0,
    "watchdog.has_bit": 0,
    "sserial.port-0.fault-count": 0,
    "io_error": 0,
}


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_minute_at_1_khz_without_a_fault(network, tmp_path):
    for attempt in range(1, ATTEMPTS + 1):
        directory = tmp_path / str(attempt)
        directory.mkdir()
        worst, found, rounds, requests = minute(network, directory)
        print(
            f"attempt {attempt}: {rounds} rounds, {requests:.0f} datagrams, faults {found}, "
            f"machine's worst stall {max(worst) * 1e3:.2f} ms"
        )
        if found == NO_FAULTS:
            assert requests > SECONDS * 1000  # one read and one write datagram a cycle
            return
        assert max(worst) > STALL, f"the machine was in time, and still: {found}"
    pytest.skip(
        f"NOT SHOWN: the machine itself stalled a real-time process in each of {ATTEMPTS} runs "
        f"(last: {max(worst) * 1e3:.1f} ms); repeat make interop on a quiet one"
    )


def minute(network, directory):
    """One run: worst stalls, faults, rounds of values, datagrams."""
    with ServedCard(network, directory) as card, Hal(network, directory) as hal:
        start(hal)
        plant = Plant(hal, card)
        plant.enable()
        before = card.get("requests")
        with stall_watch(SECONDS + 5) as worst:
            end = time.monotonic() + SECONDS
            found = NO_FAULTS
            while time.monotonic() < end and found == NO_FAULTS:
                try:
                    plant.round()
                except AssertionError:
                    if faults(hal) == NO_FAULTS:
                        raise  # LinuxCNC noticed nothing: the value itself is wrong
                found = faults(hal)
                time.sleep(0.2)
            if found == NO_FAULTS:
                plant.counts_right()
                found = faults(hal)
            requests = card.get("requests") - before
        return worst, found, plant.rounds, requests


OUR_REPORT = """
import json, sys, hostmot2
with hostmot2.open(sys.argv[1]) as board:
    port = board.sserial[0]
    port.scan()
    remotes = [channel for channel in port.channels if channel.description]
    print(json.dumps({
        "name": board.name,
        "encoders": len(board.encoders),
        "remotes": {
            f"{remote.name.lower()}.0.{remote.number}": sorted(
                {name.lower() for name in [*remote.parameters, *(f.name for f in remote.description.fields)]}
            )
            for remote in remotes
        },
    }))
"""


@pytest.mark.timeout(200)
def test_linuxcnc_reports_the_card_as_we_do(card: ServedCard, network, tmp_path):
    ours = json.loads(run(*network.in_card(sys.executable, "-c", OUR_REPORT, f"udp://{CARD_IP}")))
    with Hal(network, tmp_path) as hal:
        start(hal)
        pins = [name.removeprefix(f"{CARD}.") for name in hal.pins(CARD)]
    assert f"discovered {ours['name']}" in hal.said()
    assert "Smart Serial Firmware Version 43" in hal.said()
    encoders = {name for name in pins if name.startswith("encoder.") and name.endswith(".rawcounts")}
    assert len(encoders) == ours["encoders"]
    theirs: dict[str, set[str]] = {}
    for name in pins:
        if name.startswith("7i77."):
            theirs.setdefault(name[:8], set()).add(name[9:].split("-")[0])
    # the one parameter that LinuxCNC hides: a wrong baud rate loses the remote
    assert {remote: sorted({*names, "nvbaudrate"}) for remote, names in theirs.items()} == ours["remotes"]


@pytest.mark.timeout(200)
def test_on_exit_linuxcnc_lets_the_watchdog_bite_and_outputs_are_off(card: ServedCard, network, tmp_path):
    with Hal(network, tmp_path) as hal:
        start(hal)
        hal.set_pins({f"{IO}.output-03": 1, f"{ANALOG}.analogena": 1, f"{ANALOG}.analogout0": 5})
        assert until(lambda: card.get("output") == 8)
        assert until(lambda: abs(card.get("analogout0") - 5) < VOLTS)
    assert until(lambda: card.get("output") == 0 and card.get("analogena") == 0)


@pytest.mark.timeout(200)
def test_single_losses_are_counted_and_survived(card: ServedCard, hal: Hal):
    """hm2_eth: a lost packet adds 2 to the level, a good cycle takes 1 off; I/O goes on."""
    start(hal, watchdog_ms=100)
    plant = Plant(hal, card)
    plant.enable()
    card.set("fault.seed", 7)
    card.set("fault.loss", 0.02)
    for _ in range(5):
        plant.round()
    assert until(lambda: faults(hal)["packet-error-total"] > 0, 5)
    found = faults(hal)
    card.set("fault.loss", 0)
    assert found["packet-error-exceeded"] == found["io_error"] == 0
    assert until(lambda: hal.pins(CARD)[f"{CARD}.packet-error-level"] == 0)
    plant.round()


@pytest.mark.timeout(200)
def test_duplicates_do_no_harm(card: ServedCard, hal: Hal):
    start(hal, watchdog_ms=100)
    plant = Plant(hal, card)
    plant.enable()
    card.set("fault.dup", 0.3)
    card.set("fault.requests", 0)  # replies only: LinuxCNC throws away what has an old counter
    for _ in range(3):
        plant.round()
    assert faults(hal)["packet-error-exceeded"] == faults(hal)["io_error"] == 0


@pytest.mark.timeout(200)
def test_an_outage_stops_everything_and_the_card_turns_off(card: ServedCard, hal: Hal):
    """At the limit io_error goes true and all I/O stops until the user clears it; the watchdog bites."""
    start(hal)
    hal.set_pins({f"{IO}.output-03": 1, f"{ANALOG}.analogena": 1, f"{ANALOG}.analogout0": 5})
    assert until(lambda: card.get("output") == 8)
    card.set("fault.loss", 1)
    assert until(lambda: faults(hal)["io_error"] == 1)
    assert faults(hal)["packet-error-exceeded"] == 1
    assert until(lambda: card.get("output") == 0 and card.get("analogena") == 0)
    requests = card.get("requests")
    card.set("fault.loss", 0)
    time.sleep(0.2)
    assert card.get("requests") == requests  # silent
    hal.set_pins({f"{CARD}.io_error": 0})
    assert until(lambda: card.get("requests") > requests + 100)
    assert until(lambda: faults(hal)["watchdog.has_bit"] == 1)
    assert card.get("output") == 0  # has_bit holds them off
    hal.set_pins({f"{CARD}.watchdog.has_bit": 0})
    # sserial(9): so many failed DOITs stop the port; toggling run enables it again
    assert until(lambda: faults(hal)["sserial.port-0.fault-count"] >= 200)
    hal.set_pins({f"{CARD}.sserial.port-0.run": 0})
    assert until(lambda: hal.pins(CARD)[f"{CARD}.sserial.port-0.port_state"] == 0)
    hal.set_pins({f"{CARD}.sserial.port-0.run": 1})
    assert until(lambda: card.get("output") == 8)


@pytest.mark.timeout(200)
def test_replies_later_than_the_read_timeout_are_errors(card: ServedCard, hal: Hal):
    """80 % of 1 ms: a card that takes 1.2 ms for every answer is as good as none."""
    start(hal, watchdog_ms=100)
    card.set("fault.requests", 0)
    card.set("fault.delay", 1200)
    assert until(lambda: faults(hal)["io_error"] == 1)
    assert faults(hal)["packet-error-total"] >= 5
