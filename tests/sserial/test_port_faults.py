"""Transfers on the emulated card: what fails, what is reported, what hangs, and what follows each other."""

import pytest

import hostmot2
from hostmot2._core import ffi, lib
from hostmot2.emulator import EmulatedBoard, EmulatedRemote
from hostmot2.registers import LocalFault, RemoteFault
from hostmot2.sserial import (
    CommandHung,
    NotStarted,
    RemoteSilent,
)

from .remotes import COMMAND, field_io, give_watchdog


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


def faults(remote, *planned):
    """Faults at counted answers of a remote, which keeps them: it is still asked when its board is closed."""
    array = ffi.new(
        "hm2_fault[]", [{"step": step, "kind": kind, "repeat": more} for step, kind, more in planned]
    )
    lib.hm2_remote_set_faults(remote.handle, array, len(planned))
    remote.faults = array


@pytest.mark.parametrize("answer", range(1, 11))
def test_an_answer_that_comes_twice_at_the_start_makes_no_other_remote(hm2, field, answer):
    faults(field, (answer, lib.HM2_FAULT_TWICE, 0))
    (row,) = [row for row in hm2.sserial[0].scan() if row.found]
    assert (row.name, row.unit_number, row.elements) == ("7I77", 0x12000001, 2)


START_ANSWERS = 17
UNIT_NUMBER = 5
"""Answers to a normal start; which is the unit number, behind cookie, time limit and the status (3.3)."""


@pytest.fixture
def beside(card, hm2, field):
    """Another remote, on channel 1 and running; `field` is known and stopped."""
    other = field_io(unit_number=0x12000002)
    card.sserial[0].attach(1, other, through_pins=True)
    hm2.sserial[0].scan()
    hm2.sserial.start(0x02)
    hm2.sserial.channels[1].outputs["output"] = 0x55AA
    hm2.sserial.doit()
    return other


@pytest.mark.parametrize("answer", range(1, START_ANSWERS))
def test_whichever_answer_gets_lost_in_a_start_the_remote_is_started_and_that_is_told(
    hm2, field, beside, answer
):
    """The firmware itself gives up at a unit number that it does not hear (sserial.md 3.4)."""
    faults(field, (answer, lib.HM2_FAULT_LOST, 0))
    result = hm2.sserial.start(0x01)
    assert (result.started, result.failed, result.repeated) == (0x01, 0, 0x01)
    assert "repeated 0x01" in str(result)
    assert hm2.sserial.transfers["starts_repeated"] == 1
    assert hm2.sserial[0].identity(0).unit_number == 0x12000001
    assert hm2.sserial.started == 0x03
    assert hm2.sserial.doit().failed == 0
    assert (field.outputs, beside.outputs) == (bytes(2), b"\xaa\x55")


def test_a_start_that_loses_its_unit_number_twice_has_failed(hm2, field, beside):
    faults(field, (UNIT_NUMBER, lib.HM2_FAULT_LOST, 0), (2 * UNIT_NUMBER, lib.HM2_FAULT_LOST, 0))
    result = hm2.sserial.start(0x01)
    assert (result.failed, result.repeated, hm2.sserial.transfers["starts_repeated"]) == (0x01, 0x01, 1)
    assert hm2.sserial.started == 0x02
    assert "start did not end" in result.channels[0].reason or "no answer" in result.channels[0].reason
    assert not hm2.sserial.start(0x01).failed


def test_a_start_without_trouble_and_one_without_a_remote_are_not_repeated(card, hm2, field):
    result = hm2.sserial.start(0x03)
    assert (result.started, result.failed, result.repeated) == (0x01, 0x02, 0)
    assert hm2.sserial.transfers["starts_repeated"] == 0
    assert "repeated" not in str(result)


def test_what_arrives_damaged_at_every_start_is_not_believed(hm2, field):
    faults(field, (1, lib.HM2_FAULT_TWICE, -1))
    row = hm2.sserial[0].scan()[0]
    assert row.description is None
    assert "damaged" in row.reason or "no answer" in row.reason or "not as an LBP" in row.reason


@pytest.mark.parametrize(("spoil", "sent"), [("skip", 2), ("bad_crc", 3)])  # a wrong CRC fails two
def test_zeroes_without_a_good_answer_before_a_stop_are_sent_again(hm2, field, spoil, sent):
    hm2.sserial.start(0x01)
    hm2.sserial.channels[0].outputs["output"] = 0x1234
    hm2.sserial.doit()
    before = hm2.sserial.transfers["doits"]
    field.inject(**{spoil: 1})
    hm2.sserial.stop()
    assert field.outputs == bytes(2)
    assert hm2.sserial.transfers["doits"] - before == sent  # whether the first arrived nobody knows


def test_a_remote_that_does_not_answer_is_not_polled_all_the_time(hm2, field):
    hm2.sserial.start(0x01, "setup")
    field.alive = False
    before = hm2.counters["exchanges"]
    with pytest.raises(RemoteSilent):
        hm2.sserial.channels[0].read_remote(0x100)
    assert hm2.counters["exchanges"] - before < 2000  # three tries of 50 ms


def test_what_a_program_that_was_killed_left_is_seen_before_the_port_is_reset(card, field):
    killed = hostmot2.open(card)
    killed.sserial.start(0x01)
    killed.sserial.doit()
    for _ in range(3):
        field.inject(bad_crc=1)
        killed.sserial.doit()
        killed.pause(0.001)
    killed._close_bus()
    with hostmot2.open(card) as board:
        with board.sserial.untouched():
            assert board.sserial.counters()[0].crc_errors == 3
            assert board.sserial.channels[0].status.state == "running"
            assert board.sserial.revision == "1.43"
        assert board.sserial.counters()[0].crc_errors == 0
        assert board.sserial.channels[0].status.state == "stopped"


def test_a_stored_rate_is_mended_through_the_card_as_the_error_says():
    with EmulatedBoard("5i25+7i77", clock="virtual") as card, hostmot2.open(card) as board:
        remote = card.sserial[0].remote(1)
        remote.set_raw("NVBaudRate", 4)  # 115200
        remote.power_cycle()
        assert "115.2 kbaud only" in repr(board.sserial.scan(setup_rate=True))
        channel = board.sserial.channels[1]
        channel.baud_rate = 115200
        channel.discover()
        channel.parameters["NVBAUDRATE"] = 9
        remote.power_cycle()
        board.sserial.reset()
        assert board.sserial.scan()[1].found
