"""A port on the emulated card: starting, stopping, and what is known of remotes."""

import pytest

import hostmot2
from hostmot2.emulator import EmulatedBoard, EmulatedRemote
from hostmot2.errors import SserialError, WatchdogBite
from hostmot2.registers import SslbpLocal
from hostmot2.sserial import (
    BrokenTable,
    NoFirmware,
    NoRemote,
    NotDiscovered,
    PortRunning,
    UnsupportedRemote,
)
from hostmot2.sserial.core import Core

from .remotes import COMMAND, IO_ELEMENTS, analog, field_io
from .tables import IN, UNSIGNED, element


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
    card.sserial[0].attach(0, field_io(), through_pins=True)
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
    with pytest.raises(NoRemote, match=r"(?s)no answer.*powered.*the pairs.*jumper") as caught:
        result.raise_for_failed()
    assert [row.channel for row in caught.value.channels] == [2]
    assert hm2.sserial.doit(0x01).failed == 0


def test_a_7i77_without_field_power_is_told_from_a_bad_cable(card, hm2):
    # the field I/O is only detected when VIN is there (7I77 manual)
    card.sserial[0].attach(1, analog())
    text = str(hm2.sserial.start(0x03))
    assert "analog outputs (channel 1) did answer: 5 V, cable and bitfile are good" in " ".join(text.split())
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
    bad = field_io([element("x", UNSIGNED, 8, 0x20), *IO_ELEMENTS])
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


def test_starting_one_channel_leaves_a_running_one_alone(card, hm2, field):
    card.sserial[0].attach(2, field_io(unit_number=7))
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
    card.sserial[0].attach(2, field_io(unit_number=7))
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
    card.sserial[0].attach(0, field_io([element("other", UNSIGNED, 16, IN, 0, 1)], unit_number=9, receive=3))
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


def test_the_firmware_knows_better_than_the_pins_how_many_channels_there_are():
    with EmulatedBoard("5i25+7i77", clock="virtual", sserial_channels=4) as card:
        there = field_io()
        card.sserial[0].attach(0, there)
        with hostmot2.open(card) as board:
            assert len(board.sserial.channels) == 4
            assert board.sserial.start(0x01).started == 1


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


def test_another_remote_plugged_in_while_others_run_leaves_their_outputs_alone(card, hm2, field):
    card.sserial[0].attach(2, EmulatedRemote("7I64", 5, model="7i64"))
    hm2.sserial.start(0b101)
    outputs = hm2.sserial.channels[0].outputs
    outputs["output"] = 0x00FF
    hm2.sserial.stop(0b100)
    card.sserial[0].attach(2, EmulatedRemote("8I20", 6, model="8i20"))
    result = hm2.sserial.start(0b100)
    assert (result.started, result.failed) == (0, 0b100)
    with pytest.raises(NotDiscovered, match="another remote"):
        hm2.sserial.channels[2].outputs["current"] = 1.0
    hm2.sserial.doit()
    assert field.outputs == b"\xff\x00"
    outputs["output"] = 0x0001
    hm2.sserial.doit()
    assert field.outputs == b"\x01\x00"
    hm2.sserial.stop()
    assert hm2.sserial.start(0b101).started == 0b101
    assert "current" in hm2.sserial.channels[2].outputs


def test_a_bite_during_the_search_for_remotes_is_no_missing_remote(card, hm2, field):
    hm2.gpio[30].drive(False)
    with pytest.raises(WatchdogBite):
        hm2.sserial.start(0b001)
    assert card.pin(30).level == "H"
    hm2.watchdog.acknowledge()
    assert hm2.sserial.start(0b001).failed == 0


def test_a_string_switches_nothing(card, hm2, field):
    hm2.sserial.start(0b001)
    with pytest.raises(TypeError):
        hm2.sserial.channels[0].outputs["output"][0] = "off"
    with pytest.raises(TypeError):
        hm2.gpio[30].drive("off")
    assert card.pin(30).level == "H"


def test_what_is_no_card_is_a_type_error(hm2):
    with pytest.raises(TypeError, match="int"):
        hostmot2.open(5)
    with pytest.raises(TypeError, match="int"):
        hm2.card(7)


def test_elements_of_a_channel_without_a_remote_say_what_to_check(hm2, field):
    with pytest.raises(NoRemote, match="channel 1: no remote has answered here") as caught:
        _ = hm2.sserial.channels[1].modes
    assert caught.value.index == 1


def test_a_doit_that_comes_too_soon_is_refused_and_nothing_is_sent(hm2, field):
    hm2.sserial.start(0x01)
    hm2.sserial.doit_pipelined()
    output = hm2.sserial.channels[0].outputs
    output["output"] = 0x55
    with pytest.raises(SserialError, match="still at work"):
        hm2.sserial.doit_pipelined()
    hm2.pause(0.001)
    assert field.outputs == b"\0\0"
    assert hm2.sserial.doit_pipelined().failed == 0


def test_line_settings_are_for_ports_that_are_stopped_and_have_bounds(hm2, field):
    channel = hm2.sserial.channels[0]
    hm2.sserial.start(0x01)
    with pytest.raises(PortRunning, match="are started"):
        channel.baud_rate = 115200
    with pytest.raises(PortRunning, match="are started"):
        channel.crc = False
    hm2.sserial.stop()
    assert (channel.baud_rate, channel.crc) == (2_500_000, True)
    for baud in (0, 1 << 32):
        with pytest.raises(ValueError, match="baud rate"):
            channel.baud_rate = baud


@pytest.fixture
def variables(monkeypatch):
    """What the firmware says of itself: its first bytes, changed by number."""
    changed = {}
    read = Core.read_local

    def told(self, address, count):
        found = bytearray(read(self, address, count))
        for number, value in changed.items():
            if address <= number < address + count <= 0x10:
                found[number - address] = value
        return bytes(found)

    monkeypatch.setattr(Core, "read_local", told)
    return changed


def test_a_processor_that_is_no_sslbp_is_told(hm2, field, variables):
    variables[SslbpLocal.interface_type.number] = 0x13
    with pytest.raises(NoFirmware, match="0x13 is not SSLBP") as caught:
        hm2.sserial.start(0x01)
    assert (caught.value.expected, caught.value.received) == (0x12, 0x13)


def test_a_firmware_that_does_not_tell_where_channels_are_still_moves_data(hm2, field, variables):
    variables[SslbpLocal.channel_start.number] = variables[SslbpLocal.channel_stride.number] = 0
    assert hm2.sserial.start(0x01).failed == 0
    hm2.sserial.channels[0].outputs["output"] = 0x1234
    assert hm2.sserial.doit(0x01).failed == 0
    assert field.outputs == b"\x34\x12"
    with pytest.raises(NoFirmware, match="does not tell where channels are"):
        hm2.sserial.counters()
