"""A remote that says something is wrong, or answers what cannot be: an error that names it, never a value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from lbp import with_crc

from hostmot2 import lbp
from hostmot2.emulator import DescribedRemote, EmulatedRemote
from hostmot2.lbp import FirmwareRefused, LbpRemote, UpdateFailed, WireLink, frame
from hostmot2.lbp.errors import NotLbp, RemoteRefused, WrongAnswer
from hostmot2.lbp.firmware import COMMIT_ERASE, plan, read_firmware, update
from hostmot2.registers import LbpLocal, LbpStatus
from wire.lines import Recorder, connect, emulated

FLASH = 2


class Changed(Recorder):
    """Calls `change(sent, answer)` for each frame; what that returns is heard instead of the answer."""

    change: Callable[[bytes, bytes], bytes] | None = None

    def send(self, data: bytes) -> None:
        super().send(data)
        if self.change is not None:
            self._waiting = self.change(data, self._waiting)


@pytest.fixture
def emulator() -> EmulatedRemote:
    return EmulatedRemote("7I77", 7, 9, 6, 0x0600, 0x0640, {0x200 + n: n for n in range(16)})


@pytest.fixture
def line(emulator: EmulatedRemote) -> Changed:
    return Changed(emulator)


@pytest.fixture
def remote(line: Changed) -> LbpRemote:
    return LbpRemote(WireLink(line))


def test_another_cookie_is_no_remote_and_the_next_access_starts_anew(
    line: Changed, remote: LbpRemote
) -> None:
    cookie = frame.COOKIE.data
    line.change = lambda sent, heard: with_crc(b"\x5b") if sent.startswith(cookie) else heard
    with pytest.raises(NotLbp, match="5B") as caught:
        remote.sync()
    assert (caught.value.expected, caught.value.received) == (0x5A, 0x5B)
    line.change = None
    line.frames.clear()
    assert remote.read_bytes(0x204, 2) == b"\x04\x05"
    assert ("E1 00 B1", "00") in line.frames, "its status was cleared first"


def test_a_commit_that_was_misheard_is_refused_and_not_repeated(
    emulator: EmulatedRemote, line: Changed, remote: LbpRemote
) -> None:
    commit = frame.write(0x300, b"\x01").data

    def mishear(sent: bytes, heard: bytes) -> bytes:
        if sent.startswith(commit):
            emulator.lbp_status = LbpStatus.BUFFER
        return heard

    line.change = mishear
    remote.read_bytes(0x200, 1)
    with pytest.raises(RemoteRefused) as caught:
        remote.commit(0x300, 1, space=0)
    assert caught.value.status == LbpStatus.BUFFER
    assert sum(sent.startswith(commit.hex(" ").upper()) for sent, _ in line.frames) == 1


def test_an_rpc_that_was_misheard_is_refused_and_not_repeated(
    emulator: EmulatedRemote, line: Changed, remote: LbpRemote
) -> None:
    run = frame.rpc(5).data
    remote.store_rpc(5, [frame.rpc_read(0x200, 1)])

    def mishear(sent: bytes, heard: bytes) -> bytes:
        if sent.startswith(run):
            emulator.lbp_status = LbpStatus.INVALID_ADDRESS
        return heard

    line.change = mishear
    line.frames.clear()
    with pytest.raises(RemoteRefused) as caught:
        remote.run_rpc(5, reply=1)
    assert caught.value.status == LbpStatus.INVALID_ADDRESS
    assert sum(sent.startswith(run.hex(" ").upper()) for sent, _ in line.frames) == 1


def test_process_data_after_a_failure_begins_with_a_clean_line(
    emulator: EmulatedRemote, line: Changed, remote: LbpRemote
) -> None:
    emulator.inject(bad_crc=1)
    with pytest.raises(WrongAnswer, match="its CRC is wrong"):
        remote.process_data(b"abcdef", 9)
    line.frames.clear()
    emulator.inputs = b"12345678"
    assert remote.process_data(b"ABCDEF", 9) == b"\x0012345678"
    sent = [each for each, _ in line.frames]
    assert sent.index("E1 00 B1") < len(sent) - 1, "its status was cleared first"
    assert emulator.outputs == b"ABCDEF"


def test_a_pointer_that_does_not_stand_behind_what_was_read_is_no_value(
    line: Changed, remote: LbpRemote
) -> None:
    remote.pointer = 0x0200
    low = frame.read_local(LbpLocal.address_low.number).data
    line.change = lambda sent, heard: with_crc(b"\x77") if sent.startswith(low) else heard
    with pytest.raises(WrongAnswer, match="pointer stands at 0x0277"):
        remote.read_next(2)


def test_a_status_that_cannot_be_cleared_is_no_working_remote(line: Changed) -> None:
    status = frame.read_local(LbpLocal.status.number).data
    line.change = lambda sent, heard: with_crc(b"\x80") if sent.startswith(status) else heard
    with pytest.raises(WrongAnswer, match="status cannot be cleared"):
        LbpRemote(WireLink(line))


def test_tables_are_read_where_the_rest_of_a_block_is_not_readable() -> None:
    """Blocks of 8 bytes save commands; readable memory may end amid one."""
    recorder = Recorder(emulated("7i90"))
    whole = lbp.describe(LbpRemote(WireLink(recorder)))
    blocks = [sent for sent, _ in recorder.frames if sent.startswith("47 ")]  # 8 bytes at an address
    last = bytes.fromhex(max(blocks, key=lambda sent: bytes.fromhex(sent)[2:0:-1]))
    found = lbp.describe(LbpRemote(WireLink(refusing(emulated("7i90"), last))))
    assert found == whole


def refusing(card: DescribedRemote, begins: bytes) -> Changed:
    """A line on which commands that begin so are answered by silence and a refusal."""
    line = Changed(card)

    def refuse(sent: bytes, heard: bytes) -> bytes:
        if sent.startswith(begins):
            card.lbp_status = LbpStatus.INVALID_ADDRESS
            return b""
        return heard

    line.change = refuse
    return line


@pytest.fixture
def card() -> DescribedRemote:
    return emulated("7i77-io")


@pytest.fixture
def firmware(tmp_path):
    path = tmp_path / "7I77.BIN"
    path.write_bytes(b"\1" * 0x900)
    return read_firmware(path)


def test_no_update_of_a_remote_whose_status_is_not_clean(card: DescribedRemote, firmware) -> None:
    remote = connect(card)
    card.clear_writes()
    card.lbp_status = 0x04  # nobody knows what that means
    with pytest.raises(FirmwareRefused, match="status not clean: ") as caught:
        plan(remote, firmware)
    assert caught.value.received == 0x04
    assert card.write_count == 0


def test_a_remote_that_does_not_open_its_flash_is_refused(card: DescribedRemote, firmware) -> None:
    remote = LbpRemote(WireLink(refusing(card, b"\x44\x05\x80")))
    with pytest.raises(FirmwareRefused, match="does not open its flash"):
        plan(remote, firmware)
    assert card.write_count == 0


def test_an_older_remote_that_does_not_tell_its_capabilities_can_be_updated(
    card: DescribedRemote, firmware
) -> None:
    line = refusing(card, frame.read_local(LbpLocal.capability.number).data)
    todo = plan(LbpRemote(WireLink(line)), firmware)
    assert todo.blocks == (1, 2)
    assert todo.size == 2 * todo.erase_size


def test_a_line_names_itself() -> None:
    link = WireLink(Recorder(emulated("8i20")))
    assert str(link) == link.url == str(link.stream)


def test_block_0_is_never_written_even_if_a_plan_says_so(card: DescribedRemote, firmware) -> None:
    card.poke(0, b"boot", space=FLASH)
    with connect(card) as remote:
        todo = replace(plan(remote, firmware), blocks=(0, 1))
        card.clear_writes()
        with pytest.raises(ValueError, match="block 0 holds the boot loader"):
            update(remote, firmware, todo)
    assert card.write_count == 0
    assert card.peek(0, 4, space=FLASH) == b"boot"


def test_a_line_too_noisy_for_flash_ends_at_a_named_block(card: DescribedRemote, firmware) -> None:
    """Who cannot be sure that the buffer is whole does not burn it."""
    line = Changed(card)
    remote = LbpRemote(WireLink(line))
    todo = plan(remote, firmware)
    offset, writes, seen = b"\x66\x00\x80", [], []

    def spoil(sent: bytes, heard: bytes) -> bytes:
        if sent.startswith(b"\x64\x07\x80"):
            writes.append(sent[3])
        if not sent.startswith(offset):
            return heard
        seen.append(sent)
        return b"\xff\xff" if len(seen) % 2 else heard  # each is acknowledged at the second try

    line.change = spoil
    with pytest.raises(UpdateFailed, match=r"block 1 was not written: .*too much noise") as failure:
        update(remote, firmware, todo)
    assert failure.value.block == 1
    assert set(writes) == {COMMIT_ERASE}
