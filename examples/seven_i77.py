"""A 7I77: who is there, field I/O, one analog axis with its enable, encoders.

    HM2_BOARD=pci:// python examples/seven_i77.py

Without HM2_BOARD an emulated one. On a real card this drives 1 V out of axis 0 with its enable on, for
one second.
"""

import os

import hostmot2


def main() -> None:
    with hostmot2.open(os.environ.get("HM2_BOARD", "emu://5i25+7i77?clock=virtual")) as hm2:
        print(hm2.sserial.scan())
        card = hm2.card("7i77")
        encoder = card.encoders[0]
        encoder.scale = 4000.0  # counts per turn
        card.start()  # outputs zero, enables off, watchdog armed: exchange at least every 50 ms from here on
        card.analog[0].volts = 1.0
        card.analog_enable = True
        card.outputs[3] = True
        for _ in range(1000):
            card.exchange()
            hm2.pause(0.001)  # on the card's clock
        print(f"inputs 0x{int(card.inputs):08X}, axis 0 at {encoder.position:.3f} turns, {card}")
        print(hm2.sserial.channels[1])


if __name__ == "__main__":
    main()
