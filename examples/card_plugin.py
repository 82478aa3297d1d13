"""A card model of your own: two numbers, an entry point, and it answers to `hm2.card("7i84")`.

In your package's pyproject.toml:

    [project.entry-points."hostmot2.cards"]
    7i84 = "my_package.card_7i84:find"

Here it is used without being installed.
"""

import hostmot2
from hostmot2.board import Board
from hostmot2.cards.remote_card import RemoteCard, identified
from hostmot2.emulator import EmulatedBoard, catalog


class Card7i84(RemoteCard):
    """A 7I84: 32 inputs, 16 outputs."""

    name = "7I84"

    @property
    def inputs(self) -> object:
        return self.channels[0].inputs["input"]

    @property
    def outputs(self) -> object:
        return self.channels[0].outputs["output"]


def find(board: Board) -> list[Card7i84]:
    """All 7I84 of a board, by the name their remotes give."""
    return [
        Card7i84(board, port, (channel.number,))
        for port in board.sserial
        for channel in identified(port)
        if channel.name == "7I84"
    ]


def main() -> None:
    emulated = EmulatedBoard("5i25+7i77", clock="virtual")
    emulated.sserial[0].attach(2, catalog.remote("7i84"), through_pins=True)
    with hostmot2.open(emulated) as board:
        (card,) = find(board)
        card.start()
        card.outputs[5] = True
        card.exchange()
        card.exchange()
        print(f"output 5 at the remote: {emulated.sserial[0].remote(2).get('output'):#06x}")


if __name__ == "__main__":
    main()
