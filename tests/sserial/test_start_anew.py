"""What a start must not take over from before: scales, references, faults, inputs, tables, cards."""

import pytest

import hostmot2
from hostmot2.cards.errors import CardFault
from hostmot2.emulator import EmulatedBoard, catalog
from hostmot2.registers import RemoteFault
from hostmot2.sserial import NotDiscovered, RemoteSilent

from .remotes import field_io
from .tables import ENCODER_H, ENCODER_L, IN, OUT, UNSIGNED, element


def drive_on(card, channel=0):
    drive = catalog.remote("8i20")
    card.sserial[0].attach(channel, drive, through_pins=True)
    return drive


# -- scales


def test_a_full_scale_written_since_is_the_one_that_currents_are_scaled_by(card, hm2):
    drive = drive_on(card)
    channel = hm2.sserial.channels[0]
    hm2.sserial.start(0x01)
    hm2.sserial.stop()
    channel.parameters["MAXCURRENT"] = 3000
    assert hm2.sserial.start(0x01).failed == 0
    channel.outputs["current"] = 3.0
    hm2.sserial.doit()
    assert drive.get("qsetpoint") == pytest.approx(0.1 * 32767, abs=2)


def test_a_full_scale_that_a_power_cycle_brings_is_seen(card, hm2):
    drive = drive_on(card)
    hm2.sserial.start(0x01)
    hm2.sserial.stop()
    drive.set_raw("NVMAXCURRENT", 3000)
    drive.power_cycle()
    assert hm2.sserial.start(0x01).failed == 0
    assert hm2.sserial.channels[0].outputs.field("current").maximum == 30.0


@pytest.mark.parametrize("how", ["off", "unreadable"])
def test_a_drive_that_is_not_heard_for_a_while_keeps_its_elements(card, hm2, field, monkeypatch, how):
    def unreadable(*_):
        raise RemoteSilent("no valid answer")

    drive = drive_on(card, 2)
    hm2.sserial.start(0x05)
    outputs = hm2.sserial.channels[2].outputs
    hm2.sserial.stop()
    with monkeypatch.context() as patch:
        drive.alive = how != "off"
        if how == "unreadable":
            patch.setattr(hm2.sserial._core, "read_remote", unreadable)
        result = hm2.sserial.start(0x05)
        assert (result.started, result.failed) == (0x01, 0x04)
    drive.alive = True
    hm2.sserial.stop()
    assert hm2.sserial.start(0x05).failed == 0
    outputs["current"] = 1.0
    hm2.sserial.doit()
    assert drive.get("qsetpoint") == pytest.approx(1.0 / 7.5 * 32767, abs=2)


def test_a_known_drive_that_is_off_costs_no_search_that_a_watchdog_would_not_wait_for(card, hm2):
    drive = drive_on(card)
    hm2.sserial.start(0x07)
    hm2.sserial.stop()
    drive.alive = False
    began = hm2.now_ns()
    assert hm2.sserial.start(0x01).failed == 0x01
    assert (hm2.now_ns() - began) / 1e6 < 25
    drive.alive = True
    began = hm2.now_ns()
    assert hm2.sserial.start(0x01).failed == 0
    assert (hm2.now_ns() - began) / 1e6 < 10


def test_a_drive_whose_full_scale_could_not_be_read_is_not_started_beside_others(card, hm2, field):
    drive = drive_on(card, 2)
    hm2.sserial.start(0x05)
    hm2.sserial.stop()
    drive.alive = False
    hm2.sserial.start(0x05)
    drive.set_raw("NVMAXCURRENT", 3000)
    drive.power_cycle()
    drive.alive = True
    assert hm2.sserial.start(0x04).failed == 0x04
    hm2.sserial.stop()
    assert hm2.sserial.start(0x05).failed == 0
    assert hm2.sserial.channels[2].outputs.field("current").maximum == 30.0


def test_a_drive_with_another_full_scale_in_its_eeprom_is_not_started_anew_beside_others(card, hm2, field):
    """It may have been powered up again since its start, and its memory cannot be read while others run."""
    drive = drive_on(card, 2)
    hm2.sserial.channels[2].parameters["NVMAXCURRENT"] = 3000
    assert hm2.sserial.start(0x05).failed == 0
    hm2.sserial.stop(0x04)
    drive.power_cycle()
    assert hm2.sserial.start(0x04).failed == 0x04
    hm2.sserial.stop()
    assert hm2.sserial.start(0x05).failed == 0
    assert hm2.sserial.channels[2].outputs.field("current").maximum == 30.0
    hm2.sserial.stop(0x04)
    drive.power_cycle()
    assert hm2.sserial.start(0x04).failed == 0


# -- references


def test_elements_of_before_a_change_are_refused_instead_of_moving_nothing(card, hm2, field):
    hm2.sserial.start(0x01)
    inputs, outputs = hm2.sserial.channels[0].inputs, hm2.sserial.channels[0].outputs
    hm2.sserial.stop()
    card.sserial[0].attach(2, field_io(unit_number=7))
    hm2.sserial.scan()
    hm2.sserial.start(0x05)
    with pytest.raises(NotDiscovered, match="anew"):
        outputs["output"] = 1
    with pytest.raises(NotDiscovered, match="anew"):
        _ = inputs["input"]
    hm2.sserial.channels[0].outputs["output"] = 1
    hm2.sserial.doit()
    assert field.outputs == b"\x01\x00"


# -- faults


def test_a_fault_byte_left_over_from_before_the_start_is_no_live_fault(card, hm2, field):
    hm2.sserial.start(0x01)
    field.fault = RemoteFault.OVER_CURRENT
    hm2.sserial.doit()
    hm2.sserial.stop()
    hm2.sserial.start(0x01)
    status = hm2.sserial.channels[0].status
    assert status.word >> 24 == RemoteFault.OVER_CURRENT
    assert (status.state, status.live, field.fault) == ("chatter", (), 0)
    hm2.sserial.doit()
    assert hm2.sserial.channels[0].status.word == 0x00420000


def test_a_card_started_behind_a_fault_can_be_enabled_at_once(emulated):
    with hostmot2.open(emulated) as board:
        card = board.card("7i77")
        card.start()
        card.exchange()
        emulated.sserial[0].remote(1).fault = RemoteFault.OVER_CURRENT
        card.exchange()
        card.stop()
        card.start()
        card.analog_enable = True
        assert card.analog_enable is True


def test_a_reply_lost_in_a_start_that_was_repeated_does_not_drop_enables_later(emulated):
    with hostmot2.open(emulated) as board:
        card = board.card("7i77")
        card.start()
        card.stop()
        emulated.sserial[0].remote(1).inject(skip=1)
        card.start()
        card.analog_enable = True
        for _ in range(3):
            emulated.advance(500.0)
            card.exchange()
        assert card.analog_enable is True


def test_a_transfer_that_fails_after_a_start_tells_no_fault_of_before(card, hm2):
    drive = drive_on(card)
    hm2.sserial.start(0x01)
    drive.fault_word = 0x0004
    hm2.sserial.doit()
    assert hm2.sserial.doit().faults == ()
    drive.fault_word = 0
    hm2.sserial.stop()
    hm2.sserial.start(0x01)
    drive.inject(skip=2)
    found = [fault for _ in range(2) for fault in hm2.sserial.doit().faults]
    assert found
    assert not any(fault.word_rising for fault in found)


def test_a_drive_whose_fault_was_cleared_takes_a_current_at_once(card, hm2):
    remote = drive_on(card)
    drive = hm2.card("8i20")
    drive.start()
    remote.fault_word = 0x0004
    drive.exchange()
    drive.exchange()
    with pytest.raises(CardFault):
        drive.current = 1.0
    remote.fault_word = 0
    drive.clear_fault()
    drive.current = 1.0
    assert drive.current == 1.0


def test_inputs_are_none_of_before_the_start(card, hm2, field):
    field.inputs = b"\x11\x22\x33\x44"
    hm2.sserial.start(0x01)
    hm2.sserial.doit()
    hm2.sserial.stop()
    hm2.sserial.start(0x01)
    assert hm2.sserial.channels[0].inputs["input"] == 0


# -- tables


def test_a_counter_of_two_parts_that_is_too_wide_stops_no_other_channel():
    with EmulatedBoard("5i25+7i77", clock="virtual") as card:
        for channel in range(card.sserial[0].channels):
            card.sserial[0].detach(channel)
        wide = [element("turns", ENCODER_H, 40, IN), element("fraction", ENCODER_L, 40, IN)]
        card.sserial[0].attach(0, field_io(wide, receive=11, transmit=0))
        card.sserial[0].attach(1, field_io(unit_number=5))
        with hostmot2.open(card) as board:
            assert board.sserial.start(0x03).started & 0x02
            assert board.sserial.doit(0x02).failed == 0


def test_a_remote_that_is_another_one_at_every_start_moves_nothing(card, hm2, field, monkeypatch):
    core = hm2.sserial._core if hm2.sserial.channels else None
    identity, asked = core.identity, []

    def changing(channel):
        asked.append(channel)
        found = identity(channel)
        return type(found)(found.unit_number + len(asked), found.name, found.toc, found.status)

    monkeypatch.setattr(core, "identity", changing)
    result = hm2.sserial.start(0x01)
    assert (result.started, result.failed) == (0, 0x01)


def test_a_start_that_fails_asks_only_for_the_counters_of_its_own_channels(card, hm2, field, monkeypatch):
    hm2.sserial.start(0x01)
    hm2.sserial.doit()
    core = hm2.sserial._core
    read, asked = core.read_local, []
    monkeypatch.setattr(core, "read_local", lambda *at: asked.append(at[0]) or read(*at))
    result = hm2.sserial.start(0x02)
    assert result.failed == 0x02
    assert result.channels[0].counters.timeouts == 20
    assert asked
    assert all(address >= core.block(1) for address in asked)


@pytest.mark.parametrize("wrong", ["limit", "broken"])
def test_tables_read_while_the_line_shows_errors_are_read_again(card, hm2, monkeypatch, wrong):
    """One damaged answer in 256 passes the CRC: here that of a limit, or of a record's type."""
    there = field_io([element("speed", UNSIGNED, 16, OUT, 0, 10, "V", 0x300)], receive=1)
    card.sserial[0].attach(0, there)
    core, real = (hm2.sserial.channels, hm2.sserial._core)[1], {}
    read, spoiled = core.read_table, []

    def read_table(*arguments):
        if not spoiled:
            spoiled.append(True)
            there.inject(skip=1)
            core.read_remote(0, 0x1000, 1)
            real.update({at: there.peek(at) for at in (0x1000, 0x100A)})
            there.poke(*((0x1000, b"\x11") if wrong == "broken" else (0x100A, b"\xa0")))
            status = read(*arguments)
            for at, byte in real.items():
                there.poke(at, byte)
            return status
        return read(*arguments)

    monkeypatch.setattr(core, "read_table", read_table)
    assert hm2.sserial.start(0x01).failed == 0
    assert hm2.sserial.channels[0].outputs.field("speed").maximum == 10.0
    assert hm2.sserial.transfers["starts_repeated"] == 1


def test_tables_of_a_line_that_shows_errors_each_time_are_not_believed(card, hm2, field, monkeypatch):
    _ = hm2.sserial.channels
    monkeypatch.setattr(hm2.sserial._core, "line_errors", lambda channel: 1)
    assert hm2.sserial.start(0x01).failed == 0x01
    with pytest.raises(RemoteSilent, match="damaged while its tables are read, so"):
        _ = hm2.sserial.channels[0].inputs


# -- cards


def test_a_card_that_is_powered_later_is_found(card, hm2):
    from hostmot2.errors import ModuleMissing

    with pytest.raises(ModuleMissing):
        hm2.card("8i20")
    drive_on(card)
    hm2.sserial.scan()
    assert hm2.card("8i20").name == "8I20"


def test_a_fault_of_the_drive_takes_the_current_back(card, hm2):
    remote = drive_on(card)
    drive = hm2.card("8i20")
    drive.start()
    drive.current = 1.0
    drive.exchange()
    remote.fault_word = 0x0004
    drive.exchange()
    drive.exchange()
    assert drive.current == 0.0
    remote.fault_word = 0
    drive.exchange()
    drive.exchange()
    assert remote.get("qsetpoint") == 0
