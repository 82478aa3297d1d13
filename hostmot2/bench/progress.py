"""What a benchmark is at, for those who wait: lines on stderr, silent when piped."""

from __future__ import annotations

import sys


def say(text: str) -> None:
    """A line about what begins now. A moving bar would take the processor from what is measured."""
    if sys.stderr.isatty():
        print(f"hm2: {text}", file=sys.stderr, flush=True)
