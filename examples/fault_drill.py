"""What happens when things go wrong: every message as you would meet it.

    HM2_BOARD=pci:// python examples/fault_drill.py

Without HM2_BOARD on an emulated 5I25 with a 7I77, which can be given every fault. A real card gets what
needs no broken part: a program that falls silent. No output is switched on.
"""

import os

import hostmot2
from hostmot2.emulator import EmulatedBoard


def silent_program(card: object) -> None:
    card.exchange()
    card.board.pause(0.06)  # longer than the watchdog waits
    try:
        card.exchange()
    except hostmot2.HostMot2Error as error:
        print("a silent program:  ", error)
    card.board.watchdog.acknowledge()


def lost_reply(card: object, emulated: EmulatedBoard) -> None:
    emulated.sserial[0].remote(0).inject(skip=1)
    print("a lost reply:      ", card.exchange(), "- the inputs are those of before")
    print("the next exchange: ", card.exchange())


def remote_fault(card: object, emulated: EmulatedBoard) -> None:
    card.analog_enable = True
    emulated.sserial[0].remote(1).fault = 0x08
    card.exchange()
    print("a remote's fault:  ", card.faults(), "- enable dropped:", not card.analog_enable)
    try:
        card.analog_enable = True
    except hostmot2.HostMot2Error as error:
        print("enabling again:    ", error)
    emulated.sserial[0].remote(1).fault = 0
    card.stop()
    card.start()


def absent_remote(card: object, emulated: EmulatedBoard) -> None:
    emulated.sserial[0].remote(0).alive = False
    try:
        card.start()
    except hostmot2.HostMot2Error as error:
        print("an absent remote:  ", error)


def main() -> None:
    url = os.environ.get("HM2_BOARD")
    emulated = None if url else EmulatedBoard("5i25+7i77", clock="virtual")
    with hostmot2.open(url or emulated) as hm2:
        card = hm2.card("7i77")
        card.start()
        if emulated:
            lost_reply(card, emulated)
            remote_fault(card, emulated)
        silent_program(card)
        if emulated:
            card.stop()
            absent_remote(card, emulated)


if __name__ == "__main__":
    main()
