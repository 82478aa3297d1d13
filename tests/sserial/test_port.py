"""A port on the emulated card: what a user does, and what goes wrong on the way."""

import pytest

import hostmot2
from hostmot2._core import lib
from hostmot2.emulator import EmulatedBoard, EmulatedRemote
from hostmot2.registers import LocalFault, RemoteFault
from hostmot2.sserial import (
    BrokenTable,
    CommandHung,
    NoRemote,
    NotDiscovered,
    NotStarted,
    PortRunning,
    RemoteSilent,
    UnsupportedRemote,
    VerifyFailed,
)

from .tables import BITS, BOTH, FLOAT, IN, NV_UNSIGNED, OUT, SIGNED, UNSIGNED, Memory, element, mode

COMMAND = 0x5A00
IO_ELEMENTS = [element("input", BITS, 32, IN), element("output", BITS, 16, OUT)]
PARAMETERS = [
    element("fieldvoltage", UNSIGNED, 16, IN, 0, 36.3, "V", 0x310),
    element("NVWatchDogTimeout", NV_UNSIGNED, 16, BOTH, 0, 1000, "ms", 0x20),
    element("gain", FLOAT, 32, OUT, 0, 0, "", 0x320),
    element("trim", SIGNED, 8, OUT, -100, 100, "", 0x324),
]


def remote(elements=IO_ELEMENTS, parameters=PARAMETERS, receive=5, transmit=2, **facts):
    memory = Memory()
    toc = memory.build(elements, parameters)
    facts = {"name": "7I77", "unit_number": 0x12000001, "eeprom": {0x20: 50}} | facts
    return EmulatedRemote(
        receive_size=receive,
        transmit_size=transmit,
        ptoc=toc & 0xFFFF,
        gtoc=toc >> 16,
        memory=memory.used(),
        **facts,
    )


def analog():
    elements = [element(f"analogout{i}", SIGNED, 13, OUT, -10, 10, "V", 0x400 + 2 * i) for i in range(6)]
    elements += [element("analogena", BITS, 1, OUT), element("spinena", BITS, 1, OUT)]
    return remote(elements, [mode(0, True, "analog")], receive=1, transmit=10, unit_number=0x11000001)


@pytest.fixture
def card():
    with EmulatedBoard("5i25+7i77", clock="virtual") as card:
        for channel in range(card.sserial[0].channels):
            card.sserial[0].detach(channel)
        yield card


@pytest.fixture
def hm2(card):
    with hostmot2.open(card) as board:
        yield board


@pytest.fixture
def field(card):
    there = remote()
    card.sserial[0].attach(0, there, through_pins=True)
    return there


def give_watchdog(field, ms=50):
    assert lib.hm2_remote_set(field.handle, lib.HM2_REMOTE_WATCHDOG_PS, ms * 10**9) == lib.HM2_OK


def ms(board):
    return board.now_ns() / 1e6


def test_start_finds_names_and_moves_process_data(card, hm2, field):
    card.sserial[0].attach(1, analog())
    field.inputs = (0xA4A3A2A1).to_bytes(4, "little")
    result = hm2.sserial.start(0x03)
    assert (result.started, result.failed) == (3, 0)
    io, dac = hm2.sserial.channels[:2]
    assert (io.name, io.unit_number) == ("7I77", 0x12000001)
    assert list(io.inputs) == ["input"]
    assert list(dac.outputs)[:2] == ["analogout0", "analogout1"]
    io.outputs["output"] = 0xBBAA
    for i, volts in enumerate((1, 2, 3, 4, 5, -10)):
        dac.outputs[f"analogout{i}"] = volts
    dac.outputs["analogena"] = 1
    assert hm2.sserial.doit(0x03).failed == 0
    assert field.outputs == b"\xaa\xbb"
    # the frame of the sheets: 1, 2, 3, 4, 5, -10 V, enabled, spindle off
    assert card.sserial[0].remote(1).outputs.hex() == "996166301333f37f0060"
    assert io.inputs["input"] == 0xA4A3A2A1


def test_the_frame_of_the_sheets_is_what_an_analog_channel_gets(card, hm2):
    card.sserial[0].attach(1, analog())
    hm2.sserial.start(0x02)
    dac = hm2.sserial.channels[1]
    for i, volts in enumerate((10, -10, 0, 5, -5, 2.5)):
        dac.outputs[f"analogout{i}"] = volts
    dac.outputs["analogena"] = dac.outputs["spinena"] = 1
    hm2.sserial.doit(0x02)
    assert card.sserial[0].remote(1).outputs.hex() == "ff0f000280ff0380ffc7"


def test_the_sequence_of_ports_acts_as_port_0(hm2, field):
    assert len(hm2.sserial) == 1
    assert hm2.sserial[0].start(0x01).started == 1
    assert hm2.sserial.started == 1
    assert [port.number for port in hm2.sserial] == [0]


def test_pins_are_switched_by_start_and_by_nothing_before(card):
    card.sserial[0].attach(0, remote(), through_pins=True)
    with hostmot2.open(card) as board:
        assert board.sserial.channels[0].name == ""
        board.write(COMMAND, 0x0901)
        board.pause(0.1)
        assert board.read(0x5B00) == 1  # no contact: did not start
        assert board.sserial.start(0x01).started == 1


def test_outputs_are_zero_until_set_and_again_after_a_stop(hm2, field):
    hm2.sserial.start(0x01)
    hm2.sserial.doit(0x01)
    assert field.outputs == b"\0\0"
    outputs = hm2.sserial.channels[0].outputs
    outputs["output"] = 0xFFFF
    hm2.sserial.doit(0x01)
    assert field.outputs == b"\xff\xff"
    hm2.sserial.stop(0x01)
    assert field.outputs == b"\0\0"
    assert outputs["output"] == 0
    outputs["output"] = 0xFFFF
    hm2.sserial.start(0x01)
    hm2.sserial.doit(0x01)
    assert field.outputs == b"\0\0"


def test_closing_the_board_zeroes_outputs_and_stops(card, field):
    with hostmot2.open(card) as board:
        board.sserial.start(0x01)
        board.sserial.channels[0].outputs["output"] = 0xFFFF
        board.sserial.doit(0x01)
        assert field.outputs == b"\xff\xff"
    assert field.outputs == b"\0\0"
    assert card.read(0x5C00) & 0x00FFFFFF == 0x0000C100


def test_a_second_start_reads_no_tables(hm2, field):
    began = ms(hm2)
    hm2.sserial.start(0x01)
    first = ms(hm2) - began
    hm2.sserial.stop()
    began = ms(hm2)
    hm2.sserial.start(0x01)
    assert ms(hm2) - began < 2.5 < first
    began = ms(hm2)
    assert hm2.sserial.start(0x01).started == 1
    assert ms(hm2) - began < 0.1


def test_an_absent_remote_fails_with_evidence_and_the_others_run(hm2, field):
    result = hm2.sserial.start(0x05)
    assert (result.started, result.failed) == (0x01, 0x04)
    row = result.channels[1]
    assert (row.channel, row.reason, row.status.word & 0xFFFF) == (2, "no answer", 0xE188)
    assert row.counters.timeouts == 20
    with pytest.raises(NoRemote, match=r"(?s)no answer.*power.*cable.*RX and TX") as caught:
        result.raise_for_failed()
    assert [row.channel for row in caught.value.channels] == [2]
    assert hm2.sserial.doit(0x01).failed == 0


def test_a_7i77_without_field_power_is_told_from_a_bad_cable(card, hm2):
    # the field I/O is only detected when VIN is there (7I77 manual)
    card.sserial[0].attach(1, analog())
    text = str(hm2.sserial.start(0x03))
    assert "channel 1, so cable and 5 V are good" in text
    assert "VIN" in text
    hm2.sserial.stop()
    assert "VIN" in repr(hm2.sserial.scan())


def test_a_channel_the_firmware_does_not_have(hm2, field):
    result = hm2.sserial.start(0x81)
    assert (result.started, result.failed) == (0x01, 0x80)
    assert result.channels[-1].reason == "the firmware has no such channel"


@pytest.mark.parametrize("mask", [-1, 0x100])
def test_a_mask_has_eight_bits(hm2, mask):
    for call in (hm2.sserial.start, hm2.sserial.stop, hm2.sserial.doit, hm2.sserial.doit_pipelined):
        with pytest.raises(ValueError, match="mask"):
            call(mask)
    with pytest.raises(ValueError, match="mode"):
        hm2.sserial.start(1, "fast")


def test_a_broken_table_names_its_place_and_stops_no_other_channel(card, hm2, field):
    bad = remote([element("x", UNSIGNED, 8, 0x20), *IO_ELEMENTS])
    card.sserial[0].attach(1, bad)
    result = hm2.sserial.start(0x03)
    assert (result.started, result.failed) == (0x01, 0x02)
    assert "PTOC entry 0 at 0x1003" in result.channels[1].reason
    assert hm2.sserial.doit(0x01).failed == 0
    with pytest.raises(BrokenTable):
        _ = hm2.sserial.channels[1].inputs
    hm2.sserial.stop()
    with pytest.raises(BrokenTable) as caught:
        hm2.sserial.channels[1].discover()
    assert (caught.value.channel, caught.value.table, caught.value.address) == (1, "PTOC", 0x1003)


def test_a_broken_parameter_table_costs_the_parameters_only(card, hm2):
    card.sserial[0].attach(0, remote(parameters=[element("x", UNSIGNED, 12, IN, 0, 1, address=0x333)]))
    assert hm2.sserial.start(0x01).failed == 0
    assert hm2.sserial.doit(0x01).failed == 0
    hm2.sserial.stop()
    with pytest.raises(BrokenTable, match="GTOC"):
        _ = hm2.sserial.channels[0].parameters


def test_a_remote_without_tables_and_without_a_known_name(card, hm2):
    card.sserial[0].attach(0, EmulatedRemote(name="ODD", receive_size=5, transmit_size=2))
    assert hm2.sserial.start(0x01).failed == 0x01
    with pytest.raises(UnsupportedRemote, match="'ODD'"):
        _ = hm2.sserial.channels[0].inputs


def test_the_software_mode_is_written_before_each_start(card, hm2, field):
    hm2.sserial.channels[0].mode = 3
    hm2.sserial.start(0x01)
    assert field.software_mode == 3
    hm2.sserial.stop()
    # remote accesses leave an LBP command where the mode is taken from
    assert hm2.sserial.channels[0].read_remote(0x1000) == 0xA0
    hm2.sserial.start(0x01)
    assert field.software_mode == 3
    with pytest.raises(ValueError, match="256"):
        hm2.sserial.channels[0].mode = 256


def test_a_fault_that_does_not_go_away_keeps_the_channel_stopped(hm2, field):
    field.fault, field.fault_clears = 0x08, False
    result = hm2.sserial.start(0x01)
    assert result.failed == 0x01
    assert "over current" in result.channels[0].reason
    field.fault = 0
    assert hm2.sserial.start(0x01).failed == 0


def test_a_lost_reply_fails_its_transfer_and_keeps_the_inputs(hm2, field):
    field.inputs = b"\x11\x22\x33\x44"
    hm2.sserial.start(0x01)
    hm2.sserial.doit(0x01)
    field.inputs = b"\x55\x66\x77\x88"
    field.inject(skip=1)
    result = hm2.sserial.doit(0x01)
    assert result.failed == 0x01
    assert hm2.sserial.channels[0].inputs["input"] == 0x44332211
    assert [fault.causes for fault in result.faults] == [("timeout",)]
    assert hm2.sserial.doit(0x01).failed == 0
    assert hm2.sserial.channels[0].inputs["input"] == 0x88776655
    assert hm2.sserial.channels[0].status.local_fault == LocalFault.TIMEOUT
    assert hm2.sserial.channels[0].counters.timeouts == 1
    assert hm2.sserial.transfers["failed"][0] == 1


def test_one_crc_error_is_two_failed_transfers(hm2, field):
    hm2.sserial.start(0x01)
    hm2.sserial.doit(0x01)
    field.inject(bad_crc=1)
    assert [hm2.sserial.doit(0x01).failed for _ in range(3)] == [1, 1, 0]


def test_transfers_of_channels_that_are_not_started_fail(hm2, field):
    with pytest.raises(NotStarted):
        hm2.sserial.doit()
    assert hm2.sserial.doit(0x01).failed == 0x01
    hm2.sserial.start(0x01)
    assert hm2.sserial.doit(0x07).failed == 0x06
    assert hm2.sserial.doit().failed == 0


def test_a_remotes_watchdog_is_reported_and_nothing_starts_by_itself(hm2, field):
    give_watchdog(field)
    hm2.sserial.start(0x01)
    hm2.sserial.channels[0].outputs["output"] = 0xFFFF
    hm2.sserial.doit(0x01)
    hm2.pause(0.1)
    result = hm2.sserial.doit(0x01)
    assert result.failed == 0
    assert result.faults[0].causes == ("watchdog bitten", "remote fault")
    for _ in range(5):
        hm2.sserial.doit(0x01)
    assert hm2.sserial.channels[0].status.remote_fault == RemoteFault.WATCHDOG
    assert hm2.sserial.start(0x01).started == 1
    assert hm2.sserial.doit(0x01).failed == 0
    assert hm2.sserial.channels[0].status.word == 0x00420000
    assert hm2.sserial.channels[0].outputs["output"] == 0


def test_starting_one_channel_leaves_a_running_one_alone(card, hm2, field):
    card.sserial[0].attach(2, remote(unit_number=7))
    hm2.sserial.start(0x01)
    hm2.sserial.channels[0].outputs["output"] = 0x1234
    hm2.sserial.doit(0x01)
    assert hm2.sserial.start(0x04).started == 0x04
    assert hm2.sserial.started == 0x05
    assert field.outputs == b"\x34\x12"
    assert hm2.sserial.channels[2].inputs["input"] == 0
    assert hm2.sserial.doit(0x05).failed == 0


def test_a_remote_plugged_in_later_is_described_when_nothing_else_runs(card, hm2, field):
    hm2.sserial.start(0x01)
    card.sserial[0].attach(2, remote(unit_number=7))
    assert hm2.sserial.start(0x04).started == 0x04
    with pytest.raises(NotDiscovered):
        _ = hm2.sserial.channels[2].inputs
    assert hm2.sserial.doit(0x05).failed == 0
    hm2.sserial.stop()
    hm2.sserial.start(0x05)
    assert hm2.sserial.channels[2].inputs["input"] == 0


def test_another_remote_in_the_same_place_is_described_anew(card, hm2, field):
    hm2.sserial.start(0x01)
    hm2.sserial.stop()
    card.sserial[0].attach(0, remote([element("other", UNSIGNED, 16, IN, 0, 1)], unit_number=9, receive=3))
    assert hm2.sserial.start(0x01).failed == 0
    assert list(hm2.sserial.channels[0].inputs) == ["other"]


def test_scan_tells_of_every_channel(card, hm2, field):
    card.sserial[0].attach(1, EmulatedRemote(name="ODD", receive_size=5, transmit_size=2))
    rows = hm2.sserial.scan()
    assert [row.name for row in rows] == ["7I77", "ODD", ""]
    assert [row.found for row in rows] == [True, True, False]
    assert rows[0].reason == "ok"
    assert "no table" in rows[1].reason
    assert rows[2].reason == "no answer"
    assert (rows[0].elements, rows[0].parameters) == (2, 4)
    assert hm2.sserial.started == 0
    assert "7I77" in repr(rows)
    hm2.sserial.start(0x01)
    with pytest.raises(PortRunning):
        hm2.sserial.scan()


def test_a_port_reads_like_a_table(hm2, field):
    hm2.sserial.start(0x01)
    hm2.sserial.channels[0].outputs["output"] = 0xBEEF
    text = repr(hm2.sserial)
    assert "SSLBP 1.43" in text
    assert "12000001" in text
    assert "out output" in text
    assert "0xBEEF" in text


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


def test_the_firmware_knows_better_than_the_pins_how_many_channels_there_are():
    with EmulatedBoard("5i25+7i77", clock="virtual", sserial_channels=4) as card:
        there = remote()
        card.sserial[0].attach(0, there)
        with hostmot2.open(card) as board:
            assert len(board.sserial.channels) == 4
            assert board.sserial.start(0x01).started == 1


def test_a_hung_command_stops_everything_and_says_so(hm2, field):
    hm2.sserial.start(0x01)
    hm2.sserial.channels[0].outputs["output"] = 0xFFFF
    hm2.sserial.doit(0x01)
    hm2.write(COMMAND, 0x3066)  # never completes (SSLBP observed 2)
    with pytest.raises(CommandHung, match="stopped"):
        hm2.sserial.counters()
    assert hm2.read(COMMAND) == 0
    assert hm2.sserial.started == 0
    assert hm2.sserial.start(0x01).started == 1
    assert hm2.sserial.doit(0x01).failed == 0
    assert field.outputs == b"\0\0"


def test_a_port_left_hanging_by_another_program_is_taken_over(card, field):
    card.advance(1000)
    card.write(COMMAND, 0x0901)
    card.advance(50)
    card.write(COMMAND, 0x0800)  # STOP ALL while busy hangs
    card.advance(100_000)
    assert card.read(COMMAND) == 0x0800
    with hostmot2.open(card) as board:
        assert board.sserial.start(0x01).started == 1


def test_a_start_that_never_ends_costs_its_own_channel_only(card, hm2, field):
    drive = EmulatedRemote(model="8i20", name="8I20", unit_number=0x1F)
    card.sserial[0].attach(1, drive)
    drive.clear_flag_busy_reads = 1_000_000
    result = hm2.sserial.start(0x03)
    assert (result.started, result.failed) == (0x01, 0x02)
    assert result.channels[1].name == "8I20"
    assert "did not end" in result.channels[1].reason
    for _ in range(3):
        assert hm2.sserial.doit(0x01).failed == 0
    drive.clear_flag_busy_reads = 0
    assert hm2.sserial.start(0x02).started == 0x02
    assert hm2.sserial.doit(0x03).failed == 0


def test_an_8i20_is_scaled_by_its_own_full_scale(card, hm2):
    drive = EmulatedRemote(model="8i20", name="8I20", unit_number=0x1F)
    drive.poke(0x08E8, (750).to_bytes(2, "little"))  # 7.5 A
    card.sserial[0].attach(0, drive)
    hm2.sserial.start(0x01)
    channel = hm2.sserial.channels[0]
    channel.outputs["angle"] = 0.25
    channel.outputs["current"] = -1
    drive.inputs = bytes.fromhex("0100 0000 b0b1 7071")
    hm2.sserial.doit(0x01)
    assert drive.outputs == bytes.fromhex("ff3f eeee")
    assert channel.inputs["bus-voltage"] == pytest.approx(0xB1B0 * 0.01)
    assert channel.inputs.raw("card-temp") == 0x7170
    assert channel.inputs["status"] == 1


def test_faults_of_an_8i20_are_named_each_time(card, hm2):
    drive = EmulatedRemote(model="8i20", name="8I20", unit_number=0x1F)
    card.sserial[0].attach(0, drive)
    hm2.sserial.start(0x01)
    seen = []
    for fault in (0x0000, 0x0010, 0x0010, 0x0000, 0x0110):
        drive.inputs = b"\0\0" + fault.to_bytes(2, "little") + b"\0\0\0\0"
        seen.append([each.causes for each in hm2.sserial.doit(0x01).faults])
    assert seen == [
        [],
        [("over current",)],
        [],
        [],
        [("over current", "bus under voltage")],
    ]


def test_a_7i64(card, hm2):
    there = EmulatedRemote(model="7i64", name="7I64", unit_number=2)
    card.sserial[0].attach(0, there)
    there.inputs = bytes.fromhex("112233 00 ffff 0080")
    hm2.sserial.start(0x01)
    hm2.sserial.channels[0].outputs["output"] = 0x123456
    hm2.sserial.doit(0x01)
    inputs = hm2.sserial.channels[0].inputs
    assert there.outputs[:3] == bytes.fromhex("563412")
    assert inputs["input"] == 0x332211
    assert inputs["analog0"] == pytest.approx(3.3)
    assert inputs["analog1"] == pytest.approx(1.65, abs=1e-3)


def test_a_pipeline_takes_in_what_the_step_before_sent_for(hm2, field):
    field.inputs = b"\x01\0\0\0"
    hm2.sserial.start(0x01)
    hm2.sserial.channels[0].outputs["output"] = 0x0102
    assert hm2.sserial.doit_pipelined(0x01).requested == 0
    hm2.pause(0.0005)
    field.inject(skip=1)
    first = hm2.sserial.doit_pipelined(0x01)
    assert (first.requested, first.failed) == (1, 0)
    assert hm2.sserial.channels[0].inputs["input"] == 1
    assert field.outputs == b"\x02\x01"
    hm2.pause(0.001)
    assert hm2.sserial.doit_pipelined(0x01).failed == 1


def test_the_boards_cycle_moves_the_channels_it_is_given(hm2, field):
    field.inputs = b"\x05\0\0\0"
    hm2.cycle.automatic_watchdog = False
    hm2.sserial.start(0x01)
    hm2.sserial.cyclic = 0x01
    hm2.sserial.channels[0].outputs["output"] = 0x55AA
    requested = []
    for _ in range(3):
        hm2.cycle.run()
        hm2.pause(0.001)
        requested.append(hm2.sserial.last_cycle.requested)
    assert requested == [0, 1, 1]
    assert field.outputs == b"\xaa\x55"
    assert hm2.sserial.channels[0].inputs["input"] == 5
    field.inject(skip=1)
    hm2.cycle.run()
    hm2.pause(0.001)
    hm2.cycle.run()
    assert hm2.sserial.last_cycle.failed == 1
    assert hm2.sserial.faults[-1].causes == ("timeout",)


def test_reading_and_writing_apart_let_cycles_be_short(hm2, field):
    hm2.cycle.automatic_watchdog = False
    hm2.sserial.start(0x01)
    hm2.sserial.doit(0x01)
    hm2.sserial.cyclic = 0x01
    for _ in range(5):
        hm2.cycle.read()
        hm2.cycle.write()
        hm2.pause(0.0001)
    assert hm2.sserial.transfers["too_soon"] == 0
    for _ in range(5):
        hm2.cycle.run()
        hm2.pause(0.0001)
    assert hm2.sserial.transfers["too_soon"] > 0
    assert hm2.read(COMMAND) == 0


def test_a_bite_of_the_cards_watchdog_leaves_the_port_stopped(hm2, field):
    give_watchdog(field)
    hm2.sserial.start(0x01)
    hm2.sserial.cyclic = 0x01
    hm2.sserial.channels[0].outputs["output"] = 0xFFFF
    hm2.cycle.run()
    hm2.pause(0.2)
    with pytest.raises(hostmot2.HostMot2Error):
        hm2.cycle.run()
    hm2.watchdog.acknowledge()
    hm2.cycle.run()
    hm2.pause(0.001)
    hm2.cycle.run()
    assert hm2.sserial.started == 0
    assert hm2.sserial.channels[0].outputs["output"] == 0
    assert field.fault & 0x01 or field.outputs == b"\0\0"


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
