"""A reader that is not Python's: MCAP's own TypeScript library on Node, fetched from its registry."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from hostmot2.recording import read
from recording.making import record_file, records

HERE = Path(__file__).parent / "node"
MODULES = Path(__file__).parents[2] / "build" / "mcap-node"


@pytest.fixture(scope="module")
def node():
    """The directory with the reader. Skips where there is no Node or its registry cannot be reached."""
    if not shutil.which("node") or not shutil.which("npm"):
        pytest.skip("NOT READ BY A FOREIGN READER: node and npm are needed")
    MODULES.mkdir(parents=True, exist_ok=True)
    for name in ("package.json", "read.js"):
        shutil.copy(HERE / name, MODULES)
    if not (MODULES / "node_modules" / "@mcap" / "core").exists():
        command = ["npm", "install", "--no-audit", "--no-fund", "--ignore-scripts"]
        done = subprocess.run(command, cwd=MODULES, capture_output=True, text=True, timeout=120)
        if done.returncode:
            pytest.skip(f"NOT READ BY A FOREIGN READER: npm install failed: {done.stderr[-200:]}")
    return MODULES


@pytest.mark.slow
def test_another_reader_finds_the_same(node, tmp_path):
    path = record_file(tmp_path / "run.mcap", records(0, 1000), parts=4, json_rate=1000)
    command = ["node", str(node / "read.js"), str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    found, run = json.loads(done.stdout), read(path)
    assert [cycle for cycle, _ in found["records"]] == run.cycle.tolist()
    assert [value for _, value in found["records"]] == run["enc0.position"].tolist()
    assert [m["enc0_position"] for m in found["inputs"]] == run["enc0.position"][::4].tolist()
    assert [int(time) for time in found["times"]] == run.time_ns[::4].tolist()
    assert found["counts"]["/hm2/cycle"] == 250
    assert found["schemas"]["/hm2/cycle"] == "jsonschema"
    assert found["attachments"] == ["layout.foxglove.json"]
