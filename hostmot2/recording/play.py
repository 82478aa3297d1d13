"""A recording at the pace it was made, into whatever takes numbers by name."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Callable, Mapping

from hostmot2.recording.recording import Recording

_ELEMENT = re.compile(r"sserial\d+\.\d+\.(\w+)")
_ENCODER = re.compile(r"encoder(\d+)\.raw_count")


def emulator_keys(recording: Recording) -> dict[str, str]:
    """Key of `hm2 emu` -> column, for what a machine tells its host: remotes' inputs, encoder positions.

    The second remote with an element of the same name is taken for the second daughter card's.
    """
    keys: dict[str, str] = {}
    cards: Counter[str] = Counter()
    inputs = {signal.name for signal in recording.inputs} | recording.input_elements
    for name in recording:
        if found := _ENCODER.fullmatch(name):
            keys[f"encoder{found[1]}_position"] = name
        elif name in inputs and (found := _ELEMENT.fullmatch(name)):
            element = found[1].lower()
            keys[f"{cards[element]}.{element}" if cards[element] else element] = name
            cards[element] += 1
    return keys


def play(
    recording: Recording,
    keys: Mapping[str, str],
    set_value: Callable[[str, float], None],
    *,
    speed: float = 1.0,
    sleep: Callable[[float], None] = time.sleep,
    clock: Callable[[], float] = time.monotonic,
) -> dict[str, str]:
    """Calls set_value(key, value) whenever a column changes, at the recorded times divided by `speed`.

    speed 0: without waiting. A key whose first value is refused with ValueError or KeyError is left out; the
    result says why, by key.
    """
    refused: dict[str, str] = {}
    columns = {key: recording[name] for key, name in keys.items()}
    last: dict[str, float] = {}
    begin = clock()
    for index, at in enumerate(recording.seconds.tolist()):
        if speed > 0 and (wait := begin + at / speed - clock()) > 0:
            sleep(wait)
        for key, column in columns.items():
            value = float(column[index])
            if key in refused or last.get(key) == value:
                continue
            try:
                set_value(key, value)
            except (ValueError, KeyError) as problem:
                if key in last:
                    raise
                refused[key] = str(problem)
            last[key] = value
    return refused
