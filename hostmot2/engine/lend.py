"""A smart-serial port taken out of a running engine for a moment."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from hostmot2._core import lib
from hostmot2.errors import EngineError

if TYPE_CHECKING:
    from hostmot2.engine.engine import Engine
    from hostmot2.sserial import SserialPort

PATIENCE_SECONDS = 0.1
STEPS = 10
"""Cycles on a card with virtual time; two are needed."""


@contextmanager
def lend(engine: Engine, port: SserialPort) -> Iterator[None]:
    """See Engine.lend."""
    number = next((n for n, data in enumerate(engine._ports) if data.port is port), -1)
    with engine.board.lock:  # whoever stops the engine needs it, and waits until the port is back
        _take(engine, number)
        engine._lent.add(number)
        try:
            yield
        finally:
            take_back(engine, number)


def take_back(engine: Engine, number: int) -> None:
    """Once only: whoever stops the engine while a port is lent, in the same thread, was first."""
    if number in engine._lent:
        engine._lent.remove(number)
        lib.hm2_engine_port_back(engine.handle, number)


def _take(engine: Engine, number: int) -> None:
    if not engine.running or number < 0:
        raise EngineError(f"{engine.board.name}: no running engine has that port to lend")
    tries, end = 0, time.monotonic() + PATIENCE_SECONDS
    while not lib.hm2_engine_lend_port(engine.handle, number, 1):
        over = tries == STEPS if engine.board.virtual_time else time.monotonic() > end
        if over:
            if lib.hm2_engine_lend_port(engine.handle, number, 0):
                return
            raise EngineError(
                f"{engine._ports[number].port.label}: not lent within {PATIENCE_SECONDS:g} s: its exchanges "
                "fail, or it was given up"
            )
        tries += 1
        if engine.board.virtual_time:
            engine.step()
        else:
            time.sleep(1 / engine.rate)
