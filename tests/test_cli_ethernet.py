"""The commands for Ethernet cards, and the emulated card as a process."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from bitfile_samples import payload, xilinx

import hostmot2
from hostmot2.cli import emulate as emulate_module
from hostmot2.cli import main
from hostmot2.cli.emulate import _above_ordinary_programs, _described
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.cards import CARD_NAMES, card
from hostmot2.emulator.control import ask
from hostmot2.emulator.ethernet import DESCRIPTIONS, EthernetCard, EthernetDescription, EthernetServer
from hostmot2.ethernet import Flash


@pytest.fixture
def server():
    with EthernetServer(EthernetCard(EthernetDescription("7I92", reload_us=20_000))) as server:
        server.card.process(bytes.fromhex("81c20001fecaaa55"))
        yield server


def test_discover_lists_cards_and_ends_with_3_without_any(hm2, server):
    status, out, _ = hm2("--json", "discover", "127.0.0.1", "--port", str(server.port))
    found = json.loads(out)
    assert status == 0
    assert [card["name"] for card in found["cards"] if card["url"].startswith("udp:")] == ["7I92"]
    server.stop()
    status, out, _ = hm2("discover", "127.0.0.1", "--port", str(server.port), "--timeout", "0.05")
    assert (status, "no card among" in out) == (3, True)


def test_ip_shows_and_stores(hm2, server):
    status, out, _ = hm2("--json", "--board", server.url, "ip")
    assert (status, json.loads(out)["card"]["eeprom_ip"]) == (0, "10.10.10.10")
    assert hm2("--board", server.url, "ip", "10.10.10.77")[0] == 2
    assert server.card.peek(2, 0x20) == 0x0A0A
    status, out, _ = hm2("--board", server.url, "ip", "10.10.10.77", "--yes")
    assert (status, "10.10.10.77" in out) == (0, True)


def test_flash_commands(hm2, server, tmp_path: Path):
    image, board = tmp_path / "image.bit", ("--board", server.url, "flash")
    image.write_bytes(xilinx(payload(3000)))
    assert json.loads(hm2(*board, "info", "--json")[1])["boot_block_ok"] is True
    assert hm2(*board, "write", str(image))[0] == 2
    assert hm2(*board, "write", "--dry-run", str(image))[0] == 0
    assert hm2(*board, "verify", str(image))[0] == 6
    assert hm2(*board, "write", "--yes", str(image))[0] == 0
    assert hm2(*board, "verify", str(image))[0] == 0
    status, _, _ = hm2(*board, "backup", "-o", str(tmp_path / "all.bin"))
    assert status == 0
    assert (tmp_path / "all.bin").read_bytes() == server.card.flash_read(0, server.card.flash_size)
    assert (tmp_path / "all.bin.sha256").read_text().endswith(" *./all.bin\n")
    image.write_bytes(xilinx(payload(3000), part="6slx16ftg256"))
    assert hm2(*board, "write", "--yes", str(image))[0] == 6


@pytest.mark.parametrize(("end", "status"), [(KeyboardInterrupt, 130), (None, 5)])
def test_whoever_cuts_a_write_of_the_flash_short_is_told_what_is_in_it(
    hm2, server, tmp_path: Path, monkeypatch, end, status
):
    image, board = tmp_path / "image.bit", ("--board", server.url, "flash")
    image.write_bytes(xilinx(payload(3000)))
    assert "whole" not in hm2(*board, "write", str(image), "--dry-run")[2]
    real = Flash._write_page

    def write_page(flash: Flash, address: int, page: bytes) -> None:
        real(flash, address, page)
        if end is not None:
            raise end
        server.stop()

    monkeypatch.setattr(Flash, "_write_page", write_page)
    found, out, err = hm2(*board, "write", str(image), "--yes")
    assert (found, out) == (status, "")
    assert "the user area may not be whole" in err
    assert "write again before" in " ".join(err.split())


def test_a_reload_turns_everything_off(hm2):
    with EmulatedBoard("7i92+7i77") as board, EthernetServer(board) as server:
        with server.card.hold():
            board.write(0x1100, 0x1FFFF)
            board.write(0x1000, 0x15)
            assert board.pin(2).level == "1"
        assert hm2("--board", server.url, "reload", "--yes")[0] == 0
        with server.card.hold():
            assert {pin.level for pin in board.pins} <= {"H", "0"}
            assert board.pin(2).level == "H"


def test_what_another_program_drives_is_not_reloaded_and_its_flash_not_written(hm2, tmp_path: Path):
    image = tmp_path / "image.bit"
    image.write_bytes(xilinx(payload(3000)))
    with EmulatedBoard("7i92+7i77") as board, EthernetServer(board) as server:
        with hostmot2.open(server.url) as other, other.engine(rate=200) as engine:
            for refused in (("reload",), ("reload", "--engine"), ("flash", "write", str(image))):
                status, out, err = hm2("--board", server.url, *refused, "--yes")
                assert (status, out, "feeds its watchdog" in err) == (7, "", True), refused
            assert hm2("--board", server.url, "flash", "write", str(image), "--dry-run")[0] == 0
            assert engine.status.running
            assert not other.watchdog.has_bitten
        assert hm2("--board", server.url, "flash", "write", str(image), "--yes")[0] == 0
        assert hm2("--board", server.url, "reload", "--yes")[0] == 0


def test_reload_needs_yes(hm2, server):
    assert hm2("--board", server.url, "reload")[0] == 2
    assert server.card.process(bytes.fromhex("01420001")) == bytes.fromhex("fecaaa55")
    assert hm2("--board", server.url, "reload", "--yes")[0] == 0
    assert server.card.process(bytes.fromhex("01420001")) == bytes(4)


def test_service_commands_want_an_ethernet_card(hm2):
    assert hm2("--board", "emu://5i25+7i77", "ip")[0] == 2


def test_no_card_is_a_communication_error(hm2, server):
    server.close()
    status, _, err = hm2("--board", server.url, "ip")
    assert (status, "Connection refused" in err) == (5, True)


@contextmanager
def emulate(*arguments: str):
    """`hm2 emulate` as a process, and its URL."""
    command = [sys.executable, "-c", "from hostmot2.cli import main; main()", "emulate", *arguments]
    process = subprocess.Popen([*command, "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
    try:
        ready = process.stdout.readline().split()
        assert ready[0] == "ready"
        yield process, ready[1]
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.fixture
def emulator(tmp_path: Path):
    """The process, its URL, its control socket."""
    control = tmp_path / "control"
    with emulate("7i92+7i77", "--control", str(control), "--fault", "loss=2%,seed=3") as (process, url):
        yield process, url, control


def test_a_dump_is_served_as_the_card_it_was_taken_from(hm2, tmp_path: Path):
    file = str(tmp_path / "card.hm2dump")
    assert hm2("--board", "emu://7i92+7i77+7i76", "dump", "-o", file)[0] == 0
    with emulate(file) as (_, url):
        found = json.loads(hm2("--json", "--board", url, "info")[1])
    assert (found["name"], "stepgen" in found["modules"]) == ("7I92", True)
    with emulate(file, "--name", "MYCARD") as (_, url):
        assert json.loads(hm2("--json", "--board", url, "ip")[1])["card"]["name"] == "MYCARD"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_emulate_serves_until_told_and_ends_with_0(emulator, hm2, number):
    process, url, control = emulator
    assert "7I92" in hm2("--board", url, "info")[1]
    process.send_signal(number)
    assert process.wait(10) == 0
    assert not control.exists()


def test_emulate_serves_on_the_processor_it_is_given(hm2):
    cpu = max(os.sched_getaffinity(0))
    with emulate("7i92+7i77", "--cpu", str(cpu)) as (process, url):
        assert "7I92" in hm2("--board", url, "info")[1]
        threads = [os.sched_getaffinity(int(thread)) for thread in os.listdir(f"/proc/{process.pid}/task")]
        assert threads.count({cpu}) >= 1
    status, _, err = hm2("emulate", "7i92+7i77", "--listen", "127.0.0.1:0", "--cpu", "1023")
    assert (status, "Invalid argument" in err) == (5, True), err


def test_emu_gets_and_sets(emulator, hm2):
    _, _, control = emulator
    at = ("emu", "--control", str(control))
    assert hm2(*at, "get", "fault.loss")[1] == "0.02\n"
    assert hm2(*at, "set", "fault.loss", "0")[0] == 0
    assert float(ask(control, "get", "fault.loss")) == 0
    hm2(*at, "set", "encoder0_position", "-5")
    assert hm2(*at, "get", "encoder0_position")[1] == "-5\n"
    assert hm2(*at, "get", "encoder0_rate")[1] == "0\n"
    assert hm2(*at, "set", "encoder0_rate", "-1000.5")[0] == 0
    assert hm2(*at, "get", "encoder0_rate")[1] == "-1000.5\n"
    for wrong in (
        ("get", "nothing"),
        ("set", "fault.loss", "2"),
        ("set", "led0", "1"),
        ("get", "encoder9_x"),
    ):
        assert hm2(*at, *wrong)[0] == 2
    status, _, err = hm2("emu", "--control", os.devnull + "x", "get", "led0")
    assert (status, os.devnull + "x" in err) == (3, True)


def test_the_control_socket_of_a_killed_emulator_is_taken_over_and_no_other(emulator, hm2, tmp_path: Path):
    process, _, control = emulator
    at = ("emulate", "7i92+7i77", "--listen", "127.0.0.1:0", "--control")
    status, _, err = hm2(*at, str(control))
    assert (status, str(control) in err) == (5, True)
    assert ask(control, "get", "led0") == "0"
    process.kill()
    process.wait()
    with emulate("7i92+7i77", "--control", str(control)):
        assert ask(control, "get", "led0") == "0"
    notes = tmp_path / "notes.txt"
    notes.write_text("mine")
    assert hm2(*at, str(notes))[0] == 5
    assert notes.read_text() == "mine"


@pytest.mark.parametrize("spec", ["5i25+7i77", "7i96s", "7i80db", "no-card"])
def test_only_ethernet_cards_that_are_emulated_are_served_and_the_refusal_lists_them(hm2, spec):
    status, _, err = hm2("emulate", spec)
    assert status == 2
    listed = err.partition("; there are ")[2].split(", ")
    assert f"no emulated Ethernet card {spec!r}" in err
    assert {name.strip() for name in listed} == {name for name in CARD_NAMES if card(name).bus == "ethernet"}


def test_every_ethernet_card_that_is_emulated_says_what_it_is():
    served = {name for name in CARD_NAMES if card(name).bus == "ethernet"}
    assert {name.split("+")[0] for name in served} == set(DESCRIPTIONS)


def test_what_emulate_cannot_take_is_refused(hm2):
    status, _, err = hm2("emulate", "7i92", "--fault", "loss=200%")
    assert (status, "'--fault': 200%: a probability is 0 to 1" in err) == (2, True)
    status, _, err = hm2("emulate", "7i92", "--listen", "127.0.0.1:x")
    assert (status, "127.0.0.1:x: HOST or HOST:PORT" in err) == (2, True)


def test_emulate_gives_signals_back(taken_port: int, capsys: pytest.CaptureFixture[str]) -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with pytest.raises(SystemExit):
        main(["emulate", "7i92+7i77", "--listen", f"127.0.0.1:{taken_port}"])
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_comes_early_and_in_a_librarys_thread_ends_emulate_with_0(hm2, monkeypatch, number):
    over = threading.Event()
    library = threading.Thread(target=over.wait)
    library.start()
    echo = emulate_module.click.echo

    def said(text: str, **options: Any) -> None:
        echo(text, **options)
        if text.startswith("ready"):
            signal.pthread_kill(library.ident, number)

    monkeypatch.setattr(emulate_module.click, "echo", said)
    try:
        assert hm2("emulate", "7i92+7i77", "--listen", "127.0.0.1:0")[0] == 0
    finally:
        over.set()
        library.join()


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        yield taken.getsockname()[1]


def test_restarting_the_ethernet_engine_leaves_the_registers(hm2, server):
    assert hm2("--board", server.url, "reload", "--engine", "--yes")[0] == 0
    assert server.card.process(bytes.fromhex("01420001")) == bytes.fromhex("fecaaa55")


def test_what_follows_an_image_in_its_file_is_said(hm2, server, tmp_path: Path):
    (tmp_path / "image.bit").write_bytes(xilinx(payload(3000)) + b"abc")
    _, _, err = hm2("--board", server.url, "flash", "write", "--dry-run", str(tmp_path / "image.bit"))
    assert "image.bit: 3 bytes follow the configuration data" in err


@pytest.mark.parametrize(("spec", "name"), [("7i92+7i77", "7I92"), ("7i76e", "7I76")])
def test_a_served_dump_has_the_name_in_its_idrom(spec: str, name: str) -> None:
    assert _described(card(spec).idrom()).name == name


@pytest.mark.parametrize("permitted", [True, False])
def test_who_steers_the_card_is_above_ordinary_programs_only_meanwhile(monkeypatch, permitted: bool) -> None:
    asked = []

    def schedule(_pid: int, policy: int, parameters: os.sched_param) -> None:
        if policy == os.SCHED_FIFO and not permitted:
            raise PermissionError
        asked.append((policy, parameters.sched_priority))

    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    with _above_ordinary_programs():
        assert asked == [(os.SCHED_FIFO, 1)] * permitted
    assert asked[-1] == (os.SCHED_OTHER, 0)
