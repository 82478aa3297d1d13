"""What an engine can be told, as the core takes it; and what the system refused."""

from __future__ import annotations

import os
import warnings
from typing import TYPE_CHECKING, Any, Literal, TypedDict

from hostmot2._core import ffi, lib
from hostmot2.board import LONGEST_SECONDS
from hostmot2.idrom import HostMot2Warning

if TYPE_CHECKING:
    from hostmot2.board import Board

Style = Literal["auto", "pipelined", "read-modify-write"]
Overrun = Literal["skip", "catch-up"]

PRIORITY = 60
"""SCHED_FIFO priority of real_time=True."""
EARLY = 60e-6
LONGEST_REPLY_NS = 20_000_000  # below the time after which a bus repeats by itself
PIPELINED_RATE = 1600.0
"""Hz: in one exchange a DOIT must be over before the next, which takes 0.6 ms to be sure of."""

_STYLES = {"pipelined": lib.HM2_ENGINE_PIPELINED, "read-modify-write": lib.HM2_ENGINE_READ_MODIFY_WRITE}
_OVERRUNS = {"skip": lib.HM2_OVERRUN_SKIP, "catch-up": lib.HM2_OVERRUN_CATCH_UP}


class Options(TypedDict, total=False):
    """What may be told, as keywords; see Engine for the meaning and the defaults."""

    style: Style
    dead_man: float
    stale_limit: int
    overrun: Overrun
    overrun_limit: int
    fault_bucket: tuple[int, int, int]
    reply_timeout: float | None
    real_time: bool | int
    cpu: int | None
    early: float


class RealTimeWarning(HostMot2Warning):
    """The system did not grant what a real-time loop needs; the engine runs without."""


def new_config(
    board: Board,
    rate: float,
    *,
    style: Style = "auto",
    dead_man: float = 0.1,
    stale_limit: int = 5,
    overrun: Overrun = "skip",
    overrun_limit: int = 0,
    fault_bucket: tuple[int, int, int] = (10, 1, 200),
    reply_timeout: float | None = None,
    real_time: bool | int = False,
    cpu: int | None = None,
    early: float = EARLY,
) -> Any:
    """The `hm2_engine_config *`; see Engine for the meaning. Raises ValueError."""
    if not 1e-3 <= rate <= 20000:
        raise ValueError(f"rate {rate} Hz is outside 0.001..20000 Hz")
    if overrun not in _OVERRUNS:
        raise ValueError(f"overrun is 'skip' or 'catch-up', not {overrun!r}")
    if not (0 <= dead_man <= LONGEST_SECONDS and 0 <= early <= LONGEST_SECONDS):
        raise ValueError(f"dead_man and early are seconds, 0 to {LONGEST_SECONDS:g}")
    if reply_timeout is not None and not 0 < reply_timeout <= LONGEST_SECONDS:
        raise ValueError(f"reply_timeout is seconds above 0, to {LONGEST_SECONDS:g}")
    if min(stale_limit, overrun_limit, *fault_bucket) < 0 or len(fault_bucket) != 3:
        raise ValueError("stale_limit, overrun_limit and the three numbers of fault_bucket are at least 0")
    config: Any = ffi.new("hm2_engine_config *")
    lib.hm2_engine_defaults(config)
    config.period_ns = round(1e9 / rate)
    config.reply_ns = min(config.period_ns * 4 // 5, LONGEST_REPLY_NS)
    if reply_timeout is not None:
        config.reply_ns = round(reply_timeout * 1e9)
    config.dead_man_ns, config.early_ns = round(dead_man * 1e9), round(early * 1e9)
    config.stale_limit, config.overrun_limit = stale_limit, overrun_limit
    config.overrun = _OVERRUNS[overrun]
    config.fault_increment, config.fault_decrement, config.fault_limit = fault_bucket
    config.virtual_time = board.virtual_time
    config.style = _style(board, style, rate)
    config.cpu = -1 if cpu is None else cpu
    if real_time:
        config.priority = PRIORITY if real_time is True else int(real_time)
        config.lock_memory = 1
    return config


def _style(board: Board, style: str, rate: float) -> int:
    if style == "auto":
        pipelined = board.url.startswith("udp:") and rate <= PIPELINED_RATE
        style = "pipelined" if pipelined else "read-modify-write"
    if style not in _STYLES:
        raise ValueError(f"style is 'auto', 'pipelined' or 'read-modify-write', not {style!r}")
    return int(_STYLES[style])


def warn_of(refusals: Any, cpu: int) -> None:
    """A RealTimeWarning for each thing that was refused (`hm2_engine_refusals *`)."""
    names = {"priority": "SCHED_FIFO", "cpu": f"processor {cpu}", "lock_memory": "mlockall"}
    for name, what in names.items():
        if problem := getattr(refusals, name):
            warnings.warn(
                f"{what} was refused ({os.strerror(problem)}): the loop runs, with more jitter. "
                "`hm2 setup rt` prints what the system needs",
                RealTimeWarning,
                stacklevel=5,
            )
