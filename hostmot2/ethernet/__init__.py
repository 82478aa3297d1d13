"""Service of Ethernet cards: who they are, addresses, counters, reset, reload, flash, discovery."""

from hostmot2.ethernet.discovery import Discovery, FoundCard, discover
from hostmot2.ethernet.flash import Flash, FlashInfo
from hostmot2.ethernet.service import CardFacts, EthernetService, PacketCounters, TimeStamps

__all__ = [
    "CardFacts",
    "Discovery",
    "EthernetService",
    "Flash",
    "FlashInfo",
    "FoundCard",
    "PacketCounters",
    "TimeStamps",
    "discover",
]
