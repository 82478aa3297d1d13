"""What takes a card over, on a card that another program drives: it keeps its hands off it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import hostmot2
from hostmot2.cli import main
from hostmot2.emulator import EmulatedBoard
from hostmot2.modules import driven
from hostmot2.recording.bus import BusAround, places
from hostmot2.transports.emulated import transport_of

COMMANDS = {
    "record": ["record", "-o", "run.mcap", "--seconds", "0.05"],
    "live": ["live", "--port", "0", "--seconds", "0.05", "--layout", "run.mcap"],
    "scan": ["sserial", "scan"],
    "start": ["sserial", "start", "0x03"],
    "stop": ["sserial", "stop"],
    "param": ["param", "list", "-c", "0.1"],
}


class Witness(BusAround):
    """Passes everything on and notes what was written."""

    def __init__(self, card: EmulatedBoard) -> None:
        super().__init__(transport_of(card))
        self.written: list[int] = []

    def begin(self, transfers: Any, count: int, error: Any) -> int:
        self.written += [address for address, write, *_ in places(transfers, count) if write]
        return super().begin(transfers, count, error)


@pytest.fixture
def card() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="real")


@pytest.fixture
def witness(card: EmulatedBoard, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Witness:
    """On the bus of the commands, which open this card whatever their URL."""
    seen = Witness(card)
    monkeypatch.setattr(hostmot2, "open", lambda _url, **_: hostmot2.Board(seen.transport))
    monkeypatch.chdir(tmp_path)
    return seen


@pytest.fixture
def driver(card: EmulatedBoard) -> Iterator[Any]:
    """The other program: its remotes run, its watchdog is armed."""
    with hostmot2.Board(transport_of(card)) as board:
        board.watchdog.timeout = 30.0
        board.card("7i77").start()
        board.card("7i77").exchange()
        yield board


def status_of(arguments: list[str]) -> int:
    with pytest.raises(SystemExit) as end:
        main(["--board", "emu://5i25+7i77", *arguments])
    return int(end.value.code or 0)


@pytest.mark.parametrize("command", list(COMMANDS))
def test_a_card_that_another_program_drives_is_left_alone(
    command: str, card: EmulatedBoard, witness: Witness, driver: Any, monkeypatch: Any, capfd: Any
) -> None:
    pytest.importorskip("foxglove")
    Path("run.mcap").write_text("what was recorded before")
    monkeypatch.setattr(driven.time, "sleep", lambda _seconds: driver.watchdog.feed())
    before = len(witness.written)
    assert status_of(COMMANDS[command]) == 7
    assert "driven by another program" in capfd.readouterr().err
    assert witness.written[before:] == []
    assert Path("run.mcap").read_text() == "what was recorded before"


@pytest.mark.parametrize("command", list(COMMANDS))
def test_a_watchdog_that_only_runs_down_is_nobodys(
    command: str, card: EmulatedBoard, witness: Witness, capfd: Any
) -> None:
    pytest.importorskip("foxglove")
    with hostmot2.Board(transport_of(card)) as killed:
        killed.watchdog.arm(timeout=30.0)
        assert status_of(COMMANDS[command]) == 0, capfd.readouterr().err
    assert witness.written
