"""The help page of the view."""

from __future__ import annotations

_KEYS = """\
1 to 5, tab  panel          up, down  line
/            filter: only lines with these letters; esc ends it
e, enter     explain the selected channel's CS word or event
space        hold the picture; everything goes on behind it
r            begin or end a recording: hm2-monitor-DATE-TIME.mcap
w            arm outputs, or turn them off
?            this page      q  quit

Top line     how the card may be used, cycle rate, watchdog, recording
Second line  p99: what 99 of 100 replies of the card and cycles (from
             when they are due to their end) do not exceed; the curve
             is the p99 of the cycles of each half second. `lost`
             exchanges did not come back, `late` cycles ended too late
Channels     what is wrong now, what has been since the start, and what
             the card's firmware has counted (it stops at 20)
Analog, Bits → goes to the remote, ← comes from it
"""

_LOOKING = """
READ-ONLY: nothing is written to the card, now or when you leave;
another program may drive it meanwhile. Encoders and watchdog are shown
as that program has set them up. Remotes' process data needs --start,
which takes the card over.
"""

_DRIVING = """
OUTPUTS OFF: the monitor has started the remotes, all outputs at zero,
and feeds the watchdog. With --allow-write w arms the outputs, after a
question.
"""

_ARMED = """
Once they are armed, enter on a line with → sets an output. Outputs go
off with w, when a remote reports a fault, when exchanges fail, when
this view hangs for a second, and however the program ends.
"""


def help_text(driving: bool, allowed: bool) -> str:
    """All keys, and what the present way of looking means."""
    if not driving:
        return _KEYS + _LOOKING
    return _KEYS + _DRIVING + (_ARMED if allowed else "")
