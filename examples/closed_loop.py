"""Close a position loop on a DC motor and draw the step response.

    HM2_BOARD=pci:// python examples/closed_loop.py [-o step.png]

The loop runs in Python, once a millisecond of the card's time: encoder 0 of a 7I77 in, analog output 0
out. Without HM2_BOARD card and motor are emulated. On a real machine the axis moves by two turns: set
COUNTS to your encoder's, begin with PROPORTIONAL at a tenth, have the emergency stop at hand. It gives
up when the axis runs away.
"""

import argparse
import os

import hostmot2
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.plant import couple_dc_motor

PERIOD = 0.001  # s
COUNTS = 4000.0  # per turn
PROPORTIONAL = 8.0  # V per turn
DAMPING = 0.35  # V per turn/s
INTEGRAL = 10.0  # V per turn s
TARGET = 2.0  # turns
RUNAWAY = 3.0  # turns beside the target


def emulated() -> EmulatedBoard:
    board = EmulatedBoard("5i25+7i77", clock="virtual")
    couple_dc_motor(board)
    return board


def step_response(seconds: float = 1.5) -> tuple[list[float], list[float], list[float]]:
    """Times in s, positions in turns, commands in V."""
    times, positions, volts = [], [], []
    with hostmot2.open(os.environ.get("HM2_BOARD") or emulated()) as hm2:
        card = hm2.card("7i77")
        encoder = card.encoders[0]
        encoder.scale = COUNTS
        card.start()
        card.analog_enable = True
        summed = 0.0
        begin = hm2.now_ns()
        for cycle in range(round(seconds / PERIOD)):
            hm2.pause(begin / 1e9 + (cycle + 1) * PERIOD - hm2.now_ns() / 1e9)
            card.exchange()
            target = TARGET if cycle * PERIOD > 0.1 else 0.0
            error = target - encoder.position
            if abs(error) > RUNAWAY:
                raise SystemExit(
                    f"the axis runs away: {encoder.position:.2f} turns; is the encoder reversed?"
                )
            summed += error * PERIOD if abs(error) < 0.2 else 0.0
            card.analog[0].volts = PROPORTIONAL * error - DAMPING * encoder.velocity + INTEGRAL * summed
            times.append(cycle * PERIOD)
            positions.append(encoder.position)
            volts.append(max(-10.0, min(10.0, card.analog[0].volts)))
    return times, positions, volts


def draw(times: list[float], positions: list[float], volts: list[float], path: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (upper, lower) = pyplot.subplots(2, 1, sharex=True, figsize=(8, 5))
    upper.plot(times, positions, label="position")
    upper.plot(times, [TARGET if t > 0.1 else 0.0 for t in times], "--", label="target")
    upper.set_ylabel("turns")
    upper.legend()
    lower.plot(times, volts, color="tab:orange")
    lower.set_ylabel("command / V")
    lower.set_xlabel("time / s")
    upper.set_title(f"7I77 axis 0, {'' if 'HM2_BOARD' in os.environ else 'emulated '}DC motor, 1 kHz")
    figure.tight_layout()
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", default="step_response.png")
    output = parser.parse_args().output
    times, positions, volts = step_response()
    draw(times, positions, volts, output)
    print(
        f"settled at {positions[-1]:.4f} of {TARGET} turns, highest {max(positions):.4f}; drawn to {output}"
    )


if __name__ == "__main__":
    main()
