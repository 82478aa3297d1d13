"""The LBP client on remotes in this process: every size, local register, RPC, error bit; what it sends."""

from __future__ import annotations

from typing import Any

import pytest

from hostmot2 import lbp
from hostmot2.emulator import EmulatedRemote
from hostmot2.lbp import LbpRemote, WireLink, frame
from hostmot2.lbp.errors import LineSilent, NotLbp, RemoteRefused, WrongAnswer, status_names
from hostmot2.registers import LbpCapability, LbpLocal, LbpStatus
from hostmot2.remotes.errors import UnsupportedRemote
from wire.lines import Recorder, connect, emulated


@pytest.fixture
def emulator() -> EmulatedRemote:
    return EmulatedRemote(
        "7I77", 0x12345678, 9, 6, 0x0600, 0x0640, {0x200 + n: n for n in range(16)}, eeprom={2: 0x77}
    )


@pytest.fixture
def remote(emulator: EmulatedRemote) -> LbpRemote:
    return connect(emulator)


def test_nvmaxcurrent_is_written_with_the_published_frames() -> None:
    """lbp_serial.md 4: EC 01 66, 65 02 00 C4 09 D7, EC 00 38, each answered by 00."""
    drive = emulated("8i20")
    recorder = Recorder(drive)
    remote = LbpRemote(WireLink(recorder))
    recorder.frames.clear()
    lbp.parameters(remote)["NVMAXCURRENT"] = 2500
    wire = [pair for pair in recorder.frames if pair[0] != "C1 94"]
    written = wire.index(("65 02 00 C4 09 D7", "00"))
    assert ("EC 01 66", "00") in wire[:written]
    assert wire[written + 1] == ("EC 00 38", "00")
    assert ("45 02 00 95", "C4 09 13") in wire[written:]
    assert wire[-1] == ("EC 00 38", "00")


def test_session_start_finds_the_cookie_and_clears_the_status(emulator: EmulatedRemote) -> None:
    emulator.lbp_status = 0xF9
    recorder = Recorder(emulator)
    remote = LbpRemote(WireLink(recorder))
    assert ("DF 16", "5A A5") in recorder.frames
    assert ("E1 00 B1", "00") in recorder.frames
    assert remote.status == 0
    assert remote.name == "7I77"
    assert remote.unit_number == 0x12345678


def test_all_sizes_both_ways(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    for size in (1, 2, 4, 8):
        assert remote.read_bytes(0x200, size) == bytes(range(size))
        remote.write_remote(0x300, (1 << 8 * size) - 2, size)
        assert emulator.peek(0x300, 8)[:size] == b"\xfe" + b"\xff" * (size - 1)
        remote.write_remote(0x300, -2, size)
        assert remote.read_remote(0x300, size) == (1 << 8 * size) - 2


def test_pointer_and_increment(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    remote.pointer = 0x0200
    assert remote.read_next(4) == b"\0\1\2\3"
    assert remote.read_next(1) == b"\4"
    remote.advance_pointer(3)
    assert remote.pointer == 0x0208
    remote.write_next(b"\xaa\xbb")
    remote.write_next(b"\xcc")
    assert emulator.peek(0x0208, 3) == b"\xaa\xbb\xcc"
    assert remote.pointer == 0x020B


def test_a_pointer_move_is_not_done_twice_when_an_answer_is_lost(
    remote: LbpRemote, emulator: EmulatedRemote
) -> None:
    remote.pointer = 0x0200
    emulator.inject(skip=3)
    assert remote.read_next(2) == b"\0\1"
    assert remote.pointer == 0x0202


def test_memory_spaces_are_left_at_ram(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    assert remote.read_remote(2, space=1) == 0x77
    remote.write_remote(2, 0x78, space=1)
    assert emulator.peek(2, space=1) == b"\x78"
    assert remote.read_local(LbpLocal.memory_space) == 0
    with pytest.raises(RemoteRefused):
        remote.read_remote(0, space=2)  # no flash
    assert remote.read_local(LbpLocal.memory_space) == 0
    assert remote.read_remote(0x201) == 1


def test_local_registers(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    assert remote.capability == LbpCapability.CRC_CHECK
    remote.software_mode = 2
    assert (remote.software_mode, emulator.software_mode) == (2, 2)
    emulator.revision, emulator.fault = 14, 0x08
    assert (remote.software_revision, remote.fault) == (14, 0x08)
    emulator.clear_flag_busy_reads = 5
    remote.clear_faults()
    assert emulator.fault == 0
    assert (remote.rpc_pitch, remote.rpc_size) == (8, 512)
    found = remote.discovery()
    assert (found.receive_size, found.transmit_size, found.ptoc, found.gtoc) == (9, 6, 0x0600, 0x0640)
    remote.write_local(0x00, 0x42)
    assert remote.read_local(0x00) == 0x42
    assert remote.lbp_version == 3


def test_reset_forgets_what_is_not_stored(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    remote.write_remote(0x300, 7)
    remote.reset_processor()
    assert remote.read_remote(0x300) == 0
    assert remote.status == 0


def test_the_manuals_stored_rpc(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    """8I20 manual: RPC 5 writes two bytes from the stream to 0x10 and reads two from 0x12."""
    steps = [frame.rpc_write(0x10, 2), frame.rpc_read(0x12, 2)]
    remote.write_bytes(0x12, b"\x34\x12")
    remote.store_rpc(5, steps)
    with remote.rpc_table():
        assert remote.read_bytes(0x28, 8) == frame.rpc_list(steps) + b"\0"
    assert remote.run_rpc(5, b"\x55\xcc", 2) == b"\x34\x12"
    assert emulator.peek(0x10, 2) == b"\x55\xcc"


def test_an_rpc_runs_once_or_not_at_all(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    remote.store_rpc(0, [frame.rpc_write(0x10, 1)])
    emulator.clear_writes()
    emulator.inject(skip=1)
    with pytest.raises(LineSilent):
        remote.run_rpc(0, b"\x01")
    assert emulator.write_count == 1
    with pytest.raises(RemoteRefused, match="invalid address"):
        remote.run_rpc(7)  # nothing stored
    with pytest.raises(ValueError, match="runs over"):
        remote.store_rpc(63, [frame.rpc_read(0, 1)] * 4)


def test_process_data(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    emulator.inputs = bytes(range(8))
    assert remote.process_data(b"abcdef", 9) == b"\0" + bytes(range(8))
    assert emulator.outputs == b"abcdef"


def test_a_refusal_is_told_from_silence(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    with pytest.raises(RemoteRefused, match="invalid address or write") as refusal:
        remote.write_remote(0xFFFF - 3, 0, space=7)
    assert refusal.value.status == LbpStatus.INVALID_ADDRESS
    emulator.alive = False
    with pytest.raises(LineSilent) as silence:
        remote.read_remote(0x200)
    assert "tried 8 times" in silence.value.__notes__[-1]


@pytest.mark.parametrize(
    "fault", [{"bad_crc": 1}, {"truncate": 1}, {"extra": 1}, {"framing_break": 1}, {"skip": 1}, {"skip": 3}]
)
def test_spoiled_answers_are_asked_for_again(
    remote: LbpRemote, emulator: EmulatedRemote, fault: dict[str, int]
) -> None:
    emulator.inject(**fault)
    assert remote.read_remote(0x201) == 1
    assert remote.link.counters.errors >= 1
    emulator.inject(**fault)
    remote.write_remote(0x310, 0x5A)
    assert emulator.peek(0x310) == b"\x5a"


def test_without_crc_the_remote_is_found_and_used() -> None:
    """lbp_serial.md 2: DF 16 first, then bare DF."""
    drive = emulated("8i20")
    drive.crc = False
    remote = connect(drive)
    assert not remote.link.crc
    values = lbp.parameters(remote)
    assert values["BUSV"] == 32000
    values["NVMAXCURRENT"] = 2500
    assert drive.get_raw("NVMAXCURRENT") == 2500


def test_something_else_on_the_line_is_no_remote(emulator: EmulatedRemote) -> None:
    emulator.cookie = 0x55
    with pytest.raises(NotLbp) as failure:
        connect(emulator)
    assert failure.value.received == 0x55
    emulator.alive = False
    with pytest.raises(LineSilent, match="nothing answers at 115200 baud"):
        connect(emulator)


def test_bytes_that_nobody_asked_for_are_no_answer(emulator: EmulatedRemote) -> None:
    line = Recorder(emulator)
    link = WireLink(line)
    link.open()
    line._waiting += bytes(2)
    with pytest.raises(WrongAnswer, match="2 bytes came that nobody asked for"):
        link.transact(frame.read(0x200, 2))
    assert link.counters.stale == 1


def test_a_value_that_changes_all_the_time_passes_on_a_good_line_only(emulator: EmulatedRemote) -> None:
    class Changing(Recorder):
        def send(self, data: bytes) -> None:
            emulator.poke(0x200, bytes([emulator.peek(0x200)[0] + 1 & 0xFF]))
            super().send(data)

    remote = LbpRemote(WireLink(Changing(emulator)))
    assert 0 < remote.read_remote(0x200) < 0x80
    emulator.inject(bad_crc=1)
    with pytest.raises(WrongAnswer, match="agree"):
        remote.read_remote(0x200)


def test_status_bits_are_named() -> None:
    assert status_names(0) == "clean"
    assert status_names(0xFB) == (
        "CRC error, watchdog has bitten, buffer overflow, invalid address or write, "
        "command cut short by a pause, FIFO time-out, reserved bits 0x02"
    )


def test_the_line_is_left_as_it_was_found() -> None:
    drive = emulated("8i20")
    with connect(drive) as remote:
        remote.write_local(LbpLocal.memory_space, 1)
    assert drive.exchange(bytes.fromhex("cc f4"))[:1] in (b"\x00", b"")


@pytest.mark.parametrize("kind", ["7i77-io", "7i77-analog", "8i20"])
def test_parameters_by_name_are_the_same_as_from_inside(kind: str) -> None:
    card = emulated(kind)
    values = lbp.parameters(connect(card))
    assert len(values) >= 8
    for name in values:
        if card.field(name).bits in (8, 16, 32):
            raw = values.parameter(name).encode_unchecked(values[name])
            assert raw == card.get_raw(name), name


def test_a_7i64_has_no_parameters_but_is_known() -> None:
    remote = connect(emulated("7i64"))
    assert lbp.describe(remote).name == "7I64"
    assert list(lbp.parameters(remote)) == []


def test_a_remote_without_tables_and_without_a_known_name(emulator: EmulatedRemote) -> None:
    emulator.ptoc = 0
    with pytest.raises(UnsupportedRemote, match="not known by its name"):
        lbp.describe(connect(emulator))


def test_another_software_mode_is_described_when_it_is_asked_for() -> None:
    remote = connect(emulated("7i77-io"))
    names = {mode: {field.name for field in lbp.describe(remote, mode).fields} for mode in (0, 1)}
    assert names[0] < names[1]
    assert lbp.describe(remote).software_mode == 1, "it stays selected"


def test_the_watchdog_time_has_two_names() -> None:
    """7I77 manual: NVWATCHDOGTIME in the table, NVWATCHDOGTIMEOUT in the text."""
    card = emulated("7i77-io")
    values = lbp.parameters(connect(card))
    values["NVWATCHDOGTIME"] = 100
    assert card.get_raw("NVWatchDogTimeout") == 100
    assert values["nvwatchdogtimeout"] == 100


def test_process_data_with_a_surplus_byte_is_no_answer(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    emulator.inject(extra=1)
    with pytest.raises(WrongAnswer, match="more than"):
        remote.process_data(b"abcdef", 9)


class Cut(Recorder):
    """Loses the last byte of the next answer."""

    cut = False

    def send(self, data: bytes) -> None:
        super().send(data)
        if self.cut:
            self._waiting, self.cut = self._waiting[:-1], False


@pytest.mark.parametrize("crc", [True, False])
def test_a_short_answer_is_none(crc: bool) -> None:
    """Without a CRC its length is all that tells."""
    drive = emulated("8i20")
    drive.crc = crc
    line = Cut(drive)
    link = WireLink(line)
    link.open()
    assert link.crc is crc
    line.cut = True
    with pytest.raises(WrongAnswer, match=r"of [23] bytes"):
        link.transact(frame.read(0x0874, 2))
    assert link.counters.short == 1
    assert len(link.transact(frame.read(0x0874, 2))) == 2


@pytest.mark.parametrize(
    "attempt",
    [
        lambda remote: remote.write_remote(0x300, 256),
        lambda remote: remote.write_remote(0x300, -129),
        lambda remote: remote.write_local(0x00, 256),
        lambda remote: remote.write_local(0x00, -1),
        lambda remote: setattr(remote, "pointer", 0x10000),
    ],
)
def test_what_does_not_fit_is_refused_and_not_sent(emulator: EmulatedRemote, attempt: Any) -> None:
    recorder = Recorder(emulator)
    remote = LbpRemote(WireLink(recorder))
    recorder.frames.clear()
    with pytest.raises(ValueError, match=r"fit|outside"):
        attempt(remote)
    assert recorder.frames == []


def test_faults_that_are_never_cleared_are_no_success(remote: LbpRemote, emulator: EmulatedRemote) -> None:
    emulator.clear_flag_busy_reads = 1_000_000
    with pytest.raises(WrongAnswer, match="stays set"):
        remote.clear_faults()


def test_the_status_can_be_cleared_and_the_counted_errors_read(
    remote: LbpRemote, emulator: EmulatedRemote
) -> None:
    emulator.lbp_status = LbpStatus.WATCHDOG
    assert remote.status == LbpStatus.WATCHDOG
    remote.clear_status()
    assert emulator.lbp_status == 0
    before = remote.crc_errors
    emulator.exchange(bytes.fromhex("DF 17"))
    assert remote.crc_errors > before


def test_an_rpc_that_reads_back_differently_is_told(remote: LbpRemote, monkeypatch) -> None:
    monkeypatch.setattr(remote, "write_bytes", lambda *_arguments, **_space: None)
    with pytest.raises(WrongAnswer, match="RPC 5 was written as"):
        remote.store_rpc(5, [frame.rpc_write(0x10, 2)])
    assert remote.read_local(LbpLocal.rpc_memory_access) == 0, "the table is closed again"


def test_what_must_be_done_once_is_not_done_in_another_memory_space(
    remote: LbpRemote, emulator: EmulatedRemote
) -> None:
    before = len(emulator.writes)
    with pytest.raises(WrongAnswer, match="not in memory space 2"):
        remote.commit(0x10, 0x01, space=2)
    assert len(emulator.writes) == before
