"""Cycles of an engine in virtual time."""

from __future__ import annotations

from typing import Any


def run(engine: Any, cycles: int, write: bool = True) -> Any:
    """So many cycles, each with outputs refreshed if `write`; the last frame."""
    frame = None
    for _ in range(cycles):
        if write:
            engine.write()
        frame = engine.step()
    return frame
