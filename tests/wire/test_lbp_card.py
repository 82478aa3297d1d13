"""The LBP client through the emulated card's SSLBP pass-through."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import hostmot2
from hostmot2 import lbp
from hostmot2.board import Board
from hostmot2.cli.session import Session
from hostmot2.emulator import EmulatedBoard, catalog
from hostmot2.lbp.card import check_flash_revision, open_channel
from hostmot2.lbp.errors import FirmwareRefused, LineSilent, RemoteRefused
from hostmot2.sserial import NoRemote, PortRunning, RemoteSilent
from wire.lines import emulated

pytestmark = pytest.mark.timeout(60)


@pytest.fixture
def card() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="virtual")


def test_the_same_client_reads_and_writes_through_the_card(card: EmulatedBoard) -> None:
    with hostmot2.open(card) as board:
        with open_channel(board.sserial[0], 0) as remote:
            assert (remote.name, remote.unit_number) == ("7I77", 0x12000001)
            assert remote.discovery().receive_size == 5
            values = lbp.parameters(remote)
            values["NVWATCHDOGTIME"] = 100
            assert values["NVWATCHDOGTIME"] == 100
            remote.pointer = values.parameter("WatchDogTime").field.address
            assert remote.read_next(2) == b"\x32\x00"
            with pytest.raises(ValueError, match="passed through"):
                remote.run_rpc(5)
        assert board.sserial[0].mode == "stopped"
    assert card.sserial[0].remote(0).get_raw("NVWatchDogTimeout") == 100


def test_a_wrong_address_is_refused(card: EmulatedBoard) -> None:
    with hostmot2.open(card) as board, open_channel(board.sserial[0], 0) as remote:
        with pytest.raises(RemoteRefused):
            remote.read_remote(0xF000)
        assert remote.read_remote(0x0010, 1) >= 0


def test_not_while_the_port_runs_and_not_without_a_remote(card: EmulatedBoard) -> None:
    with hostmot2.open(card) as board:
        with pytest.raises(NoRemote):
            open_channel(board.sserial[0], 2)
        assert board.sserial[0].channels[2].crc
        board.sserial.start(1)
        with pytest.raises(PortRunning):
            open_channel(board.sserial[0], 0)


def test_a_channel_has_its_checksum_again_whatever_ended_the_look_without_one(
    card: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    with hostmot2.open(card) as board:
        port = board.sserial[0]
        failures = iter(
            [NoRemote("nobody"), RemoteSilent("the line"), NoRemote("nobody"), KeyboardInterrupt()]
        )

        def fail(channel: int) -> None:
            raise next(failures)

        monkeypatch.setattr(port, "restart_setup", fail)
        for expected in (RemoteSilent, KeyboardInterrupt):
            with pytest.raises(expected):
                open_channel(port, 0)
            assert port.channels[0].crc


def test_an_8i20_whose_crc_is_off_is_found_and_the_channel_put_back(card: EmulatedBoard) -> None:
    """sserial.md 7.4."""
    drive = catalog.remote("8i20")
    drive.set_raw("NVCRCENABLE", 0)
    drive.power_cycle()
    card.sserial[0].attach(2, drive)
    with hostmot2.open(card) as board:
        with open_channel(board.sserial[0], 2) as remote:
            assert lbp.parameters(remote)["BUSV"] == 32000
        assert board.sserial[0].channels[2].crc


def test_uflbp_through_the_card(
    card: EmulatedBoard, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    from hostmot2.cli import main

    remote = emulated("7i77-io")
    card.sserial[0].attach(0, remote)

    @contextmanager
    def board(_self: Session) -> Iterator[Board]:
        with hostmot2.open(card) as opened:
            yield opened

    monkeypatch.setattr(Session, "board", board)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    (tmp_path / "7I77.BIN").write_bytes(bytes(0x400) + b"\xa5" * 0x400)
    with pytest.raises(SystemExit) as end:
        main(["uflbp", str(tmp_path / "7I77.BIN"), "--channel", "0.0"])
    assert not end.value.code
    assert "cycle the power" in capfd.readouterr().out
    assert remote.peek(0x400, 0x400, space=2) == b"\xa5" * 0x400


@pytest.mark.parametrize(
    ("revision", "name", "refused"),
    [("1.33", "7I77", True), ("1.34", "7I77", False), ("1.36", "8I20", True), ("1.37", "8I20", False)],
)
def test_flash_is_not_reached_through_older_firmware_of_the_card(
    card: EmulatedBoard, monkeypatch: pytest.MonkeyPatch, revision: str, name: str, refused: bool
) -> None:
    with hostmot2.open(card) as board:
        port = board.sserial[0]
        monkeypatch.setattr(type(port), "revision", revision)
        if not refused:
            check_flash_revision(port, name)
            return
        with pytest.raises(FirmwareRefused, match=f"SSLBP {revision} cannot reach flash"):
            check_flash_revision(port, name)


def test_a_remote_that_falls_silent_is_a_silent_line(
    card: EmulatedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    with hostmot2.open(card) as board:
        port = board.sserial[0]
        remote = open_channel(port, 0)
        waited: list[float] = []
        monkeypatch.setattr(port, "pause", waited.append)

        def silent(*_arguments: object) -> None:
            raise RemoteSilent("no valid answer")

        monkeypatch.setattr(port, "access_remote", silent)
        with pytest.raises(LineSilent, match="no answer to"):
            remote.sync(timeout_s=0.15)
        assert len(waited) == 2, "a cookie is asked for three times in 0.15 s, with a rest in between"
        monkeypatch.setattr(port, "restart_setup", silent)
        with pytest.raises(LineSilent, match="no valid answer"):
            remote.link.resync()
        monkeypatch.undo()
        remote.close()
