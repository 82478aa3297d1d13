"""Firmware updates: what is written, what is refused, what is left alone, and how a cut one is finished."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hostmot2.emulator import DescribedRemote, EmulatedBoard
from hostmot2.lbp import FirmwareRefused, LbpRemote, UpdateFailed, WireLink
from hostmot2.lbp.firmware import plan, read_firmware, update
from hostmot2.registers import LbpLocal
from wire.lines import ROOT, NoisyStream, Recorder, connect, emulated, on_pty, tell

pytestmark = pytest.mark.timeout(120)
FLASH = 2
ERASE = 0x400


def image(blocks: int = 6, empty: tuple[int, ...] = (3,), tail: int = 100) -> bytes:
    """Blocks of random bytes, some all zero, the last one incomplete."""
    data = bytearray(random.Random(5).randbytes(blocks * ERASE + tail))
    for block in empty:
        data[block * ERASE : (block + 1) * ERASE] = bytes(ERASE)
    return bytes(data)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "7I77.BIN"
    path.write_bytes(image())
    return path


@pytest.fixture
def card() -> DescribedRemote:
    card = emulated("7i77-io")
    card.poke(0, bytes(range(256)) * 4, space=FLASH)  # a boot loader
    card.poke(3 * ERASE, b"old" * 300, space=FLASH)
    return card


def assert_updated(card: DescribedRemote, data: bytes) -> None:
    assert card.peek(0, ERASE, space=FLASH) == bytes(range(256)) * 4
    for block in range(1, 7):
        wanted = data[block * ERASE : (block + 1) * ERASE].ljust(ERASE, b"\0")
        got = card.peek(block * ERASE, ERASE, space=FLASH)
        if any(wanted):
            assert got == wanted, f"block {block}"
        else:
            assert got[:3] == b"old"  # neither erased nor written
    assert set(card.peek(7 * ERASE, ERASE, space=FLASH)) == {0xFF}


def test_the_file_is_in_the_flash_and_block_0_untouched(card: DescribedRemote, file: Path) -> None:
    firmware = read_firmware(file)
    seen: list[tuple[int, int]] = []
    with connect(card) as remote:
        todo = plan(remote, firmware)
        assert (todo.blocks, todo.skipped) == ((1, 2, 4, 5, 6), 1)
        assert (todo.erase_size, todo.write_size) == (ERASE, 256)
        update(remote, firmware, todo, progress=lambda done, total: seen.append((done, total)))
        assert remote.read_local(LbpLocal.memory_space) == 0
    assert_updated(card, file.read_bytes())
    assert seen == [(done, 5) for done in range(1, 6)]


def test_block_1_is_erased_with_the_published_frames(card: DescribedRemote, file: Path) -> None:
    """lbp_serial.md 4: sizes, offset 0x400, erase, and the cookie as sync."""
    recorder = Recorder(card)
    remote = LbpRemote(WireLink(recorder))
    firmware = read_firmware(file)
    update(remote, firmware, plan(remote, firmware))
    frames = [sent for sent, _ in recorder.frames]
    for expected in ("EC 02 84", "44 05 80 DC", "44 04 80 18", "66 00 80 00 04 00 00 F3"):
        assert expected in frames
    erase = frames.index("64 07 80 FE A0")
    assert frames[erase + 1] == "DF 16"
    assert frames.count("64 07 80 FE A0") == 5
    assert not any(sent.startswith("66 00 80 00 00 00 00") for sent in frames)  # offset 0, the boot loader
    assert recorder.frames[-1][0] in ("EC 00 38", "C1 94")


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("7I77.HEX", image(), "BIN"),
        ("7I76.BIN", image(), "not for a 7I77"),
        ("7I77.BIN", image(0, ()), "are no more than the boot block"),
        ("7I77.BIN", bytes(ERASE * 4), "zeros"),
        ("7I77.BIN", b"\1" * ERASE + bytes(ERASE), "nothing behind"),
        ("7I77.BIN", bytes([1]) * ((1 << 20) + 1), "at most"),
    ],
)
def test_files_that_are_no_firmware_for_it_are_refused(card, tmp_path, name, data, said) -> None:
    (tmp_path / name).write_bytes(data)
    card.clear_writes()
    with pytest.raises(FirmwareRefused, match=said):
        plan(connect(card), read_firmware(tmp_path / name))
    assert card.write_count == 0


@pytest.mark.parametrize("sizes", [(17, 8), (7, 3), (10, 2), (8, 12)])
def test_sizes_that_cannot_be_are_refused(card: DescribedRemote, file: Path, sizes) -> None:
    erase, write = sizes

    class Odd(Recorder):
        def send(self, data: bytes) -> None:
            super().send(data)
            if data[:3] in (b"\x44\x04\x80", b"\x44\x05\x80"):
                from lbp import with_crc

                self._waiting = with_crc(bytes([erase if data[1] == 4 else write]))

    with pytest.raises(FirmwareRefused, match="cannot be"):
        plan(LbpRemote(WireLink(Odd(card))), read_firmware(file))


def test_a_remote_without_flash_is_refused(file: Path) -> None:
    from hostmot2.emulator import EmulatedRemote

    with pytest.raises(FirmwareRefused, match="no flash"):
        plan(connect(EmulatedRemote("7I77")), read_firmware(file))


def test_a_block_that_fails_is_done_again(card: DescribedRemote, file: Path) -> None:
    firmware = read_firmware(file)
    remote = connect(card)
    todo = plan(remote, firmware)

    def spoil(_done: int, _total: int) -> None:
        card.inject(skip=1)  # the next erase's or buffer's acknowledge is lost
        card.inject(bad_crc=1)

    update(remote, firmware, todo, progress=spoil)
    assert_updated(card, firmware.data)


def test_a_dead_remote_ends_the_update_at_a_named_block_and_it_goes_on_from_there(
    card: DescribedRemote, file: Path
) -> None:
    firmware = read_firmware(file)
    remote = connect(card)
    todo = plan(remote, firmware)

    def pull(done: int, _total: int) -> None:
        if done == 2:
            card.alive = False

    with pytest.raises(UpdateFailed) as failure:
        update(remote, firmware, todo, progress=pull)
    assert failure.value.block == todo.blocks[2]
    card.alive = True
    remote = connect(card)  # the boot loader answers
    update(remote, firmware, plan(remote, firmware), done=2)
    assert_updated(card, firmware.data)


def test_some_noise_does_no_harm(card: DescribedRemote, file: Path) -> None:
    stream = NoisyStream(card, 0.0005, 3)
    remote = LbpRemote(WireLink(stream))
    firmware = read_firmware(file)
    update(remote, firmware, plan(remote, firmware))
    assert stream.spoiled > 5
    assert_updated(card, firmware.data)


@pytest.fixture(autouse=True)
def own_state(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state-home"))


def flash_of(state: Path) -> bytes:
    from hostmot2.emulator.remote_state import RemoteState

    card = emulated("7i77-io")
    RemoteState(card, state, "7i77-io")
    return card.nonvolatile["flash"]


def test_killed_in_the_middle_then_recovered(hm2, file: Path, tmp_path: Path) -> None:
    state = tmp_path / "card"
    with on_pty("7i77-io", "--state", str(state)) as (process, port):
        command = [
            sys.executable,
            "-c",
            "from hostmot2.cli import main; main()",
            "uflbp",
            str(file),
            "-p",
            port,
        ]
        update_process = subprocess.Popen(
            command, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, stderr=subprocess.DEVNULL
        )
        kept = tmp_path / "state-home/hostmot2/uflbp-7I77-12000001.json"
        for _ in range(600):
            if kept.exists() and json.loads(kept.read_text())["done"] >= 2:
                break
            time.sleep(0.02)
        update_process.send_signal(signal.SIGKILL)
        update_process.wait()
        assert flash_of(state)[ERASE : 7 * ERASE] != image()[ERASE:].ljust(6 * ERASE, b"\0")
        assert tell(process, "power-cycle") == "ok"
        assert hm2("rpd", "SWRevision", "-p", port)[0] == 0  # LBP is alive
        status, out, err = hm2("uflbp", str(file), "--resume", "-p", port)
        assert (status, "written" in out) == (0, True)
        assert "done before" in err
        assert not kept.exists()
    flash, data = flash_of(state), image()
    for block in (1, 2, 4, 5, 6):
        wanted = data[block * ERASE : (block + 1) * ERASE].ljust(ERASE, b"\0")
        assert flash[block * ERASE : (block + 1) * ERASE] == wanted
    assert set(flash[:ERASE]) == {0xFF}


def test_dry_run_changes_nothing(hm2, file: Path) -> None:
    status, out, _ = hm2("--json", "uflbp", str(file), "--dry-run", "-p", "emu:7i77-io")
    facts = json.loads(out)
    assert (status, facts["blocks"], facts["written"]) == (0, [1, 2, 4, 5, 6], 0)
    assert hm2("uflbp", str(file), "-p", "emu:8i20")[0] == 6


def test_through_the_card(card: DescribedRemote, file: Path) -> None:
    """lbp_serial.md 7.1: pass-through at 115200 on both sides; the channel's rate is put back."""
    import hostmot2
    from hostmot2.lbp.card import open_channel, setup_rate

    emulated_board = EmulatedBoard("5i25+7i77", clock="virtual")
    emulated_board.sserial[0].attach(0, card)
    with hostmot2.open(emulated_board) as board:
        port = board.sserial[0]
        firmware = read_firmware(file)
        with setup_rate(port, 0), open_channel(port, 0) as remote:
            assert remote.name == "7I77"
            update(remote, firmware, plan(remote, firmware))
        assert port.channels[0].baud_rate == 2_500_000
    assert_updated(card, firmware.data)


def test_through_the_card_by_command(hm2, file: Path) -> None:
    status, _, err = hm2("--board", "emu://5i25+7i77?clock=virtual", "uflbp", str(file), "-c", "0.0")
    assert status != 0  # the emulated card's remote runs in operate mode: nothing answers at 115200
    assert err
