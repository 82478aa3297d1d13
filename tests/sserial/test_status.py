"""The CS register in words: every value that the sheets give (sserial.md 3.2, SSLBP observed 1 and 2)."""

import pytest

from hostmot2.registers import ComState, LocalFault, RemoteFault
from hostmot2.sserial import ChannelStatus, FaultWatcher

TYPICAL = [
    # word, state, live, sticky
    (0x0000C100, "stopped", ("no remote identified", "not ready"), ("remote fault",)),
    (0x003A0000, "chatter", (), ()),
    (0x003B0000, "chatter", (), ()),
    (0x00420000, "running", (), ()),
    (0x003C0000, "running", (), ()),
    (0x003D0000, "running", (), ()),
    (0x003E0000, "running", (), ()),
    (0x003F0000, "running", (), ()),
    (0x00400000, "setup", (), ()),
    (0x00422008, "running", (), ("communication error", "timeout")),
    (0x00422088, "running", (), ("communication error", "timeout", "too many errors")),
    (0x00432001, "running", (), ("communication error", "CRC error")),
    (0x00422009, "running", (), ("communication error", "CRC error", "timeout")),
    (0x00432019, "running", (), ("communication error", "CRC error", "timeout", "extra character")),
    (0x00422010, "running", (), ("communication error", "extra character")),
    (0x00422028, "running", (), ("communication error", "timeout", "serial break")),
    (0x04422140, "running", ("over temperature",), ("remote fault", "communication error", "remote fault")),
    (0x00422140, "running", (), ("remote fault", "communication error", "remote fault")),
    (0x01422140, "running", ("watchdog bitten",), ("remote fault", "communication error", "remote fault")),
    (0x20422140, "running", ("low voltage",), ("remote fault", "communication error", "remote fault")),
    (0x003C0100, "running", (), ("remote fault",)),
    (0x003E0100, "running", (), ("remote fault",)),
    (0x003C2108, "running", (), ("remote fault", "communication error", "timeout")),
    (0x003A2088, "dead", (), ("communication error", "timeout", "too many errors")),
    (0x003B2088, "dead", (), ("communication error", "timeout", "too many errors")),
    (0x00402008, "setup", (), ("communication error", "timeout")),
    # a fault byte left over from before the start
    (0x203A0000, "chatter", (), ()),
    (0x0400C100, "stopped", ("no remote identified", "not ready"), ("remote fault",)),
    (
        0x0501E188,
        "absent",
        ("no remote identified", "not ready"),
        ("remote fault", "communication error", "timeout", "too many errors"),
    ),
    # one that was heard in the start
    (
        0x0224A1C0,
        "failed",
        ("not ready", "not enabled"),
        ("remote fault", "communication error", "remote fault", "too many errors"),
    ),
]


@pytest.mark.parametrize(
    ("word", "state", "live", "sticky"), TYPICAL, ids=lambda v: f"{v:08X}" if isinstance(v, int) else ""
)
def test_typical_values(word, state, live, sticky):
    status = ChannelStatus(word)
    assert status.state == state
    assert status.live == live
    assert status.sticky == sticky


@pytest.mark.parametrize("word", [0x0001E188, 0x0002E188, 0x0003E188, 0x0004E188])
def test_an_absent_remote(word):
    status = ChannelStatus(word)
    assert status.state == "absent"
    assert status.not_ready
    assert LocalFault.TIMEOUT in status.local_fault
    assert LocalFault.TOO_MANY_ERRORS in status.local_fault


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x000DE188, "failed"),  # no answer to the unit number
        (0x0224A1C0, "failed"),  # a fault that does not go away
        (0x4024A1C0, "failed"),  # a mode that does not exist
        (0x052DA1C0, "failed"),  # 8I20: fault word at the first check
        (0x0037A1C0, "failed"),  # 8I20: fault word at the second check
        (0x00328100, "starting"),  # 8I20: its enable flag is awaited
        (0x00298100, "starting"),
        (0x001E8100, "starting"),
    ],
)
def test_starts_that_did_not_end(word, state):
    assert ChannelStatus(word).state == state
    assert ChannelStatus(word).not_ready


def test_an_illegal_mode_is_named():
    assert ChannelStatus(0x4024A1C0).remote_fault == RemoteFault.ILLEGAL_MODE
    assert "illegal mode" in str(ChannelStatus(0x4024A1C0))


@pytest.mark.parametrize("code", range(0x44))
def test_every_state_has_a_name(code):
    assert isinstance(ChannelStatus(code << 16).com_state, ComState)


@pytest.mark.parametrize("code", [0x44, 0x80, 0xFF])
def test_an_unknown_state_is_shown_as_it_is(code):
    assert ChannelStatus(code << 16).com_state == code
    assert ChannelStatus(code << 16).state == f"state 0x{code:02X}"


def test_every_bit_of_the_fault_bytes_has_a_word():
    assert len(ChannelStatus(0xFF000000).live) == 8
    assert len(ChannelStatus(0x000000FF).sticky) == 8


def test_a_sticky_fault_is_reported_once_and_a_live_one_each_time():
    watcher = FaultWatcher()
    readings = [0x00420000, 0x04422140, 0x04422140, 0x00422140, 0x04422140, 0x0C422140]
    found = [watcher.update(0, cs) for cs in readings]
    assert [fault and fault.causes for fault in found] == [
        None,
        ("over temperature", "remote fault"),
        None,
        None,
        ("over temperature",),
        ("over current",),
    ]


def test_firmware_that_clears_its_bits_reports_each_fault_anew():
    watcher = FaultWatcher()
    readings = [0x00422008, 0x00420000, 0x00422008]
    assert [bool(watcher.update(0, cs, failed=cs != 0x00420000)) for cs in readings] == [True, False, True]


def test_a_transfer_that_fails_again_is_reported_though_its_bits_are_still_set():
    watcher = FaultWatcher()
    assert watcher.update(0, 0x00422008, failed=True).causes == ("timeout",)
    assert watcher.update(0, 0x00422008, failed=True) is None
    assert watcher.update(0, 0x00422008, failed=False) is None
    again = watcher.update(0, 0x00422008, failed=True)
    assert again.causes == ()
    assert "transfer failed again" in str(again)


def test_every_channel_is_watched():
    watcher = FaultWatcher()
    assert all(watcher.update(channel, 0x01422140) for channel in range(8))
    assert not any(watcher.update(channel, 0x01422140) for channel in range(8))
    watcher.stopped([3])
    assert [c for c in range(8) if watcher.update(c, 0x01422140)] == [3]
