"""An 8I20: torque command with commutation from an encoder.

    HM2_BOARD=pci:// python examples/torque_8i20.py

Without HM2_BOARD drive and permanent-magnet motor are emulated. With it: the 8I20 of that card; the
motor turns with 0.2 A, and POLE_PAIRS, COUNTS and ZERO must be those of your motor, or it will only
twitch.
"""

import os

import hostmot2
from hostmot2.emulator import EmulatedBoard, catalog
from hostmot2.emulator.plant import couple_pm_motor

POLE_PAIRS = 4
COUNTS = 4000  # encoder counts per turn
ZERO = 0.0  # electrical angle, in turns, where the encoder reads 0
AMPERES = 0.2


def emulated() -> EmulatedBoard:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    board.sserial[0].attach(2, catalog.remote("8i20"), through_pins=True)
    couple_pm_motor(board, channel=2)
    return board


def main() -> None:
    with hostmot2.open(os.environ.get("HM2_BOARD") or emulated()) as hm2:
        drive, encoder = hm2.card("8i20"), hm2.encoders[0]
        encoder.scale = COUNTS
        drive.start()
        print(drive)
        drive.current = AMPERES
        for cycle in range(2000):
            drive.exchange()
            drive.angle = encoder.position * POLE_PAIRS + ZERO
            hm2.pause(0.0002)
            if cycle % 500 == 0:
                print(f"{encoder.position:8.3f} turns  {encoder.velocity:8.2f} turns/s  {drive}")
        drive.current = 0.0
        drive.exchange()


if __name__ == "__main__":
    main()
