"""Makes the mistakes of tools/mutants.toml one at a time in a copy of the tree, and runs the tests on each.

python tools/mutants.py [--only TEXT]... [--again] [--list]    run those not caught yet
python tools/mutants.py --report                               write docs/reference/mutants.md from them
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scratch import ROOT, copy_tree

LIST = ROOT / "tools" / "mutants.toml"
PLACE = ROOT / "build" / "mutants"
TREE = PLACE / "tree"
RESULTS = PLACE / "results.json"
REPORT = ROOT / "docs" / "reference" / "mutants.md"
FLAGS = ("-std=c11", "-O1", "-g", "-D_GNU_SOURCE", "-pthread", "-fPIC", "-w", "-Icsrc")
CAUGHT, SURVIVED, NOT_RUN = "caught", "SURVIVED", "not run"
ROW = re.compile(r"^\| (.* \| `[^`]+`) \| (.*) \|$", re.MULTILINE)
# a busy machine fails these, too: what only they notice is not noticed
REAL_TIME = (
    "test_exits.py",
    "test_engine_real_time.py",
    "test_udp_board.py",
    "cards/test_exits_with_motor.py",
)
NAMED_TIMEOUT, SUITE_TIMEOUT = 100, 300  # seconds for one test: a mutant may wait for ever
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)


@dataclass(frozen=True)
class Mutant:
    """One mistake."""

    imitates: str
    file: str
    find: str
    put: str
    tests: tuple[str, ...]

    @property
    def key(self) -> str:
        """Changes with the mistake itself."""
        text = json.dumps([self.file, self.find, self.put])
        return hashlib.sha1(text.encode()).hexdigest()[:12]

    @property
    def selection(self) -> list[str]:
        """The named tests as pytest takes them."""
        unit = "tests/test_c_units.py::test_c_unit[{}]"
        return [unit.format(Path(test).stem) if test.endswith(".c") else test for test in self.tests]


def load() -> list[Mutant]:
    """The list. Exits if a search text does not stand in its file exactly once, or a test does not exist."""
    found, wrong = [], []
    for entry in tomllib.loads(LIST.read_text())["mutant"]:
        mutant = Mutant(**(entry | {"tests": tuple(entry["tests"])}))
        found.append(mutant)
        count = (ROOT / mutant.file).read_text().count(mutant.find)
        if count != 1:
            wrong.append(f"{mutant.imitates}: its text stands {count} times in {mutant.file}")
        wrong += [f"{mutant.imitates}: no {test}" for test in mutant.tests if not (ROOT / test).exists()]
    if wrong:
        sys.exit("\n".join(wrong))
    return found


# ---- the copy ------------------------------------------------------------------------------------


def objects() -> Path:
    """Where setuptools left the object files."""
    (place,) = (TREE / "build").glob("temp.*")
    return place


def build_all() -> None:
    """Both extensions, once, quickly compiled."""
    for name in ("csrc/build_ffi.py", "setup.py"):
        file = TREE / name
        file.write_text(file.read_text().replace('"-O3"', '"-O1"'))
    command = [sys.executable, "setup.py", "-q", "build_ext", "--inplace"]
    subprocess.run(command, cwd=TREE, env=os.environ | {"CFLAGS": "-w"}, check=True)


def compile_and_link(sources: list[str]) -> bool:
    """These C files anew, and the extension out of all object files; False: it does not compile."""
    include = f"-I{sysconfig.get_path('include')}"
    place = objects()
    for source in sources:
        target = place / Path(source).with_suffix(".o")
        done = subprocess.run(
            ["gcc", *FLAGS, include, "-c", source, "-o", str(target)], cwd=TREE, check=False
        )
        if done.returncode:
            return False
    everything = [str(path) for path in sorted(place.rglob("*.o")) if "_bound" not in path.name]
    extension = TREE / "hostmot2" / "_core.abi3.so"
    extension.unlink()  # a process that still has the old one must not see it change
    link = ["gcc", "-shared", "-pthread", *everything, "-lm", "-o", str(extension)]
    return subprocess.run(link, cwd=TREE, check=False).returncode == 0


def affected(file: str) -> list[str]:
    """C files to compile after a change in `file`."""
    if file.endswith(".c"):
        return [file]
    if not file.endswith(".h"):
        return []
    return [str(path.relative_to(TREE)) for path in sorted((TREE / "csrc").rglob("*.c"))]


# ---- one mutant -----------------------------------------------------------------------------------


def pytest(tests: list[str], *options: str, timeout: int) -> tuple[int, str]:
    """Exit status and what failed."""
    command = [sys.executable, "-P", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    compiler = "ccache gcc -w" if shutil.which("ccache") else "gcc -w"  # a warning is not what has to notice
    env = os.environ | {"PYTHONPATH": str(TREE), "PYTHONDONTWRITEBYTECODE": "1", "CC": compiler}
    if any("interop" in test for test in tests):
        env["HM2_INTEROP"] = "1"
    done = subprocess.run(
        [*command, f"--timeout={timeout}", "--timeout-method=thread", *options, *tests],
        cwd=TREE, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
    )  # fmt: skip
    failed = FAILED.search(done.stdout)
    return done.returncode, failed[1] if failed else ""


def judge(mutant: Mutant) -> dict[str, Any]:
    """Runs the named tests, then all of them; says which test noticed."""
    quick = ("-m", "not slow")
    for selection, options, timeout in (
        (mutant.selection, quick, NAMED_TIMEOUT),
        ([], ("-n", "2", *quick, *(f"--ignore=tests/{name}" for name in REAL_TIME)), SUITE_TIMEOUT),
    ):
        status, failed = pytest(list(selection), *options, timeout=timeout)
        if status in (1, 2, 3) or status < 0:  # tests failed, or the mutant kept them from running
            by = failed or f"exit status {status}"
            return {"outcome": CAUGHT, "by": by, "named": bool(selection)}
        if status != 0:
            sys.exit(f"{mutant.imitates}: pytest ended with {status}")
    return {"outcome": SURVIVED, "by": "", "named": False}


def run(mutant: Mutant) -> dict[str, Any]:
    """Makes the mistake, judges, mends it."""
    file = TREE / mutant.file
    right = file.read_text()
    sources = affected(mutant.file)
    kept = [objects() / Path(source).with_suffix(".o") for source in sources]
    backups = [(path, path.read_bytes()) for path in kept]
    start = time.monotonic()
    try:
        file.write_text(right.replace(mutant.find, mutant.put))
        if sources and not compile_and_link(sources):
            sys.exit(f"{mutant.imitates}: does not compile")
        result = judge(mutant)
    finally:
        file.write_text(right)
        for path, content in backups:
            path.write_bytes(content)
        if sources:
            compile_and_link([])
    return result | {"seconds": round(time.monotonic() - start), "imitates": mutant.imitates}


# ---- all of them ----------------------------------------------------------------------------------


def results() -> dict[str, Any]:
    """What is known from earlier runs, by key."""
    loaded: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    return loaded


def chosen(mutants: list[Mutant], only: list[str], again: bool) -> Iterator[Mutant]:
    """Those to be run now: not caught yet, or all again; named, if any is."""
    known = results()
    for mutant in mutants:
        caught = known.get(mutant.key, {}).get("outcome") == CAUGHT
        named = not only or any(text in mutant.imitates + mutant.file for text in only)
        if named and (again or not caught):
            yield mutant


def run_all(mutants: list[Mutant]) -> int:
    """Runs them, keeping each result as it comes; the number of survivors."""
    survivors = 0
    shutil.rmtree(TREE / "build" / "c_units", ignore_errors=True)
    copy_tree(TREE)
    build_all()
    for mutant in mutants:
        result = run(mutant)
        RESULTS.write_text(json.dumps(results() | {mutant.key: result}, indent=1))
        survivors += result["outcome"] == SURVIVED
        place = "" if result["named"] else " (not by the named tests)"
        print(f"{result['outcome']:<8} {result['seconds']:4} s  {mutant.imitates}", flush=True)
        print(f"         {mutant.file}: {result['by']}{place}", flush=True)
    return survivors


def written_before() -> dict[str, str]:
    """What the page says of each mistake and its file: results of runs made elsewhere, too."""
    found = ROW.findall(REPORT.read_text()) if REPORT.exists() else []
    return {mistake: by for mistake, by in found if by != NOT_RUN}


def said_of(result: dict[str, Any]) -> str:
    """A result as the table has it."""
    if result["outcome"] != CAUGHT:
        return SURVIVED
    return f"`{result['by'].removeprefix('tests/').replace('|', chr(92) + '|')}`"


def report(mutants: list[Mutant]) -> int:
    """The table; the number of mutants that are not known to be caught."""
    known, before = results(), written_before()
    lines = [
        "# Mutants", "",
        "Written by `python tools/mutants.py --report` from the last run of `make mutants`: each mistake was",
        "made alone in a copy of the tree, and the test named here was the first to notice it. A run of some",
        "of them (`--only`) changes the rows of those alone.", "",
        "| mistake | file | noticed by |", "|---|---|---|",
    ]  # fmt: skip
    missing = 0
    for mutant in mutants:
        mistake = f"{mutant.imitates} | `{mutant.file}`"
        by = said_of(known[mutant.key]) if mutant.key in known else before.get(mistake, NOT_RUN)
        missing += by in (SURVIVED, NOT_RUN)
        lines.append(f"| {mistake} | {by} |")
    lines += ["", f"{len(mutants) - missing} of {len(mutants)} noticed."]
    REPORT.write_text("\n".join(lines) + "\n")
    return missing


def main() -> int:
    """Runs or reports."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "--only", default=[], action="append", help="mutants whose mistake or file contains this"
    )
    parser.add_argument("--again", action="store_true", help="also those that were caught before")
    parser.add_argument("--list", action="store_true", help="check the list and print it")
    parser.add_argument("--report", action="store_true", help=f"write {REPORT.relative_to(ROOT)}")
    arguments = parser.parse_args()
    mutants = load()
    if arguments.list:
        print("\n".join(f"{mutant.key}  {mutant.file}: {mutant.imitates}" for mutant in mutants))
        return 0
    if arguments.report:
        return 1 if report(mutants) else 0
    return 1 if run_all(list(chosen(mutants, arguments.only, arguments.again))) else 0


if __name__ == "__main__":
    sys.exit(main())
