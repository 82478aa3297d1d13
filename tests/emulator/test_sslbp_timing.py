"""How long SSLBP 1.43 takes: the tables of SSLBP observed 2, as measured on the published HDL."""

from __future__ import annotations

import pytest

from tests.emulator.sslbp_host import DOIT, RESET, START, STOP, STOP_ALL, Host

US = pytest.approx
TOLERANCE = 3.0

# ports, answer delay, START 0x903, channel 0 (2 out, 5 in), channel 1 (10 out, 1 in), both, first DOIT
BRINGUP_7I77 = [
    (2, 2, 884, (47.3, 47.3), (61.7, 62.9), (63.3, 63.3), 108),
    (2, 3, 886, (47.3, 47.6), (64.5, 64.9), (65.2, 65.2), 111),
    (2, 10, 1006, (55.9, 55.9), (71.3, 71.6), (70.0, 71.3), 140),
    (3, 2, 896, (47.3, 47.6), (62.3, 63.6), (63.9, 64.2), 111),
    (3, 3, 904, (49.5, 49.5), (63.6, 63.9), (64.2, 64.2), 114),
    (3, 10, 1010, (55.3, 55.6), (71.6, 71.9), (72.9, 73.2), 101),
    (4, 2, 911, (49.5, 49.8), (63.6, 63.9), (62.9, 64.9), 111),
    (4, 3, 918, (49.5, 49.8), (64.2, 66.1), (65.2, 65.2), 118),
    (4, 10, 1035, (56.5, 56.9), (71.3, 72.9), (72.5, 72.9), 105),
    (8, 2, 928, (50.1, 50.5), (65.2, 68.1), (66.1, 69.0), 117),
    (8, 3, 969, (50.8, 54.0), (68.1, 68.1), (69.0, 69.3), 125),
    (8, 10, 1050, (60.7, 61.0), (75.1, 75.1), (73.5, 76.7), 113),
]
LOST = {
    (2, 3): (88.5, 102.3, 101.7),
    (3, 3): (89.2, 105.8, 105.8),
    (4, 3): (88.9, 106.1, 104.9),
    (8, 3): (90.5, 110.9, 112.5),
}


def the_7i77(ports: int, delay: float, processor_clock_hz: int = 100_000_000) -> Host:
    host = Host(ports, processor_clock_hz)
    host.attach(0, unit_number=0x12000001, receive_size=5, transmit_size=2, turnaround_us=delay)
    host.attach(1, unit_number=0x11000001, receive_size=1, transmit_size=10, turnaround_us=delay)
    host.result(STOP_ALL)
    return host


def within(took: float | None, span: tuple[float, float], tolerance: float = TOLERANCE) -> bool:
    assert took is not None
    return span[0] - tolerance <= took <= span[1] + tolerance


@pytest.mark.parametrize(("ports", "delay", "start", "first", "second", "both", "begin"), BRINGUP_7I77)
def test_7i77(
    ports: int,
    delay: float,
    start: float,
    first: tuple[float, float],
    second: tuple[float, float],
    both: tuple[float, float],
    begin: float,
) -> None:
    host = the_7i77(ports, delay)
    # A step of the start is seen a whole pass later if the host's poll shifts the loop by a cycle.
    assert host.command(START | 3) == US(start, abs=TOLERANCE if ports < 8 else 5)
    took = host.command(DOIT | 3)
    assert took is not None
    assert begin - 45 < took < begin + 45, "by phase of the chatter"
    for mask, span in ((1, first), (2, second), (3, both)):
        for _ in range(3):
            took = host.command(DOIT | mask)
            assert within(took, span), (mask, took, span)


@pytest.mark.parametrize(("ports", "delay"), LOST)
def test_7i77_lost_answers(ports: int, delay: float) -> None:
    """By phase of the chatter that was measured: ticks of 2 us, seen by passes of up to 3.6 us."""
    host = the_7i77(ports, delay)
    host.result(START | 3)
    host.result(DOIT | 3)
    for mask, expected in zip((1, 2, 3), LOST[ports, delay], strict=True):
        for channel in range(2):
            if mask >> channel & 1:
                host.port.remote(channel).inject(skip=1)  # type: ignore[union-attr]
        assert host.command(DOIT | mask) == US(expected, abs=5 if ports < 8 else 7.5), mask


def test_7i77_with_a_processor_at_50_mhz() -> None:
    host = the_7i77(4, 3, 50_000_000)
    host.board.advance(50)
    assert host.command(STOP_ALL) == US(123.5, abs=TOLERANCE)
    assert host.command(START | 3) == US(1007, abs=TOLERANCE)
    assert host.command(DOIT | 3) == US(135, abs=45)
    assert within(host.command(DOIT | 1), (54, 58))
    assert within(host.command(DOIT | 2), (68.2, 72.3))
    assert within(host.command(DOIT | 3), (71, 74.7))
    host.port.remote(1).inject(skip=1)  # type: ignore[union-attr]
    assert host.command(DOIT | 2) == US(110, abs=5)
    assert host.command(STOP | 0xFF) == US(11.8, abs=TOLERANCE)
    assert host.local(0x230, 4) == 50_000_000
    host.begin(RESET)
    host.begin(1)
    assert host.finish() == US(43.4, abs=1)


# sserial.md 10: turnaround 0 against a script, "good to about 5 %"
@pytest.mark.parametrize(
    ("transmit", "receive", "times"),
    [
        (2, 5, (45.0, 46.2, 47.1)),
        (2, 9, (61.4, 62.0, 64.5)),
        (2, 12, (72.8, 75.5, 78.3)),
        (10, 1, (59.5, 61.8, 64.2)),
        (12, 13, (118.5, 120, 123.5)),
        (0, 1, (20.6, 21.5, 22.7)),
    ],
)
def test_doit_by_sizes(transmit: int, receive: int, times: tuple[float, float, float]) -> None:
    for ports, expected in zip((2, 4, 8), times, strict=True):
        host = Host(ports)
        host.attach(0, receive_size=receive, transmit_size=transmit, turnaround_us=0.0)
        host.result(STOP_ALL)
        host.result(START | 1)
        host.result(DOIT | 1)
        assert host.command(DOIT | 1) == US(expected, abs=0.05 * expected + 2), ports


def test_local_access_takes_a_microsecond_or_four() -> None:
    host = the_7i77(4, 3)
    host.board.advance(50)
    idle = [host.command(0x2003) or 0 for _ in range(20)]
    host.result(START | 3)
    busy = [host.command(0x2003) or 0 for _ in range(20)]
    assert min(idle) > 0.4
    assert max(idle) < 2.5
    assert max(busy) < 4


def test_skipped_spans_change_nothing() -> None:
    """Advanced in one step or in thousands: the same bytes at the same times, the same registers."""
    seen = []
    for step in (0.37, 13.0, 6000.0):
        host = the_7i77(4, 3)
        host.begin(START | 7)
        begin = host.board.now_us
        bytes_seen = []
        while host.board.now_us < begin + 6000.0:
            host.board.advance(min(step, begin + 6000.0 - host.board.now_us))
            bytes_seen += host.port.take_line_bytes()
        registers = [host.read(0x5A00 + 0x100 * n, c) for n in range(2, 6) for c in range(4)]
        seen.append((sorted(bytes_seen, key=lambda b: (b.start_us, b.channel)), registers))
    assert len(seen[0][0]) > 1000
    assert seen[0] == seen[1] == seen[2]
