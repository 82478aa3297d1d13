"""The dependency rule of ARCHITECTURE.md, and that nothing grows out of hand."""

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
CSRC = Path(__file__).parent.parent / "csrc"
SHARED = {"hm2.h", "registers.h"}


def includes(path: Path) -> set[str]:
    return set(re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(), re.MULTILINE))


def test_the_driver_never_includes_the_emulator() -> None:
    emulator = {path.name for path in (CSRC / "emulator").glob("*.h")}
    for path in [*CSRC.glob("*.c"), *CSRC.glob("*.h")]:
        assert not {name for name in includes(path) if "emulator" in name}, path.name
        own = {name for name in includes(path) if (CSRC / name).exists()}
        assert includes(path) - own <= set(), f"{path.name} includes {includes(path) & emulator}"


def test_the_emulator_includes_of_the_driver_only_what_both_declare() -> None:
    for path in (CSRC / "emulator").glob("**/*.[ch]"):
        foreign = {name for name in includes(path) if not (path.parent / name).exists()}
        assert foreign <= SHARED, f"{path.name} includes {sorted(foreign - SHARED)}"


def test_every_module_of_the_package_has_its_layer_and_imports_only_downwards() -> None:
    lint_imports = shutil.which("lint-imports", path=str(Path(sys.executable).parent))
    if not lint_imports:
        pytest.skip("import-linter is not installed (make check has it)")
    done = subprocess.run([lint_imports, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[done.stdout.find("Broken contracts") :]


def test_no_function_and_no_file_is_too_long() -> None:
    command = [sys.executable, "tools/sizes.py"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("generator", ["capabilities", "errors"])
def test_generated_pages_are_up_to_date(generator: str) -> None:
    command = [sys.executable, f"docs/generate_{generator}.py", "--check"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("command", [["check"], ["format", "--check"]], ids=["lint", "format"])
def test_the_code_is_in_the_style_of_pyproject(command: list[str]) -> None:
    if not importlib.util.find_spec("ruff"):
        pytest.skip("ruff is not installed (make check has it)")
    arguments = [sys.executable, "-m", "ruff", *command, "."]
    done = subprocess.run(arguments, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
