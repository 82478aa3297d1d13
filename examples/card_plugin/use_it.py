"""The 7I84 of the plug-in beside this file, once that is installed: `pip install examples/card_plugin`.

    HM2_BOARD=pci:// python examples/card_plugin/use_it.py

Without HM2_BOARD an emulated 7I84 on the RS-422 terminals of an emulated 7I77.
"""

import os

import hostmot2
from hostmot2.emulator import EmulatedBoard, catalog


def emulated() -> EmulatedBoard:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    board.sserial[0].attach(2, catalog.remote("7i84"), through_pins=True)
    return board


def main() -> None:
    with hostmot2.open(os.environ.get("HM2_BOARD") or emulated()) as hm2:
        card = hm2.card("7i84")
        card.start()
        card.outputs[5] = True
        for _ in range(10):
            card.exchange()
            hm2.pause(0.001)
        print(f"{card.name} on channels {card.channel_numbers}: inputs 0x{int(card.inputs):08X}")


if __name__ == "__main__":
    main()
