"""The cycle allocates nothing: not the driver, not the emulated card, nor Python around them.

The C library's allocator is counted in a process of its own, by a library loaded before it.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
CYCLES = 1000

SCRIPT = """
import ctypes, gc, sys
import hostmot2

count = ctypes.CDLL(None).count_allocations
count.restype = ctypes.c_ulong
with hostmot2.open(sys.argv[1]) as board:
    port = board.sserial
    port.scan()
    assert not port.start(0x03).failed
    step = getattr(port, sys.argv[2])
    gc.disable()
    numbers = list(range(int(sys.argv[3])))
    for _ in ("warm up", "count"):
        before = count()
        for _number in numbers:
            step(0x03)
        spent = count() - before
    bytearray(100_000)
    assert count() - before > spent, "the counter does not count"
    print(spent)
"""


@pytest.fixture(scope="module")
def counter(tmp_path_factory):
    library = tmp_path_factory.mktemp("count") / "count_allocations.so"
    source = ROOT / "tests" / "c" / "count_allocations.c"
    subprocess.run(["gcc", "-std=c11", "-O2", "-shared", "-fPIC", source, "-o", library], check=True)
    return library


@pytest.mark.parametrize("method", ["doit", "doit_pipelined"])
def test_cycle_allocates_nothing(counter, method):
    url = "emu://5i25+7i77?wire=off&clock=virtual"
    command = [sys.executable, "-c", SCRIPT, url, method, str(CYCLES)]
    environment = os.environ | {"LD_PRELOAD": str(counter), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "0"
