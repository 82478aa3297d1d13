"""Every example runs as it stands."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SCRIPTS = sorted(p.name for p in (ROOT / "examples").glob("*.py") if not p.name.startswith("test_"))
SAYS = {
    "blink_and_read.py": "pulsed",
    "seven_i77.py": "axis 0 at",
    "fault_drill.py": "HM2-E041",
    "torque_8i20.py": "turns/s",
    "card_plugin.py": "0x0020",
    "closed_loop.py": "settled at 2.00",
    "record_and_read.py": "drawn in run.png",
}


@pytest.mark.parametrize("script", SCRIPTS)
def test_example_runs(script: str, tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, str(ROOT / "examples" / script)],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert SAYS.get(script, "") in run.stdout


def test_the_fixtures_serve_a_users_own_tests(tmp_path: Path) -> None:
    """Installed, the plug-in is loaded by its entry point; from a bare tree it is named."""
    installed = any(point.name == "hostmot2" for point in entry_points(group="pytest11"))
    plugin = [] if installed else ["-p", "hostmot2.pytest_plugin"]
    (tmp_path / "test_my_machine.py").write_text((ROOT / "examples/test_my_machine.py").read_text())
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *plugin, str(tmp_path)],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert "2 passed" in run.stdout, run.stdout + run.stderr
