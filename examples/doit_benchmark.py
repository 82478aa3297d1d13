"""How long one exchange with all smart-serial remotes takes: percentiles, a JSON file, a picture.

    HM2_BOARD=udp://10.10.10.10 python examples/doit_benchmark.py [COUNT]

Without HM2_BOARD an emulated 5I25 with a 7I77, in real time. Outputs of the remotes stay zero. Writes
doit.json, with facts about this computer, and doit.png where matplotlib is installed. `hm2 bench`
measures more.
"""

import json
import os
import sys
import time

import hostmot2
from hostmot2 import host_facts
from hostmot2.histogram import Histogram

PERCENTILES = (0, 50, 99, 99.9, 100)


def measure(hm2: hostmot2.Board, count: int) -> tuple[Histogram, int]:
    """Times in ns, and how many exchanges failed."""
    port = hm2.sserial
    mask = sum(1 << row.channel for row in port.scan() if row.found)
    if not mask:
        sys.exit("no remote answers")
    port.start(mask).raise_for_failed()
    port.doit(mask)  # the first one waits for an exchange that is under way
    times, failed = Histogram(), 0
    for _ in range(count):
        begin = time.perf_counter_ns()
        failed += bool(port.doit(mask).failed)
        times.record(time.perf_counter_ns() - begin)
    return times, failed


def draw(times: Histogram) -> None:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("no picture: pip install 'hostmot2[plot]'")
        return
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xlabel="one DOIT / us", ylabel="exchanges", xscale="log", yscale="log")
    start, width, count = times.buckets()
    axes.bar(start / 1000, count, width=width / 1000, align="edge")
    figure.savefig("doit.png")


def main(count: int = 2000) -> None:
    with hostmot2.open(os.environ.get("HM2_BOARD", "emu://5i25+7i77")) as hm2:
        times, failed = measure(hm2, count)
        url = hm2.url
    found = {f"p{percent:g}": times.percentile(percent) / 1000 for percent in PERCENTILES}
    print(f"{count} exchanges at {url}, {failed} failed, us:", found)
    with open("doit.json", "w") as file:
        json.dump({"card": url, "failed": failed, "us": found, "host": host_facts.facts()}, file, indent=1)
    draw(times)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
