"""The doctor on a real network of its own: two namespaces, a veth pair, an emulated card at the far end."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
HM2 = "from hostmot2.cli import main; main()"

FAR = """
import sys
from pyroute2 import IPRoute
with IPRoute() as route:
    (index,) = route.link_lookup(ifname="v1")
    route.addr("add", index=index, address="10.10.10.10", prefixlen=24)
    route.link("set", index=index, state="up")
from hostmot2.cli import main
main(["emulate", "7i92+7i77", "--listen", "10.10.10.10"])
"""

NEAR = """
import os, subprocess, sys, time
from pyroute2 import IPRoute

far_end = subprocess.Popen(["unshare", "-n", "sleep", "120"])
own = os.readlink("/proc/self/ns/net")
while os.readlink(f"/proc/{far_end.pid}/ns/net") == own:
    time.sleep(0.01)
with IPRoute() as route:
    route.link("add", ifname="v0", kind="veth", peer={"ifname": "v1", "net_ns_pid": far_end.pid})
    (index,) = route.link_lookup(ifname="v0")
    route.addr("add", index=index, address="10.10.10.11", prefixlen=24)
    route.link("set", index=index, state="up")
    (lo,) = route.link_lookup(ifname="lo")
    route.link("set", index=lo, state="up")
inside = ["nsenter", "-t", str(far_end.pid), "-n"]
card = subprocess.Popen([*inside, sys.executable, "-c", sys.argv[1]], stdout=subprocess.PIPE, text=True)
try:
    assert card.stdout.readline().startswith("ready")
    subprocess.run([sys.executable, "-c", sys.argv[2], *sys.argv[3:]], check=False, timeout=60)
finally:
    card.terminate()
    card.wait()
    far_end.kill()
    far_end.wait()
"""


def in_namespace(*arguments: str) -> dict[str, object]:
    """`hm2 --json ARGUMENTS` in a namespace with v0, 10.10.10.11, and a card at 10.10.10.10 behind it."""
    if os.geteuid() != 0 or not shutil.which("unshare") or not shutil.which("nsenter"):
        pytest.skip("LEFT OUT: network namespaces need root, unshare and nsenter")
    command = ["unshare", "-n", sys.executable, "-c", NEAR, FAR, HM2, "--json", *arguments]
    env = {k: v for k, v in os.environ.items() if k != "HM2_BOARD"} | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False, env=env)
    if "Operation not permitted" in done.stderr and not done.stdout:
        pytest.skip(f"LEFT OUT: no network namespaces here: {done.stderr.strip().splitlines()[-1]}")
    assert done.stdout, done.stderr
    found: dict[str, object] = json.loads(done.stdout)
    return found


def test_a_card_behind_an_interface_is_found_and_its_round_trips_are_measured() -> None:
    found = in_namespace("doctor", "v0", "--count", "200")
    assert found["target"]["host"] == "10.10.10.10"  # type: ignore[index]
    lateness, trips = found["measured"]  # type: ignore[misc]
    assert lateness["count"] == 200
    assert trips["count"] + trips["lost"] == 200
    assert trips["count"] > 100
    by_name = {each["name"]: each for each in found["findings"]}  # type: ignore[attr-defined]
    assert by_name["route to the card"]["verdict"] == "good"
    assert "virtual (veth)" in by_name["v0 hardware"]["seen"]
    assert "10.10.10.11/24" in by_name["v0 link"]["seen"]
    assert by_name["v0 interrupt coalescing"]["verdict"] == "good"


def test_a_driver_without_a_setting_is_told_so() -> None:
    """veth has neither coalescing nor EEE: nothing is changed."""
    found = in_namespace("doctor", "v0", "--ab", "rx-usecs=0", "--count", "100")
    assert "no interrupt coalescing" in found["error"]["message"]  # type: ignore[index]
