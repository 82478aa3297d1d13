"""Which lines of Python and branches of C the quick tests and the C units run; lists what they do not.

python tools/coverage_report.py [--report-only]     writes docs/reference/coverage.md
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass

from scratch import ROOT, copy_tree

PLACE = ROOT / "build" / "coverage"
TREE = PLACE / "tree"
REPORT = ROOT / "docs" / "reference" / "coverage.md"
GENERATED = {"hostmot2/registers.py"}
REASONS = (
    (r"(alloc\(|== NULL\)|if \(!\w+\)$|NO_MEMORY)", "memory is never refused here"),
    (r"^csrc/bulk\.c.*(FILL|NARROW|put_|line\[|for \()", "of each decoder only what its processor runs"),
    (r"if TYPE_CHECKING|^\S+: \.\.\.$", "for the type checker"),
    (r"^csrc/udp_floor\.c|^hostmot2/bench/", "measures; run by make bench"),
    (
        r"(sched_|mlockall|pthread_(create|setaffinity|setschedparam)|socket\(|bind\(|mmap\()",
        "the system refuses",
    ),
)
CHECKS = '"-fsanitize=address,undefined -fno-sanitize-recover=all"'  # has branches of its own
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
    for name, plain in (
        ("csrc/build_ffi.py", '"-O3"'),
        ("setup.py", '"-O3"'),
        ("tests/test_c_units.py", CHECKS),
    ):
        file = TREE / name
        file.write_text(file.read_text().replace(plain, '"-O0"'))
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


# ---- the report ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Measured:
    """What a file has, how much of it the tests reached, and the lines where something was not."""

    name: str
    reached: int
    total: int
    missing: list[int]


def python_lines() -> list[Measured]:
    """Statements of the package but for the generated registers.py."""
    settings, output = str(PLACE / "coveragerc"), PLACE / "python.json"
    coverage = [sys.executable, "-m", "coverage"]
    subprocess.run([*coverage, "combine", "-q", "--keep", f"--rcfile={settings}"], cwd=TREE, check=True)
    subprocess.run([*coverage, "json", "-q", f"--rcfile={settings}", "-o", str(output)], cwd=TREE, check=True)
    found = []
    for name, file in json.loads(output.read_text())["files"].items():
        short = name[name.index("hostmot2/") :].split("tree/")[-1]
        if short not in GENERATED:
            summary = file["summary"]
            found.append(
                Measured(short, summary["covered_lines"], summary["num_statements"], file["missing_lines"])
            )
    return found


def c_branches() -> list[Measured]:
    """Branches of the C files, as gcc counts them without optimization, of extension and C units together."""
    output = PLACE / "c.json"
    command = [sys.executable, "-m", "gcovr", "-r", str(TREE), str(TREE / "build"), str(PLACE / "pytest")]
    filters = ["--filter", f"{TREE}/csrc/", "--filter", "csrc/", "--exclude", ".*_core.c"]
    options = ["--gcov-ignore-errors=all", "--merge-mode-functions=separate", "--json", str(output)]
    subprocess.run([*command, *filters, *options], cwd=TREE, check=True, capture_output=True)
    found = []
    for file in json.loads(output.read_text())["files"]:
        lines = [(line["line_number"], [b["count"] > 0 for b in line["branches"]]) for line in file["lines"]]
        taken = [branch for _, branches in lines for branch in branches]
        missing = sorted({number for number, branches in lines if not all(branches)})
        found.append(Measured(file["file"], sum(taken), len(taken), missing))
    return found


def reason(name: str, line: str) -> str:
    """Why a line may be left: what cannot be brought about here; empty if only a test is missing."""
    return next((text for pattern, text in REASONS if re.search(pattern, f"{name}: {line}")), "")


def table(title: str, files: list[Measured]) -> list[str]:
    """Totals, and every place that is left, with its text and reason."""
    reached, total = sum(f.reached for f in files), sum(f.total for f in files)
    lines = [f"## {title}: {100 * reached / max(total, 1):.1f} % ({reached} of {total})", ""]
    for file in sorted(files, key=lambda each: each.reached - each.total):
        if not file.missing:
            continue
        share = f"{100 * file.reached / max(file.total, 1):.0f} %"
        lines += [f"### {file.name}: {share}", ""]
        source = (TREE / file.name).read_text().splitlines()
        for number in file.missing:
            text = source[number - 1].strip()
            lines.append(f"- {number} `{text}` {reason(file.name, text) or 'no test yet'}")
        lines.append("")
    return lines


def report() -> None:
    """Writes the page and prints the totals."""
    lines = [
        "# Coverage",
        "",
        "Written by `make coverage`: what the quick tests and the C units do not reach.",
        "",
    ]
    for title, files in (("Lines of Python", python_lines()), ("Branches of C", c_branches())):
        section = table(title, files)
        print(section[0].removeprefix("## "))
        lines += section
    REPORT.write_text("\n".join(lines) + "\n")


def main() -> int:
    """Builds, tests, reports."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--report-only", action="store_true", help="from the last run's counters")
    if not parser.parse_args().report_only:
        build()
        test()
    report()
    return 0


if __name__ == "__main__":
    sys.exit(main())
