"""What can go wrong with a daughter card."""

from __future__ import annotations

from hostmot2.errors import SserialError


class CardFault(SserialError):
    """A card reports a fault, so its outputs are not switched on."""

    code = "HM2-E130"
    causes = (
        "the drive's own fault: over temperature, over current, bus voltage out of range",
        "its enable input is not driven",
        "its watchdog has bitten because exchanges stopped",
    )
    fix = "Look at the card's fault, remove its cause, then stop() and start() the card."
