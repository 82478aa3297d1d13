"""Hold an axis on a moving command for a while, in real time, with every cycle on file.

    python examples/record_closed_loop.py [--seconds 60] [-o run.mcap] [--plot run.png]

The loop runs in the engine's thread at 1 kHz: encoder in, PID with feed-forward, analog volts out. Python
moves the command; when it is late, the loop holds the last one. The motor is the emulator's, on axis 0.
"""

import argparse
import math

import hostmot2
from hostmot2 import recording
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.plant import couple_dc_motor

RATE = 1000
COUNTS_PER_TURN = 4000.0
GAINS = {"p": 40.0, "i": 60.0, "d": 0.6, "ff1": 0.021, "max_output": 10.0, "max_error": 1.0}
COLUMNS = [
    "encoder0.position",
    "x.position",
    "encoder0.velocity",
    "sserial0.1.AnalogOut0",
    "wake_us",
    "total_us",
]


def command(seconds: float) -> tuple[float, float]:
    """Position in turns and velocity in turns/s: a slow wave with a faster one on it, from rest."""
    position = velocity = 0.0
    for turns, hertz in ((2.0, 0.1), (0.25, 0.7)):
        angle = 2 * math.pi * hertz * seconds
        position += turns * (1 - math.cos(angle)) / 2
        velocity += turns * math.pi * hertz * math.sin(angle)
    return position, velocity


def run(seconds: float, path: str) -> None:
    emulated = EmulatedBoard("5i25+7i77")
    couple_dc_motor(emulated)
    with hostmot2.open(emulated) as hm2:
        hm2.watchdog.timeout = 0.2
        card = hm2.card("7i77")
        card.start()
        card.encoders[0].scale = COUNTS_PER_TURN
        engine = hm2.engine(RATE, real_time=True, dead_man=0.5)
        axis = engine.add_pid(
            "x", feedback="encoder0.position", output="analogout0", velocity_command=True, **GAINS
        )
        with recording.record(engine, path, json_rate=100) as recorder, engine:
            card.analog_enable = True
            for frame in engine.frames(seconds):
                axis.position, axis.velocity = command(frame.cycle / RATE)
                for event in engine.events():
                    recorder.log(str(event), time_ns=event.time_ns)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("-o", "--output", default="run.mcap")
    parser.add_argument("--plot", default="run.png")
    options = parser.parse_args()
    run(options.seconds, options.output)
    found = recording.read(options.output)
    error = abs(found["x.position"] - found["encoder0.position"])
    recording.plot(found, options.plot, COLUMNS)
    print(
        f"{len(found.records)} cycles, {found.dropped} dropped, {len(found.gaps)} gaps; "
        f"following error at most {error.max():.3f} turns; drawn to {options.plot}"
    )


if __name__ == "__main__":
    main()
