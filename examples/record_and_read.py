"""Record a second of cycles, read them back as numpy columns, and draw them.

    HM2_BOARD=udp://10.10.10.10 python examples/record_and_read.py [FILE.mcap]

Without HM2_BOARD an emulated 5I25 with a 7I77. Outputs of the 7I77 follow a slow wave of 1 V while its
analog outputs are not enabled, so nothing moves. Needs `pip install 'hostmot2[record,plot]'`.
"""

import math
import os
import sys

import hostmot2
from hostmot2 import recording

RATE = 500


def main(path: str = "run.mcap") -> None:
    with hostmot2.open(os.environ.get("HM2_BOARD", "emu://5i25+7i77")) as hm2:
        hm2.sserial.start(0x03).raise_for_failed()
        engine = hm2.engine(RATE)
        with recording.record(engine, path) as recorder, engine:
            for frame in engine.frames(seconds=1.0):
                engine.outputs["analogout0"] = math.sin(2 * math.pi * frame.cycle / RATE)
    print(f"{path}: {recorder.counters}")

    run = recording.read(path)
    print(run)
    volts = run["sserial0.1.AnalogOut0"]
    print(f"analogout0 went from {volts.min():.2f} to {volts.max():.2f} V")
    print(f"the slowest cycle took {run['total_us'].max():.1f} us")
    recording.plot(run, "run.png", ["sserial0.1.AnalogOut0", "total_us"])
    print("drawn in run.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
