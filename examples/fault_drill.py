"""What happens when things go wrong, on an emulated card: every message as you would meet it.

python examples/fault_drill.py
"""

import hostmot2
from hostmot2.emulator import EmulatedBoard


def lost_replies(card: object, emulated: EmulatedBoard) -> None:
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


def silent_host(card: object, emulated: EmulatedBoard) -> None:
    card.exchange()
    emulated.advance(60_000.0)  # 60 ms without an exchange
    try:
        card.exchange()
    except hostmot2.HostMot2Error as error:
        print("a silent host:     ", error)
    card.board.watchdog.acknowledge()


def absent_remote(card: object, emulated: EmulatedBoard) -> None:
    emulated.sserial[0].remote(0).alive = False
    try:
        card.start()
    except hostmot2.HostMot2Error as error:
        print("an absent remote:  ", error)


def main() -> None:
    emulated = EmulatedBoard("5i25+7i77", clock="virtual")
    with hostmot2.open(emulated) as hm2:
        card = hm2.card("7i77")
        card.start()
        for drill in (lost_replies, remote_fault, silent_host, absent_remote):
            drill(card, emulated)


if __name__ == "__main__":
    main()
