"""What smart serial says of a channel or port that cannot be used: the error's kind, place and numbers."""

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2._core import ffi, lib
from hostmot2.emulator import EmulatedBoard, catalog
from hostmot2.registers import LocalFault, RemoteFault
from hostmot2.sserial import (
    BrokenTable,
    CommandHung,
    NoFirmware,
    NoRemote,
    NotStarted,
    PortRunning,
    RemoteSilent,
)
from hostmot2.sserial.checklist import advise
from hostmot2.sserial.errors import SserialError, raise_for
from hostmot2.sserial.evidence import ChannelEvidence, Identity
from hostmot2.sserial.places import Place
from hostmot2.sserial.status import ChannelStatus
from hostmot2.wiring import WIRING

from .remotes import field_io
from .tables import FLOAT, IN, element


@pytest.mark.parametrize(
    ("status", "detail", "kind", "said"),
    [
        ("HM2_ERR_BUSY", "HM2_SSERIAL_MODE_CONFLICT", PortRunning, "run in the other mode"),
        ("HM2_ERR_BUSY", "HM2_SSERIAL_NOT_STARTED", NotStarted, "channel 5: not started in setup mode"),
        ("HM2_ERR_BUSY", "HM2_SSERIAL_TOO_SOON", SserialError, "the cycle is too short"),
        ("HM2_ERR_BUSY", "HM2_SSERIAL_LENT", errors.EngineError, "the cycle engine has the port"),
        ("HM2_ERR_PROTOCOL", "HM2_SSERIAL_NO_FIRMWARE", NoFirmware, "revision reads 0x5A07 after a reset"),
        ("HM2_ERR_PROTOCOL", "HM2_SSERIAL_REMOTE_SILENT", RemoteSilent, "no valid answer for address 0x0310"),
        ("HM2_ERR_TIMEOUT", "HM2_SSERIAL_DEAD", CommandHung, "0x5A07 .* nor resetting"),
    ],
)
def test_what_the_core_reports_has_its_own_error(status, detail, kind, said):
    where = ffi.new("char[]", b"sserial test")
    facts = {"where": where, "detail": getattr(lib, detail), "index": 5, "address": 0x310, "received": 0x5A07}
    error = ffi.new("hm2_error *")
    for name, value in facts.items():
        if name == "where":
            ffi.memmove(ffi.addressof(error[0], "where"), where, len(where))
        else:
            setattr(error, name, value)
    with pytest.raises(kind, match=f"smart serial port 2.*{said}") as caught:
        raise_for(getattr(lib, status), error[0], 2)
    assert caught.value.received == 0x5A07


FOUND, SILENT = 0x12000001, 0


def row(channel, word, unit=SILENT, place=None, problem=None, exists=True):
    """What a scan has seen of a channel."""
    identity = Identity(unit, "7I77" if unit else "", 0, ChannelStatus(word))
    return ChannelEvidence(channel, exists, False, identity, None, problem, None, place or Place("P3"))


@pytest.mark.parametrize(
    ("word", "unit", "reason", "check"),
    [
        (RemoteFault.ILLEGAL_MODE << 24, FOUND, "does not have this software mode", "0 always exists"),
        (LocalFault.INVALID_COOKIE, SILENT, "not as an LBP remote does", "no smart-serial remote hangs"),
        (LocalFault.CRC, SILENT, "arrive damaged", "polarity"),
        (LocalFault.SERIAL_BREAK, SILENT, "arrive damaged", "polarity"),
        (LocalFault.TIMEOUT, SILENT, "no answer", None),
        (0, SILENT, "stopped", None),
    ],
)
def test_a_channel_that_did_not_start_says_why_and_what_to_check(word, unit, reason, check):
    failed = row(0, word, unit)
    assert reason in failed.reason
    checks = advise([failed], [failed]).checks
    assert any(check in each for each in checks) if check else checks == tuple(NoRemote.causes)


def test_a_fault_byte_of_before_the_start_is_not_why_it_failed():
    """The mode was put right, then nothing answered: 0x40 is left over."""
    failed = row(0, 0x400DE188, FOUND)
    assert "software mode" not in failed.reason
    assert not any("channel.mode" in check for check in advise([failed], [failed]).checks)


@pytest.mark.parametrize(
    ("word", "check"),
    [
        (0x001EA188, "termination"),  # it fell silent in the middle of the start
        (0x00328100, "stays busy"),  # 8I20: its enable flag was awaited for ever
        (0x0037A1C0, "its own fault"),  # 8I20: the fault byte does not say which
        (0x0824A1C0, "own fault (over current)"),
    ],
)
def test_a_start_that_broke_off_without_a_fault_is_not_told_as_the_remotes_fault(word, check):
    checks = advise([row(0, word, FOUND)], [row(0, word, FOUND)]).checks
    assert any(check in each for each in checks)
    assert not any("not ready" in each for each in checks)


def test_a_channel_that_the_firmware_does_not_have_points_at_the_bitfile():
    failed = row(7, 0, exists=False)
    assert failed.reason == "the firmware has no such channel"
    assert "bitfile" in advise([failed], [failed]).checks[0]


def test_different_checks_name_their_channels():
    failed = [row(0, LocalFault.CRC), row(1, LocalFault.INVALID_COOKIE)]
    checks = advise(failed, failed).checks
    assert {check[:11] for check in checks} == {"channel 0: ", "channel 1: "}
    assert len({each for each in checks if "polarity" in each}) == 1


def test_the_expansion_channel_is_judged_by_what_the_card_itself_does():
    """A remote further down is wrong at its own wires only if the card answers at all."""
    facts = WIRING["7i77"]
    own, further = facts.remotes[0], next(remote for remote in facts.remotes if not remote.needed)
    silent = LocalFault.TIMEOUT
    beyond = row(2, silent, place=Place("P3", facts, further))
    card = row(0, silent, place=Place("P3", facts, own))
    everything = advise([beyond], [card, beyond])
    assert everything.seen == ("Nothing of the 7I77 at P3 answers.",)
    assert everything.checks == (*facts.silent_checks, *further.checks)
    alone = advise([beyond], [beyond])
    assert (alone.seen, alone.checks) == ((), (*further.checks, *facts.silent_checks)), "nobody was asked"


def test_a_place_without_known_wiring_is_its_connector():
    assert str(Place("P3")) == "P3"
    assert str(Place("P3", WIRING["7i77"], WIRING["7i77"].remotes[0])) == "7I77 field I/O at P3"


def test_a_unit_number_begins_with_the_kind_of_device():
    assert Identity(0x12000001, "7I77", 0, ChannelStatus(0)).device_code == 0x12


def test_a_status_prints_its_word_and_what_it_means():
    assert repr(ChannelStatus(0)) == "<CS 0x00000000: stopped>"


def test_a_port_is_there_even_if_nothing_runs(hm2):
    assert hm2.sserial
    assert hm2.sserial.cyclic == 0
    assert "no answer" in repr(hm2.sserial.start(0x01))


def test_a_remote_with_tables_but_no_elements_says_so(card, hm2):
    card.sserial[0].attach(0, field_io([], [], receive=1, transmit=0), through_pins=True)
    hm2.sserial.start(0x01)
    assert "no elements" in repr(hm2.sserial)


def test_an_unknown_kind_of_parameter_is_left_out_with_a_warning(card, hm2):
    strange = element("mystery", 0x55, 16, IN, 0, 1, "", 0x330)
    known = element("gain", FLOAT, 32, IN, 0, 0, "", 0x320)
    card.sserial[0].attach(0, field_io(parameters=[strange, known]), through_pins=True)
    hm2.sserial.start(0x01)
    channel = hm2.sserial.channels[0]
    assert any("0x55, 'mystery' left out" in warning for warning in channel.description.warnings)
    assert "mystery" not in channel.parameters
    assert "gain" in channel.parameters


@pytest.mark.parametrize("what", ["endless", "loop"])
def test_a_table_that_does_not_end_is_broken_and_read_only_so_far(card, hm2, what):
    remote = catalog.remote("7i77-io")
    remote.corrupt(what)
    card.sserial[0].attach(0, remote, through_pins=True)
    row = hm2.sserial.start(0x01).channels[0]
    assert isinstance(row.problem, BrokenTable)
    assert hm2.sserial.started == 0
    remote.power_cycle()
    assert hm2.sserial.start(0x01).failed == 0


def test_at_the_rate_of_set_up_jumpers_is_looked_only_where_nothing_answered():
    with (
        EmulatedBoard("5i25+7i77", clock="virtual", sserial_channels=1) as card,
        hostmot2.open(card) as board,
    ):
        scan = board.sserial[0].scan(setup_rate=True)
        assert [row.found for row in scan] == [True]
        assert board.sserial[0].channels[0].baud_rate == 2_500_000
        assert scan[0].problem is None
