"""Which lines of Python and branches of C the quick tests and the C units run; lists what they do not.

python tools/coverage_report.py [--report-only]     writes docs/reference/coverage.md
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

from scratch import ROOT, copy_tree

PLACE = ROOT / "build" / "coverage"
TREE = PLACE / "tree"
SETTINGS = """\
[run]
source = hostmot2
parallel = true
data_file = {place}/python/data
patch = subprocess
sigterm = true
concurrency = thread
[paths]
source =
    {root}/hostmot2
    {tree}/hostmot2
"""


def build() -> None:
    """The tree with extensions that count their branches; not optimized: each is a branch of the source."""
    copy_tree(TREE)
    for name in ("csrc/build_ffi.py", "setup.py"):
        file = TREE / name
        file.write_text(file.read_text().replace('"-O3"', '"-O0"'))
    flags = {"CC": "gcc", "CFLAGS": "--coverage -fprofile-update=atomic", "LDFLAGS": "--coverage"}
    for old in TREE.rglob("*.gcda"):
        old.unlink()
    subprocess.run(
        [sys.executable, "setup.py", "-q", "build_ext", "--inplace"],
        cwd=TREE,
        env=os.environ | flags,
        check=True,
    )


def test() -> None:
    """The quick tests, with both kinds of counters on."""
    settings = PLACE / "coveragerc"
    settings.write_text(SETTINGS.format(place=PLACE, root=ROOT, tree=TREE))
    for old in (PLACE / "python").glob("data*"):
        old.unlink()
    (PLACE / "python").mkdir(exist_ok=True)
    env = os.environ | {"PYTHONPATH": str(TREE), "CC": "gcc --coverage -fprofile-update=atomic"}
    command = [sys.executable, "-P", "-m", "coverage", "run", f"--rcfile={settings}", "-m", "pytest", "-q"]
    options = ["-n", "2", "-m", "not slow", f"--basetemp={PLACE}/pytest"]
    subprocess.run([*command, *options], cwd=TREE, env=env, check=False)


def main() -> int:
    """Builds, tests, reports."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--report-only", action="store_true", help="from the last run's counters")
    if not parser.parse_args().report_only:
        build()
        test()
    return 0


if __name__ == "__main__":
    sys.exit(main())
