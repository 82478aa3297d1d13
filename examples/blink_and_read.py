"""List the free pins, read them, blink an LED and pulse one output.

    HM2_BOARD=udp://10.10.10.10 python examples/blink_and_read.py

Without HM2_BOARD an emulated 5I25 with a 7I77. The output pulsed is the first pin that nobody owns: look
where that is on your card before you run this on a real one.
"""

import os

import hostmot2


def main() -> None:
    with hostmot2.open(os.environ.get("HM2_BOARD", "emu://5i25+7i77?clock=virtual")) as hm2:
        print(f"{hm2.name} at {hm2.url}: {len(hm2.pins)} pins, free for GPIO:")
        for pin in hm2.gpio.free:
            print(f"  {pin} reads {int(pin.level)}")
        for lit in (True, False) * 3:
            hm2.leds[0] = lit
            hm2.pause(0.1)
        if not hm2.gpio.free:
            print("no free pin to pulse")
            return
        pin = hm2.gpio.free[0]
        pin.drive(False)  # arms the watchdog: exchanges must go on, or the card lets go of the pin
        for cycle in range(20):
            pin.set(cycle % 10 < 5)
            hm2.cycle.run()
            hm2.pause(0.01)
        print(f"pulsed {pin}")
    # here the pin has been let go and the watchdog has been made to bite


if __name__ == "__main__":
    main()
