"""What the manuals say of daughter cards: connectors, jumpers, LEDs, limits. Data only."""

from hostmot2.wiring.card_7i77 import CARD_7I77
from hostmot2.wiring.card_8i20 import CARD_8I20
from hostmot2.wiring.facts import CardFacts, Connector, Jumper, Led, Limit, RemoteFacts, Terminal

WIRING: dict[str, CardFacts] = {card.name: card for card in (CARD_7I77, CARD_8I20)}
"""Cards by name, lower case."""

__all__ = ["WIRING", "CardFacts", "Connector", "Jumper", "Led", "Limit", "RemoteFacts", "Terminal"]
