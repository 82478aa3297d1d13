"""What a step is on each layer, which faults there are at it, and why some make no sense there."""

from __future__ import annotations

import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from hostmot2._core import lib

NAMES = (
    "lost",
    "late",
    "duplicated",
    "corrupted",
    "short",
    "long",
    "absent remote",
    "remote fault",
    "stuck command",
    "watchdog bite",
    "user exception",
)
"""The faults, in the order of the tables."""

MS = 1_000_000
US = 1_000
USER_SIGNAL = signal.SIGUSR1


@dataclass(frozen=True)
class Variant:
    """One way in which a fault happens. `act` is called with the world when the step is reached."""

    fault: str
    how: str
    kind: int = lib.HM2_FAULT_NONE
    value: int = 0
    repeat: int = 0
    unseen: bool = False
    """Nobody could tell: a value so spoilt is no value made up by the driver."""
    lasting: bool = False
    """It is still there when the operation ends."""
    act: Callable[[Any], None] | None = None

    def at(self, step: int, world: Any) -> dict[str, Any]:
        """The fault at a step of this world, as Faults.plan() takes it."""
        plan: dict[str, Any] = {
            "step": step,
            "kind": self.kind,
            "value": self.value,
            "repeat": self.repeat,
        }
        if self.act is not None:
            act = self.act
            plan["act"] = lambda: act(world)
        return plan

    def __str__(self) -> str:
        return f"{self.fault} ({self.how})" if self.how else self.fault


@dataclass(frozen=True)
class Layer:
    """Steps of one kind. `source`: which counter of a world counts them."""

    name: str
    step: str
    asked: str
    """What Operation.layers calls it."""
    world: str
    source: Callable[[Any], Any]
    variants: tuple[Variant, ...]
    reasons: dict[str, str] = field(default_factory=dict)
    """Faults that make no sense here, and why."""

    def __post_init__(self) -> None:
        there = {variant.fault for variant in self.variants} | set(self.reasons)
        assert there == set(NAMES), f"{self.name}: {set(NAMES) ^ there}"


MACHINE = (
    Variant("absent remote", "unplugged", act=lambda world: world.unplug(), lasting=True),
    Variant("remote fault", "reported", act=lambda world: world.fail(), lasting=True),
)
BITE = Variant("watchdog bite", "", act=lambda world: world.bite(), lasting=True)
USER = Variant("user exception", "", lib.HM2_FAULT_SIGNAL, USER_SIGNAL)

WORDS = Layer(
    "register accesses",
    "a word read or written over a bus",
    "words",
    "words",
    lambda world: world.faults,
    (
        Variant("lost", "not carried out", lib.HM2_FAULT_LOST),
        Variant("lost", "carried out, the answer lost", lib.HM2_FAULT_ANSWER_LOST),
        Variant("late", "by 10 ms", lib.HM2_FAULT_LATE, 10 * MS),
        Variant("duplicated", "", lib.HM2_FAULT_TWICE),
        Variant("corrupted", "a bit flipped, a write refused", lib.HM2_FAULT_CORRUPT, 1, unseen=True),
        Variant(
            "corrupted", "a high bit flipped, a write refused", lib.HM2_FAULT_CORRUPT, 1 << 17, unseen=True
        ),
        Variant("short", "the answer was cut", lib.HM2_FAULT_SHORT),
        *MACHINE,
        Variant(
            "stuck command", "until aborted", lib.HM2_FAULT_STUCK, lib.HM2_STUCK_UNTIL_UNJAM, lasting=True
        ),
        Variant("stuck command", "until reset", lib.HM2_FAULT_STUCK, lib.HM2_STUCK_UNTIL_RESET, lasting=True),
        Variant("stuck command", "for good", lib.HM2_FAULT_STUCK, lib.HM2_STUCK_FOR_GOOD, lasting=True),
        BITE,
        USER,
    ),
    {"long": "a word has 32 bits: there is no longer one"},
)

DATAGRAMS = Layer(
    "datagrams",
    "a datagram, to the card or from it",
    "datagrams",
    "datagrams",
    lambda world: world.faults,
    (
        Variant("lost", "once", lib.HM2_FAULT_LOST),
        Variant("lost", "and all behind it", lib.HM2_FAULT_LOST, repeat=-1, lasting=True),
        Variant("late", "by 1 ms", lib.HM2_FAULT_LATE, 1 * MS),
        Variant("late", "by 30 ms, behind its repetition", lib.HM2_FAULT_LATE, 30 * MS),
        Variant("duplicated", "at once", lib.HM2_FAULT_TWICE),
        Variant("duplicated", "3 ms later", lib.HM2_FAULT_TWICE, 3 * MS),
        Variant("duplicated", "30 ms later", lib.HM2_FAULT_TWICE, 30 * MS),
        Variant("corrupted", "in its number", lib.HM2_FAULT_CORRUPT, 2),
        Variant("short", "by 4 bytes", lib.HM2_FAULT_SHORT, 4),
        Variant("long", "by 4 bytes", lib.HM2_FAULT_LONG, 4),
        *MACHINE,
        BITE,
        USER,
    ),
    {"stuck command": "the mailbox behind the datagrams is the one of the register accesses"},
)

# what a remote sends, to the firmware or to a client, has the same frame
LBP_LOST = (
    Variant("lost", "", lib.HM2_FAULT_LOST),
    Variant("lost", "and all behind it", lib.HM2_FAULT_LOST, repeat=-1, lasting=True),
)
LBP_DAMAGED = (
    Variant("duplicated", "", lib.HM2_FAULT_TWICE),
    Variant("corrupted", "wrong CRC", lib.HM2_FAULT_CORRUPT),
    Variant("corrupted", "no stop bit", lib.HM2_FAULT_BREAK),
    Variant("short", "by 1 byte", lib.HM2_FAULT_SHORT, 1),
    Variant("long", "by 1 byte", lib.HM2_FAULT_LONG, 1),
)

ANSWERS = Layer(
    "LBP answers",
    "an answer of a remote to the card's firmware",
    "answers",
    "words",
    lambda world: None,  # see runs.py: each remote in turn
    (
        *LBP_LOST,
        Variant("late", "by 20 us", lib.HM2_FAULT_LATE, 20 * US),
        Variant("late", "by 1 ms", lib.HM2_FAULT_LATE, 1 * MS),
        *LBP_DAMAGED,
        *MACHINE,
        Variant("stuck command", "the remote stays busy", act=lambda world: world.hang(), lasting=True),
        USER,
    ),
    {"watchdog bite": "the card's watchdog looks at accesses: see there"},
)

REPLIES = Layer(
    "replies on a serial line",
    "an answer of a remote to the LBP client behind a serial adapter",
    "adapter",
    "adapter",
    lambda world: world.faults,
    (
        *LBP_LOST,
        Variant("late", "by 1 ms", lib.HM2_FAULT_LATE, 1 * MS),
        Variant("late", "by 150 ms, when nobody waits any more", lib.HM2_FAULT_LATE, 150 * MS),
        *LBP_DAMAGED,
        *MACHINE,
        USER,
    ),
    {
        "stuck command": "there is no card's firmware in between",
        "watchdog bite": "there is no card in between",
    },
)

NO_WAY = "the user's own code is on no way to the card"
STATEMENTS = Layer(
    "the user's statements",
    "a statement within a loop of cycles, an engine's loop or a with block",
    "code",
    "words",
    lambda world: world.statements,
    (Variant("user exception", "raised there"),),
    {name: NO_WAY for name in NAMES if name != "user exception"},
)

LAYERS = (WORDS, DATAGRAMS, ANSWERS, REPLIES, STATEMENTS)
