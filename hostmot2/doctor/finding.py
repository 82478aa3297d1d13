"""One thing that was looked at."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any


class Verdict(Enum):
    """What a finding means for a cycle."""

    BLOCKS = "blocks"
    """Nothing works until this is changed."""
    IMPROVE = "improve"
    """A change here probably helps."""
    GOOD = "good"
    UNKNOWN = "unknown"
    """It could not be read, and why is in `seen`."""


@dataclass(frozen=True)
class Finding:
    """name: what was looked at. seen: what was there. advice: what to do, "" for nothing. trial: a KEY=VALUE
    that `hm2 doctor --ab` can try, "" for none."""

    name: str
    verdict: Verdict
    seen: str
    advice: str = ""
    trial: str = ""

    def as_json(self) -> dict[str, Any]:
        """As JSON takes it."""
        return asdict(self) | {"verdict": self.verdict.value}
