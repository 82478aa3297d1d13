"""What commands share that run an engine until they are told to end."""

from __future__ import annotations

import contextlib
import math
import signal
import time
from collections.abc import Callable, Iterator
from typing import Any

import click

from hostmot2.board import Board
from hostmot2.modules.driven import raise_if_driven
from hostmot2.registers import Gtag

PASS_SECONDS = 0.05


def has_sserial(board: Board) -> bool:
    """Whether the card's firmware has smart serial."""
    return any(module.gtag in (Gtag.SSERIAL, Gtag.SSERIAL_B) for module in board.modules)


def start_remotes(board: Board) -> None:
    """Start every remote that answers, its outputs at zero; says on stderr which did not start.

    Raises CardBusy if another program drives the card: it would lose its remotes, and its outputs.
    """
    raise_if_driven(board)
    if not has_sserial(board):
        return
    for port in board.sserial:
        mask = sum(1 << row.channel for row in port.scan() if row.found)
        if mask:
            failed = port.start(mask).failed
            if failed:
                click.echo(f"hm2: {port.label}: channels 0x{failed:02X} did not start", err=True)


@contextlib.contextmanager
def until(board: Board, seconds: float | None) -> Iterator[Callable[[], bool]]:
    """Whether the time (None: no limit) is over or a signal to end has come. ValueError: no finite time."""
    if seconds is not None and not math.isfinite(seconds):
        raise ValueError(f"--seconds {seconds}: leave it out to go on until SIGINT or SIGTERM")
    ended: list[int] = []
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in handlers:
        signal.signal(number, lambda received, _frame: ended.append(received))
    end = None if seconds is None else board.now_ns() + round(seconds * 1e9)
    try:
        yield lambda: bool(ended) or (end is not None and board.now_ns() >= end)
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def watch(
    board: Board, engine: Any, pump: Any, over: Callable[[], bool], passed: Callable[[], None] = lambda: None
) -> None:
    """Let an engine run, its events noted in a recording or live view, until over() or that has failed.

    passed: called now and then.
    """
    while not over() and pump.failure is None:
        if board.virtual_time:  # passes by running cycles
            engine.step()
        else:
            time.sleep(PASS_SECONDS)
        passed()
        for event in engine.events():
            pump.log(str(event), "warning", "engine", event.time_ns)
