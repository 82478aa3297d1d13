"""Remote memory, parameters and the firmware's variables, through a port on the emulated card."""

import pytest

import hostmot2
from hostmot2 import lbp
from hostmot2.lbp.card import open_channel
from hostmot2.sserial import (
    BrokenTable,
    NoRemote,
    PortRunning,
    RemoteSilent,
    VerifyFailed,
)

from .remotes import field_io
from .tables import IN, UNSIGNED, element

SPACE_REGISTER = 0xEC
"""LBP command that writes the memory space."""


def test_a_broken_parameter_table_costs_the_parameters_only(card, hm2):
    card.sserial[0].attach(0, field_io(parameters=[element("x", UNSIGNED, 12, IN, 0, 1, address=0x333)]))
    assert hm2.sserial.start(0x01).failed == 0
    assert hm2.sserial.doit(0x01).failed == 0
    hm2.sserial.stop()
    with pytest.raises(BrokenTable, match="GTOC"):
        _ = hm2.sserial.channels[0].parameters


def test_parameters_by_name(hm2, field):
    field.poke(0x310, (0xA4C0).to_bytes(2, "little"))
    field.poke(0x324, b"\xff")
    parameters = hm2.sserial.channels[0].parameters
    assert list(parameters) == ["fieldvoltage", "NVWatchDogTimeout", "gain", "trim"]
    assert parameters["fieldvoltage"] == 0xA4C0
    assert parameters.parameter("fieldvoltage").scaled == pytest.approx(23.3614, abs=1e-4)
    assert parameters["nvwatchdogtimeout"] == 50
    assert parameters["trim"] == -1
    parameters["gain"] = 0.5
    assert parameters["gain"] == 0.5
    assert field.peek(0x320, 4) == b"\0\0\0\x3f"
    parameters["NVWatchDogTimeout"] = 100
    assert field.peek(0x20, 2, space=1) == b"\x64\0"
    with pytest.raises(KeyError, match="nothing"):
        _ = parameters["nothing"]
    with pytest.raises(ValueError, match="1001"):
        parameters["NVWatchDogTimeout"] = 1001
    with pytest.raises(ValueError, match="128"):
        parameters["trim"] = 128
    with pytest.raises(TypeError):
        parameters["trim"] = 0.5


def test_an_eeprom_cell_is_not_rewritten_with_what_it_holds(hm2, field):
    parameters = hm2.sserial.channels[0].parameters
    before = len(field.writes)
    parameters["NVWatchDogTimeout"] = 50
    assert len(field.writes) == before
    parameters["NVWatchDogTimeout"] = 51
    assert len(field.writes) == before + 1


def test_the_memory_space_is_ram_again_after_each_access(hm2, field):
    channel = hm2.sserial.channels[0]
    field.poke(0x20, b"\x11")
    assert channel.read_remote(0x20, space=1) == 50
    assert channel.read_remote(0x20) == 0x11


def test_a_parameter_that_reads_back_differently(hm2, field):
    parameters = hm2.sserial.channels[0].parameters
    hm2.sserial.start(0x01, "setup")
    write = hm2.sserial.write_remote
    hm2.sserial.write_remote = lambda *arguments: None  # a write that the remote does not take
    with pytest.raises(VerifyFailed) as caught:
        parameters["trim"] = 5
    hm2.sserial.write_remote = write
    assert (caught.value.expected, caught.value.received) == (5, 0)


def test_remote_memory_needs_a_stopped_port(hm2, field):
    hm2.sserial.start(0x01)
    channel = hm2.sserial.channels[0]
    for access in (lambda: channel.read_remote(0), lambda: channel.write_remote(0, 0), channel.discover):
        with pytest.raises(PortRunning):
            access()
    with pytest.raises(PortRunning):
        hm2.sserial.start(0x02, "setup")
    assert hm2.sserial.doit(0x01).failed == 0


@pytest.mark.parametrize("size", [1, 2, 4, 8])
def test_remote_memory_of_every_size(hm2, field, size):
    channel = hm2.sserial.channels[0]
    value = 0x8877665544332211 & (1 << 8 * size) - 1
    channel.write_remote(0x330, value, size)
    assert channel.read_remote(0x330, size) == value
    assert field.peek(0x330, size) == value.to_bytes(size, "little")


@pytest.mark.parametrize(
    "what", [{"bad_crc": 1}, {"skip": 1}, {"truncate": 1}, {"extra": 1}, {"framing_break": 1}]
)
def test_an_access_is_repeated_until_its_answer_is_good(hm2, field, what):
    channel = hm2.sserial.channels[0]
    field.poke(0x310, b"\x11\x22\x33\x44")
    assert channel.read_remote(0x310, 4) == 0x44332211
    field.inject(**what)
    assert channel.read_remote(0x310, 2) == 0x2211
    assert channel.read_remote(0x312, 2) == 0x4433
    assert channel.read_remote(0x311, 1) == 0x22


def test_setup_mode_does_not_begin_beside_channels_that_a_broken_start_left_running(card, hm2, field):
    """Time-outs are the port's: a start whose answer was lost on the bus may have started all the same."""
    card.sserial[0].attach(1, field_io(unit_number=7))
    channel = hm2.sserial.channels[0]
    hm2.write(0x5A00, 0x0902)
    hm2.pause(0.01)
    assert hm2.sserial.channels[1].status.state == "chatter"
    assert channel.read_remote(0x1000) == 0xA0
    assert hm2.sserial.channels[1].status.state == "stopped"


def test_a_value_read_while_the_line_shows_errors_is_one_that_was_read_twice(hm2, field, monkeypatch):
    """One damaged answer in 256 passes the CRC: here the first."""
    channel = hm2.sserial.channels[0]
    field.poke(0x310, b"\x11")
    assert channel.read_remote(0x310) == 0x11
    field.inject(bad_crc=1)
    assert channel.read_remote(0x310) == 0x11
    core = hm2.sserial._core
    read, answers = core.read_remote, [0x91]
    monkeypatch.setattr(core, "read_remote", lambda *at: answers.pop() if answers else read(*at))
    assert channel.read_remote(0x310) == 0x11
    answers.extend(range(100))
    with pytest.raises(RemoteSilent, match="no two of 8 reads of address 0x0310 agree"):
        channel.read_remote(0x310)


def test_a_silent_remote_gives_no_value(hm2, field):
    channel = hm2.sserial.channels[0]
    assert channel.read_remote(0x1000) == 0xA0
    field.alive = False
    with pytest.raises(RemoteSilent) as caught:
        channel.read_remote(0x1000)
    assert (caught.value.index, caught.value.address) == (0, 0x1000)
    field.alive = True
    assert channel.read_remote(0x1000) == 0xA0


def test_a_remote_that_is_not_there_has_no_memory(hm2):
    with pytest.raises(NoRemote):
        hm2.sserial.channels[1].read_remote(0)


def test_local_variables(hm2, field):
    assert hm2.sserial.read_local(0) == 0x12
    assert hm2.sserial.read_local(0x230, 4) == 100_000_000 == hm2.sserial.clock_hz
    assert hm2.sserial.revision == "1.43"
    hm2.sserial.start(0x01)
    hm2.sserial.doit(0x01)
    assert hm2.sserial.read_local(7) == len(hm2.sserial.channels)
    hm2.sserial.write_local(0x1A0, 0xBEEF, 2)
    assert hm2.sserial.read_local(0x1A0, 2) == 0xBEEF
    assert hm2.sserial.doit(0x01).failed == 0
    for address, size in ((-1, 1), (0x1000, 1), (0xFFF, 2), (0, 0), (0, 9)):
        with pytest.raises(ValueError, match=r"outside|address"):
            hm2.sserial.read_local(address, size)
    with pytest.raises(ValueError, match="256"):
        hm2.sserial.write_local(0x1A0, 256)


def test_a_slower_line_is_for_setup(hm2, field):
    channel = hm2.sserial.channels[0]
    assert channel.baud_rate == 2_500_000
    field.baud = 115200
    assert hm2.sserial.start(0x01, "setup").failed == 1
    hm2.sserial.stop()
    channel.baud_rate = 115200
    assert channel.read_remote(0x1000) == 0xA0
    hm2.sserial.stop()
    hm2.sserial.reset()
    assert channel.baud_rate == 2_500_000


def test_a_remote_without_checksum(hm2, field):
    channel = hm2.sserial.channels[0]
    field.crc = False
    assert hm2.sserial.start(0x01, "setup").failed == 1
    hm2.sserial.stop()
    assert channel.crc
    channel.crc = False
    assert channel.read_remote(0x1000) == 0xA0
    channel_crc = channel.crc
    hm2.sserial.stop()
    assert not channel_crc
    channel.crc = True
    assert channel.crc


@pytest.mark.parametrize(
    ("address", "value", "size"), [(0x300, 256, 1), (0x300, 1, 3), (0xFFFF, 1, 2), (-1, 1, 1)]
)
def test_writes_that_cannot_be_reach_no_remote(hm2, field, address, value, size):
    hm2.sserial.start(0x01, "setup")
    before = len(field.writes)
    with pytest.raises(ValueError, match=r"fit|size|outside"):
        hm2.sserial.write_remote(0, address, value, size)
    assert len(field.writes) == before


def test_a_remote_left_in_its_eeprom_is_not_taken_for_one_in_ram(hm2, field):
    channel = hm2.sserial.channels[0]
    field.poke(0x20, b"\x11")
    assert channel.read_remote(0x20, space=1) == 50
    hm2.sserial.access_remote(0, SPACE_REGISTER, 0, 1)
    assert channel.read_remote(0x20) == 0x11
    hm2.sserial.access_remote(0, SPACE_REGISTER, 0, 1)
    hm2.sserial.stop()
    assert channel.read_remote(0x20) == 0x11


def test_a_write_cut_short_in_the_eeprom_does_not_send_the_next_one_there(hm2, field):
    channel = hm2.sserial.channels[0]
    assert channel.read_remote(0x20, space=1) == 50
    hm2.sserial.access_remote(0, SPACE_REGISTER, 0, 1)
    field.alive = False
    with pytest.raises(RemoteSilent):
        channel.read_remote(0x20)
    hm2.sserial.stop()
    field.alive = True
    channel.write_remote(0x20, 0x77)
    assert field.peek(0x20) == b"\x77"
    assert field.peek(0x20, space=1) == b"\x32"


def test_a_program_that_was_killed_in_the_eeprom_leaves_its_successor_nothing_wrong(card, field):
    with hostmot2.open(card) as board:
        board.sserial.access_remote(0, SPACE_REGISTER, 0, 1)
    with hostmot2.open(card) as board:
        assert board.sserial.start(0x01).failed == 0
        assert list(board.sserial.channels[0].inputs) == ["input"]


def test_an_lbp_client_that_lost_its_line_in_the_eeprom(card, hm2, field):
    remote = open_channel(hm2.sserial[0], 0)
    assert lbp.parameters(remote)["NVWatchDogTimeout"] == 50
    field.poke(0x20, b"\x11")
    hm2.sserial.access_remote(0, SPACE_REGISTER, 0, 1)
    field.alive = False
    remote.close()
    field.alive = True
    assert hm2.sserial.channels[0].read_remote(0x20) == 0x11
