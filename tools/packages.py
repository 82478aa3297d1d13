"""The wheel as its users meet it: in clean environments, with and without extras, and typed from outside.

python tools/packages.py WHEEL PLACE      PLACE: a directory for the environments, made anew
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

BASE = {
    "cffi",
    "click",
    "hostmot2",
    "markdown-it-py",
    "mdurl",
    "numpy",
    "pycparser",
    "pygments",
    "rich",
    "tomlkit",
}
"""What the base brings; its reason is beside each in pyproject.toml, or one that is there needs it."""

WORKS_WITHOUT = (
    "info",
    "pins 7i77",
    "sserial scan",
    "param list 0.1",
    "explain E021",
    "bench doit --count 10",
)
NEEDS = {
    "record": ("record -o run.mcap --seconds 0.1", "play run.mcap", "export run.mcap -o run.csv"),
    "plot": ("bench doit --count 10 --plot doit.png",),
    "serial": ("rpd FAULT --port /dev/ttyUSB0", "param list --port /dev/ttyUSB0", "discover --serial"),
    "live": ("live",),
    "monitor": ("monitor",),
    # works without it, and says what it could not look at; needs a recording
    "doctor": (),
    "parquet": (),
}
"""Extra: commands that must name it when it is not there."""

TYPED = """
import hostmot2
from hostmot2.sserial import DoitResult, StartResult

with hostmot2.open("emu://5i25+7i77") as hm2:
    started: StartResult = hm2.sserial.start(0x01)
    done: DoitResult = hm2.sserial.doit(0x01)
    words: list[int] = hm2.read_words(0x0100, 4)
"""


class Wrong(Exception):
    """The wheel is not what it should be."""


def run(*command: str, cwd: Path, codes: tuple[int, ...] = (0,)) -> str:
    """What a command prints, stderr too. Raises Wrong for another exit status."""
    known = os.environ | {"TERM": "xterm"}  # whatever runs this may have none
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, env=known)
    said = done.stdout + done.stderr
    if done.returncode not in codes:
        raise Wrong(f"$ {' '.join(command)}\n{said}exit status {done.returncode}")
    return said


def environment(place: Path, requirement: str) -> Path:
    """A virtual environment with nothing but pip and what is required; its python."""
    run(sys.executable, "-m", "venv", str(place), cwd=place.parent)
    python = place / "bin" / "python"
    run(str(python), "-m", "pip", "install", "-q", requirement, cwd=place.parent)
    return python


def check_base(python: Path, extras: set[str]) -> str:
    """The base is small, works, and names the extra that is missing."""
    pip = (str(python), "-m", "pip", "--disable-pip-version-check")
    listed = json.loads(run(*pip, "list", "--format=json", cwd=python.parent).splitlines()[0])
    names = {each["name"].lower() for each in listed} - {"pip", "setuptools"}
    if names != BASE:
        raise Wrong(f"the base brings {sorted(names - BASE)} too many and {sorted(BASE - names)} too few")
    hm2 = str(python.parent / "hm2")
    empty = python.parent.parent
    for command in WORKS_WITHOUT:
        run(hm2, *command.split(), cwd=empty)
    for extra in extras:
        for command in NEEDS[extra]:
            # on a terminal, which hm2 monitor asks for first
            said = run("script", "-qec", f"{hm2} {command}", "/dev/null", cwd=empty, codes=(2, 3))
            if f"hostmot2[{extra}]" not in said:
                raise Wrong(f"hm2 {command} does not name the extra {extra}:\n{said}")
    return f"base of {len(names)} packages"


def extras_of(wheel: Path) -> set[str]:
    """All extras but `all`, which has to have every one of them."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (n for n in archive.namelist() if n.endswith(".dist-info/METADATA"))
        metadata = archive.read(name).decode()
    extras = set(re.findall(r"^Provides-Extra: (\S+)$", metadata, re.MULTILINE)) - {"all"}
    if not extras <= set(NEEDS):
        raise Wrong(f"extras {sorted(extras)}, checked are {sorted(NEEDS)}")
    everything = re.search(r"^Requires-Dist: hostmot2\[(.*?)\]; extra == .all.$", metadata, re.MULTILINE)
    if not everything or not set(everything[1].split(",")) >= extras:
        raise Wrong(f"the extra all is not all of {sorted(extras)}")
    return extras


def check_types(python: Path, place: Path) -> str:
    """py.typed is there: mypy --strict sees the package's types from outside."""
    program = place / "program.py"
    mypy = (sys.executable, "-m", "mypy", "--strict", "--no-incremental", "--python-executable", str(python))
    program.write_text(TYPED)
    run(*mypy, program.name, cwd=place)
    program.write_text(TYPED.replace("words: list[int]", "words: list[str]"))
    said = run(*mypy, program.name, cwd=place, codes=(1,))
    if 'has type "list[int]", variable has type "list[str]"' not in said:
        raise Wrong(f"mypy does not see the types of the package:\n{said}")
    return "typed"


def main(wheel: Path, place: Path) -> None:
    """Everything."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    extras = extras_of(wheel)
    python = environment(place / "base", str(wheel))
    found = (check_base(python, extras), f"{len(extras)} extras", check_types(python, place))
    run(str(python), "-m", "pip", "install", "-q", "--dry-run", f"{wheel}[all]", cwd=place)
    print(", ".join(found))


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
    except Wrong as wrong:
        sys.exit(str(wrong))
