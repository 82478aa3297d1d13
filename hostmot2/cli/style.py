"""Colours, where there is somebody to see them: a terminal, and no NO_COLOR (https://no-color.org)."""

from __future__ import annotations

import os
import sys
from typing import TextIO

import click


def colours(stream: TextIO) -> bool:
    """Whether what goes to `stream` may have colours."""
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def bold_red(text: str) -> str:
    """For the first line of an error, on stderr."""
    return click.style(text, fg="red", bold=True) if colours(sys.stderr) else text
