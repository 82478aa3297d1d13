"""A monitor's source on a card, for the time of a with block."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import hostmot2
from hostmot2.emulator import EmulatedBoard
from hostmot2.monitor import Source


@contextmanager
def started_source(card: EmulatedBoard, **options: Any) -> Iterator[Source]:
    """All remotes run, outputs may be armed."""
    with hostmot2.open(card) as board:
        source = Source(board, start={}, allow_write=True, **options)
        source.start()
        yield source
        source.close()
