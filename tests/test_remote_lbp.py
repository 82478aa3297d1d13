"""An emulated remote obeys LBP as sserial.md 4 and the recordings of the real firmware say."""

import pytest
from lbp import ask, clear_faults, crc8, read, with_crc, write
from test_remote_wire import BIT_PS, Line

from hostmot2._core import ffi, lib
from hostmot2.emulator import EmulatedRemote, RemoteWrite

VECTORS = """
DF 16 | 5A A5 | C1 94 | EB 28 B7 | E1 00 B1 | BC 91 | BB 12 | C7 49 | D7 D4 | 4C 86 30 B1
45 34 12 33 | EC 01 66 | EC 00 38 | BD 99 61 66 30 13 33 F3 7F 00 60 62 | BD CF | BD 00 00 AC | BD C3 A5 DD
BD 00 00 00 00 A3 | BD 00 00 00 00 00 00 00 00 00 00 05 | D0 57 | D1 09 | D2 EB | D3 B5
E6 00 DF | E6 01 81 | E6 03 3D | E7 FF 2E
4C 85 30 E4 | 4C 8C 30 56 | 65 00 10 EF BE C9 | 00 E6 95 03 00 08 | 00 E7 95 03 00 87 | 00 E8 95 03 00 1D
EE 0A 00 12 17 | BD FF 0F 00 02 80 FF 03 80 FF C7 A5 | EC 02 84 | 44 05 80 DC | 44 04 80 18 | DA 29
66 00 80 00 04 00 00 F3 | 64 07 80 FE A0 | 65 02 00 C4 09 D7 | 45 02 00 95 | 45 74 08 4B
31 32 33 34 35 36 37 38 39 A1
"""


@pytest.mark.parametrize("frame", [bytes.fromhex(v) for line in VECTORS.split("\n") for v in line.split("|")])
def test_published_frames_end_in_their_crc(frame: bytes) -> None:
    assert crc8(frame) == 0


@pytest.fixture
def remote() -> EmulatedRemote:
    memory = {0x0200 + n: n for n in range(16)}
    return EmulatedRemote("7I77", 0x12345678, 9, 6, 0x0600, 0x0640, memory)


def test_the_start_sequence_of_a_generic_remote_byte_for_byte(remote: EmulatedRemote) -> None:
    remote.inputs = bytes(range(0x11, 0x99, 0x11))
    for frame, answer in (
        ("df 16", "5a a5"),
        ("eb 28 b7", "00"),
        ("e1 00 b1", "00"),
        ("c1 94", "00 00"),
        ("bc 91", "78 56 34 12 29"),
        ("d0 57", "37 3d"),
        ("d1 09", "49 da"),
        ("d2 eb", "37 3d"),
        ("d3 b5", "37 3d"),
        ("e6 00 df", "00"),
        ("bb 12", "09 06 00 06 40 06 9d"),
        ("bd 00 00 00 00 00 00 bb", "00 11 22 33 44 55 66 77 88 7b"),
        ("e7 ff 2e", "00"),
        ("c7 49", "00 00"),
        ("d7 d4", "00 00"),
    ):
        assert remote.exchange(bytes.fromhex(frame)).hex(" ") == answer


def test_reads_and_writes_of_every_size_and_the_pointer(remote: EmulatedRemote) -> None:
    assert [read(remote, 0x0200, size) for size in (1, 2, 4, 8)] == [
        bytes(range(size)) for size in (1, 2, 4, 8)
    ]
    assert write(remote, 0x0208, b"\xaa\xbb\xcc\xdd") == b""
    assert ask(remote, 0x4E, b"\x08\x02") == b"\xaa\xbb\xcc\xdd"  # long with increment
    assert ask(remote, 0x40) == b"\x0c"  # byte at the pointer, which stays
    assert ask(remote, 0x48) == b"\x0c"  # and moves
    assert ask(remote, 0xD8, 0xD9) == b"\x0d\x02"
    assert ask(remote, 0xF8, 0x00) == b""
    assert ask(remote, 0xFA, 0x09) == b""
    assert ask(remote, 0x41) == b"\xbb\xcc"
    assert remote.writes == [RemoteWrite(0x0208, b"\xaa\xbb\xcc\xdd", 0, 0.0)]


def test_the_manuals_write_and_read_back_example(remote: EmulatedRemote) -> None:
    assert ask(remote, 0x6E, b"\x10\x00\xaa\xbb\xcc\xdd") == b""
    assert ask(remote, 0x61, b"\xee\xff") == b""
    assert ask(remote, 0x47, b"\x10\x00") == b"\xaa\xbb\xcc\xdd\xee\xff\0\0"


def test_the_manuals_stored_rpc(remote: EmulatedRemote) -> None:
    table = bytes([0x65, 0x10, 0x00, 0x45, 0x12, 0x00, 0x00])
    assert ask(remote, 0x85) is None  # nothing stored yet
    assert ask(remote, 0xEA, 0x01) == b""
    for offset, byte in enumerate(table):
        assert write(remote, 0x28 + offset, bytes([byte])) == b""
    assert read(remote, 0x28, 4) == table[:4]
    assert ask(remote, 0xEA, 0x00) == b""
    assert write(remote, 0x12, b"\x34\x12") == b""
    assert ask(remote, 0x85, 0x55, 0xCC) == b"\x34\x12"
    assert remote.peek(0x10, 2) == b"\x55\xcc"
    assert ask(remote, 0xDC, 0xDD, 0xDE) == b"\x08\x00\x02"


def test_a_stored_rpc_may_carry_its_own_data(remote: EmulatedRemote) -> None:
    assert ask(remote, 0xEA, 0x01) == b""
    assert write(remote, 0x00, bytes([0x75, 0x20, 0x00, 0xEE])) == b""  # write word, data from the table
    assert write(remote, 0x04, bytes([0xFF, 0x00])) == b""
    assert ask(remote, 0xEA, 0x00) == b""
    assert ask(remote, 0x80) == b""
    assert remote.peek(0x20, 2) == b"\xee\xff"


def test_several_commands_in_one_frame_are_answered_together(remote: EmulatedRemote) -> None:
    assert ask(remote, 0xD0, 0xD1, 0xE1, 0x00, 0x45, b"\x02\x02") == b"7I\x02\x03"


@pytest.mark.parametrize(
    ("frame", "status"),
    [
        (bytes.fromhex("df 17"), 0x01),  # wrong CRC
        (with_crc(b"\x00"), 0x20),  # no command
        (with_crc(b"\x45\xff\xff"), 0x20),  # a word across the end of memory
        (with_crc(b"\x64\x00"), 0x20),  # a write that stops in its address
        (with_crc(b"\x81"), 0x20),  # an RPC that is not stored
        (with_crc(b"\xdf\x12"), 0x20),  # a good command, then none
    ],
)
def test_what_cannot_be_obeyed_is_met_with_silence_and_a_status_bit(
    remote: EmulatedRemote, frame: bytes, status: int
) -> None:
    assert remote.exchange(frame) == b""
    assert remote.lbp_status == status
    assert ask(remote, 0xC1) == bytes([status])
    assert ask(remote, 0xE1, 0) == b""
    assert ask(remote, 0xC1) == b"\0"


def test_memory_spaces(remote: EmulatedRemote) -> None:
    remote.poke(0x0402, b"\xee\x02")
    assert ask(remote, 0xEC, 1) == b""
    assert read(remote, 0x0002, 2) == b"\xee\x02"  # the recorded stand-ins' second space
    assert write(remote, 0x0002, b"\x01") == b""
    assert ask(remote, 0xCC) == b"\x01"
    assert ask(remote, 0xEC, 0) == b""
    assert remote.peek(0x0402, 2) == b"\x01\x02"
    assert remote.writes[-1] == RemoteWrite(0x0002, b"\x01", 1, 0.0)
    with_eeprom = EmulatedRemote(eeprom={2: 0x77})
    assert ask(with_eeprom, 0xEC, 1) == b""
    assert read(with_eeprom, 2) == b"\x77"


def test_injected_errors_come_once_and_in_the_next_answer(remote: EmulatedRemote) -> None:
    good = remote.exchange(b"\xdf\x16")
    remote.inject(bad_crc=1)
    assert remote.exchange(b"\xdf\x16") == bytes([good[0], good[1] ^ 0xFF])
    remote.inject(truncate=1)
    assert remote.exchange(b"\xdf\x16") == good[:1]
    remote.inject(extra=2)
    assert remote.exchange(b"\xdf\x16") == good + b"\xe0\xe1"
    remote.inject(skip=2)
    assert [remote.exchange(b"\xdf\x16") for _ in range(3)] == [b"", b"", good]
    remote.inject(framing_break=1)
    line = Line(remote)
    line.send_frame(0, b"\xdf\x16")
    assert [(value, broken) for _, value, broken in line.heard()] == [(0x5A, 0), (0xA5, 1)]


def test_knobs_of_a_sick_remote(remote: EmulatedRemote) -> None:
    remote.cookie = 0x11
    assert ask(remote, 0xDF) == b"\x11"
    remote.bad_cookies = 1
    assert [ask(remote, 0xDF) for _ in range(2)] == [b"\x55", b"\x11"]
    remote.answers_unit_number = False
    assert ask(remote, 0xBC) is None
    remote.answers_discovery = False
    assert ask(remote, 0xBB) is None
    remote.fault = 0x08
    clear_faults(remote)
    assert ask(remote, 0xD7) == b"\0"
    remote.fault, remote.fault_clears = 0x02, False
    remote.clear_flag_busy_reads = 2
    assert ask(remote, 0xE7, 0xFF) == b""
    assert [ask(remote, 0xC7) for _ in range(3)] == [b"\xff", b"\xff", b"\0"]
    assert ask(remote, 0xD7) == b"\x02"
    remote.alive = False
    assert ask(remote, 0xDF) is None


def test_without_crc_nothing_is_appended_and_nothing_acknowledged(remote: EmulatedRemote) -> None:
    remote.crc = False
    assert remote.exchange(b"\xdf") == b"\x5a"
    assert remote.exchange(b"\xe1\x00") == b""
    line = Line(remote)
    line.send_frame(0, bytes.fromhex("eb 28 e1 00 c1 e6 07 bb"), pitch_ps=4_000_000)
    assert bytes(value for _, value, _ in line.heard()).hex(" ") == "00 09 06 00 06 40 06"
    assert remote.software_mode == 7


def test_an_answer_starts_one_turnaround_after_the_middle_of_the_stop_bit(remote: EmulatedRemote) -> None:
    remote.turnaround_us = 36.0
    line = Line(remote)
    middle = line.send_frame(1_000_000, b"\xdf\x16")
    assert [start - middle for start, _, _ in line.heard()] == [36_000_000, 40_000_000]


def test_a_gap_ends_a_frame_and_a_shorter_pause_does_not(remote: EmulatedRemote) -> None:
    line = Line(remote)
    for pause_bits, answered in ((39, True), (40, True), (41, False)):
        start = 10**9 * (pause_bits + 1)
        line.send(start, 0xDF)
        line.send(start + (10 + pause_bits) * BIT_PS, 0x16)
        assert bool(line.heard()) is answered
        line.send_frame(start + 10**8, b"\xdf\x16")
        assert len(line.heard()) == 2
    assert remote.lbp_status & 0x01


@pytest.mark.parametrize("noise", [b"\xdf\x17", b"\x00", b"\x47\x00", b"\xbd", b"\xeb\x28\xb8", bytes(400)])
def test_after_noise_and_a_gap_the_next_frame_is_heard(remote: EmulatedRemote, noise: bytes) -> None:
    line = Line(remote)
    end = line.send_frame(0, noise)
    assert line.heard() == []
    line.send_frame(end + 20_000_000, b"\xdf\x16")
    assert [value for _, value, _ in line.heard()] == [0x5A, 0xA5]


def test_a_broken_byte_spoils_its_frame_only(remote: EmulatedRemote) -> None:
    line = Line(remote)
    line.send(0, 0xDF, framing_error=1)
    line.send(4_000_000, 0x16)
    assert line.heard() == []
    line.send_frame(10**9, b"\xdf\x16")
    assert len(line.heard()) == 2


def test_a_master_at_another_baud_rate_is_not_heard(remote: EmulatedRemote) -> None:
    remote.baud = 115200
    line = Line(remote)
    line.send_frame(0, b"\xdf\x16")
    assert line.heard() == []
    byte = ffi.new("hm2_line_byte *")
    for index, value in enumerate(b"\xdf\x16"):  # the firmware's nearest rate, 115108
        byte[0] = {"start_ps": 10**10 + index * 87_000_000, "bit_ps": 8_687_500, "value": value}
        lib.hm2_remote_line_receive(remote.handle, byte)
    assert [value for _, value, _ in line.heard()] == [0x5A, 0xA5]


def test_reset_parser_starts_the_frame_anew(remote: EmulatedRemote) -> None:
    line = Line(remote)
    line.send_frame(0, b"\xff\xdf\x16")
    assert [value for _, value, _ in line.heard()] == [0x5A, 0xA5]
    assert ask(remote, 0xFF) == b""


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("receive_size", 0),
        ("receive_size", 256),
        ("unit_number", 1 << 32),
        ("turnaround_us", -1.0),
        ("baud", 0),
    ],
)
def test_settings_outside_their_range_are_refused(
    remote: EmulatedRemote, attribute: str, value: float
) -> None:
    with pytest.raises(ValueError, match="range"):
        setattr(remote, attribute, value)


def test_names_and_models_are_checked() -> None:
    with pytest.raises(ValueError, match="four"):
        EmulatedRemote("7I77D")
    with pytest.raises(ValueError, match="model"):
        EmulatedRemote(model="8i21")


def test_7i64_stand_in_clears_its_watchdog_bit_when_told() -> None:
    remote = EmulatedRemote("7I64", model="7i64")
    remote.inputs = bytes([1, 2, 3, 0x0F, 5, 6, 7, 8])
    assert ask(remote, 0xBD, bytes(4)) == bytes([1, 2, 3, 0x0F, 5, 6, 7, 8])
    assert ask(remote, 0xBD, bytes([0, 0, 0, 8])) == bytes([1, 2, 3, 0x07, 5, 6, 7, 8])
    assert ask(remote, 0xBB) is None


def test_8i20_stand_in_follows_its_start_sequence() -> None:
    remote = EmulatedRemote("8I20", model="8i20")
    remote.clear_flag_busy_reads, remote.pid_off_reads, remote.fault_word = 1, 1, 0x0104
    assert read(remote, 0x0852, 2) == b"\x04\x01"
    assert write(remote, 0x0854, b"\xff\xff") == b""
    assert [read(remote, 0x0854, 2) for _ in range(2)] == [b"\xff\xff", b"\0\0"]
    assert read(remote, 0x0852, 2) == b"\0\0"
    assert write(remote, 0x0804, b"\xff\xff") == b""
    assert [read(remote, 0x08FE, 2) for _ in range(2)] == [b"\0\0", b"\xff\xff"]
    remote.fault_word_on_enable = 0x0002
    assert write(remote, 0x0804, b"\xff\xff") == b""
    assert read(remote, 0x0852, 2) == b"\x02\0"
