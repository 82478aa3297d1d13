"""Every example runs as it stands, without a card and on one: a served machine behind UDP."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from hostmot2.emulator import EmulatedBoard, catalog
from hostmot2.emulator.ethernet import EthernetServer, description
from hostmot2.emulator.plant import couple_dc_motor, couple_pm_motor

ROOT = Path(__file__).parent.parent
SAYS = {
    "blink_and_read.py": "pulsed",
    "seven_i77.py": "axis 0 at",
    "doit_benchmark.py": "2000 exchanges",
    "closed_loop.py": "turns, highest",
    "record_closed_loop.py": " 0 dropped",
    "record_and_read.py": "drawn in run.png",
    "parameter_backup.py": "now 100; put back",
    "torque_8i20.py": "turns/s",
    "fault_drill.py": "HM2-E041",
}
EMULATED_ONLY = {
    "closed_loop.py": "settled at 2.00",
    "fault_drill.py": "HM2-E021",
}
TESTS = "test_my_machine.py"


def ran(command: list[str], place: Path, **environment: str) -> str:
    """What a program says on stdout; it has to end well."""
    clean = {name: value for name, value in os.environ.items() if name != "HM2_BOARD"}
    run = subprocess.run(
        command,
        cwd=place,
        env=clean | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"} | environment,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


def test_every_example_is_run_here() -> None:
    assert {p.name for p in (ROOT / "examples").iterdir()} - {"__pycache__"} == {*SAYS, TESTS, "card_plugin"}


@pytest.mark.parametrize("script", SAYS)
def test_example_runs_without_a_card(script: str, tmp_path: Path) -> None:
    said = ran([sys.executable, str(ROOT / "examples" / script)], tmp_path)
    assert SAYS[script] in said
    assert EMULATED_ONLY.get(script, "") in said


@pytest.fixture(scope="module")
def served() -> Iterator[str]:
    """A 7I92 with a 7I77 with a motor on axis 0, a 7I84 and an 8I20 with a motor, behind UDP in real time."""
    board = EmulatedBoard("7i92+7i77", clock="real", sserial_channels=4)
    board.sserial[0].attach(2, catalog.remote("8i20"))
    board.sserial[0].attach(3, catalog.remote("7i84"))
    couple_dc_motor(board, axis=0)
    couple_pm_motor(board, channel=2, encoder=1)
    facts = replace(description("7i92+7i77"), ip="127.0.0.1")
    priority = 50 if os.geteuid() == 0 else 0  # on a busy machine a late reply is a lost one
    with EthernetServer(board, "127.0.0.1", 0, description=facts, fifo_priority=priority) as server:
        server.start()
        yield f"udp://{server.host}:{server.port}"
    board.close()


@pytest.mark.slow
@pytest.mark.parametrize("script", SAYS)
def test_the_same_example_runs_on_a_card(script: str, served: str, tmp_path: Path) -> None:
    said = ran([sys.executable, str(ROOT / "examples" / script)], tmp_path, HM2_BOARD=served)
    assert SAYS[script] in said


def test_the_fixtures_serve_a_users_own_tests(tmp_path: Path) -> None:
    """Installed, the plug-in is loaded by its entry point; from a bare tree it is named."""
    installed = any(point.name == "hostmot2" for point in entry_points(group="pytest11"))
    plugin = [] if installed else ["-p", "hostmot2.pytest_plugin"]
    shutil.copy(ROOT / "examples" / TESTS, tmp_path)
    said = ran([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *plugin, "."], tmp_path)
    assert "2 passed" in said


@pytest.fixture(scope="module")
def plugged(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The example plug-in built and installed by pip into a place of its own; sys.path for it."""
    source = tmp_path_factory.mktemp("source") / "card_plugin"
    shutil.copytree(ROOT / "examples" / "card_plugin", source)  # building writes beside the source
    place = tmp_path_factory.mktemp("installed")
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--no-index"]
    ran([*pip, "--target", str(place), str(source)], place)
    assert list(place.glob("hm2_card_plugin-*.dist-info/entry_points.txt"))
    return f"{ROOT}{os.pathsep}{place}"


def test_a_plug_ins_card_model_is_found(plugged: str, tmp_path: Path) -> None:
    use = ROOT / "examples" / "card_plugin" / "use_it.py"
    assert "7I84 on channels (2,)" in ran([sys.executable, str(use)], tmp_path, PYTHONPATH=plugged)


def test_without_the_plug_in_its_card_is_unknown(tmp_path: Path) -> None:
    use = ROOT / "examples" / "card_plugin" / "use_it.py"
    run = subprocess.run(
        [sys.executable, str(use)], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode != 0
    assert "no card '7i84' is known here" in run.stderr


def test_a_plug_ins_transport_is_opened_by_its_scheme(plugged: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hostmot2", "--board", "logged:emu://5i25+7i77", "info"]
    run = subprocess.run(
        command, cwd=tmp_path, env=os.environ | {"PYTHONPATH": plugged},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert "MESA5I25" in run.stdout
    assert "read  0100 55AACAFE" in run.stderr
