"""Which statements of Python and branches of C the quick tests and the C units run, and what they do not.

python tools/coverage_report.py                     all tests; writes docs/reference/coverage.md
python tools/coverage_report.py --report-only       the page from the counters that are there
python tools/coverage_report.py --only TEST ...     these tests add to the counters of the last run;
                                                    sources that have changed begin anew
python tools/coverage_report.py --report-only --show NAME   prints what is left in files with this name
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

from scratch import ROOT, copy_tree

PLACE = ROOT / "build" / "coverage"
TREE = PLACE / "tree"
REPORT = ROOT / "docs" / "reference" / "coverage.md"
AT_ONCE = 3  # many tests wait
LONG = "c_units|faults|documents|emulator|sserial|test_engine|bulk"
COUNTING = "--coverage -fprofile-update=atomic -frandom-seed=coverage"  # a seed: counters outlive a rebuild

# Compiled differently than in use: a branch of the source shall be one branch in the object file.
PLAIN = (
    ("csrc/build_ffi.py", '"-O3"', '"-O0"', "the optimizer joins branches and makes copies of others"),
    ("setup.py", '"-O3"', '"-O0"', ""),
    ("tests/test_c_units.py", "-g -O1", "-g -O0", ""),
    (
        "tests/test_c_units.py",
        "-fsanitize=address,undefined -fno-sanitize-recover=all",
        "-fno-common",
        "sanitizers add branches of their own",
    ),
    ("tests/test_c_units.py", "-fsanitize=thread -Wno-tsan", "-fno-common", ""),
    (
        "csrc/bulk.c",
        "static inline __attribute__((always_inline))",
        "static",
        "each processor's decoder gets a copy of all its functions",
    ),
)

# What is not counted at all: (file and text of the line, why). The page says how much each rule takes out.
NOT_COUNTED = ((r"^hostmot2/registers\.py:", "generated from the register description"),)
EXCLUDED = (  # coverage.py's own way to leave out lines
    (r"^\s*(((async )?def .*?)?[\])]+(\s*->.*?)?:\s*)?\.\.\.\s*(#|$)", "a body of `...`"),
    (r"^\s*if (typing\.)?TYPE_CHECKING:", "for the type checker"),
)
# Why something that is counted may be left; what matches none of these lacks a test.
LEFT = (
    (
        r"^csrc/.*(index >= [\w>-]+count|reg (!=|>) HM2_|switch \()",
        "ruled out by who calls: decoder, or values",
    ),
    (
        r"shared_words_try|before & 1|compare_exchange|before == GRANTED|stopping\)",
        "another thread in between two instructions",
    ),
    (r"__builtin_cpu_supports", "another processor"),
    (r"^csrc/bulk\.c.*(i < BLOCK|FILL\()|!step \|\|", "a bound for the compiler"),
    (r"CPU_SET|fifo_priority > 0", "real-time scheduling: run by `make bench`"),
    (r"hm2_lbp16_next\(datagram->|sizeof error->where", "a safety belt on our own bytes"),
    (r"^hostmot2/_bound\.c", "what Python refuses its own callers"),
    (r"^hostmot2/bench/peer\.py", "needs LinuxCNC: run by `make bench`"),
    (r"^hostmot2/doctor/(links|eee)\.py", "needs a network card and an extra"),
    (r"except (ImportError|ModuleNotFoundError)|pip install", "an extra that is not installed"),
    (r"^hostmot2/bench/", "a measurement: run by `make bench`"),
    (r"^hostmot2/\S+: *raise (AssertionError|NotImplementedError|MemoryError)\b", "nothing leads there"),
    (r"^hostmot2/exits\.py", "in a process that a signal ends"),
    (r"_is_owned|_at_fork_reinit|hm2_engine_abandon|\bin list\(_\w+\)|\._?disown\(", "in a forked child"),
)

SETTINGS = """\
[run]
source = hostmot2
parallel = true
data_file = {place}/python/data
patch =
    subprocess
    _exit
concurrency = thread
[report]
exclude_lines =
    {excluded}
[paths]
source =
    {tree}/hostmot2
    {root}/hostmot2
"""


def copy_changed() -> None:
    """The tree with what is compiled differently; what has not changed keeps its time."""
    files = [TREE / name for name in dict.fromkeys(name for name, *_ in PLAIN)]
    before = {file: (file.read_text(), file.stat().st_mtime) for file in files if file.exists()}
    copy_tree(TREE)
    for name, plain, counted, _ in PLAIN:
        text = (TREE / name).read_text()
        if plain not in text:
            raise SystemExit(f"{name}: no {plain!r} to compile differently")
        (TREE / name).write_text(text.replace(plain, counted))
    for file, (text, time) in before.items():
        if file.read_text() == text:
            os.utime(file, (time, time))


def build(fresh: bool) -> None:
    """The tree with extensions that count their branches. fresh: without the counters of earlier runs."""
    copy_changed()
    if fresh:
        shutil.rmtree(TREE / "build", ignore_errors=True)
        shutil.rmtree(PLACE / "pytest", ignore_errors=True)
        shutil.rmtree(PLACE / "python", ignore_errors=True)
    (PLACE / "python").mkdir(parents=True, exist_ok=True)
    flags = {"CC": "gcc", "CFLAGS": COUNTING, "LDFLAGS": "--coverage"}
    command = [sys.executable, "setup.py", "-q", "build_ext", "--inplace"]
    counters = {file: file.read_bytes() for file in (TREE / "build").glob("temp*/**/*.gcda")}
    subprocess.run(command, cwd=TREE, env=os.environ | flags, check=True)
    for file, counts in counters.items():  # gcc has removed them; those of another source will be overwritten
        file.write_bytes(counts)
    drop_outdated()


def drop_outdated() -> None:
    """Removes the counters of objects whose source or headers have changed: they speak of other lines."""
    newest = max(header.stat().st_mtime for header in (TREE / "csrc").rglob("*.h"))
    changed = {source.name: source.stat().st_mtime for source in (TREE / "csrc").rglob("*.c")}
    for notes in [*(TREE / "build" / "c_units").rglob("*.gcno"), *(PLACE / "pytest").rglob("*.gcno")]:
        source = re.sub(r"(\.c)?(-\d+)?\.gcno$", ".c", notes.name)  # csrc_emulator_card.c-1234.gcno
        own = [time for name, time in changed.items() if source.endswith("_" + name)]
        if notes.stat().st_mtime < max(newest, *(own or changed.values())):  # a test may include any
            notes.unlink()
            notes.with_suffix(".gcda").unlink(missing_ok=True)


def settings() -> Path:
    """What coverage.py is to do, in a file."""
    place = PLACE / "coveragerc"
    excluded = "\n    ".join(pattern for pattern, _ in EXCLUDED)
    place.write_text(SETTINGS.format(place=PLACE, root=ROOT, tree=TREE, excluded=excluded))
    return place


def test_file(name: str) -> str:
    """The quick tests of one file with both kinds of counters on; the last line that pytest says."""
    place = name.replace("/", "_").removesuffix(".py")
    command = [sys.executable, "-P", "-m", "coverage", "run", f"--rcfile={settings()}", "-m", "pytest", "-q"]
    options = ["-m", "not slow", f"--basetemp={PLACE}/pytest/{place}"]
    if name.endswith("test_c_units.py"):
        options += ["-n", str(AT_ONCE)]  # compiles for minutes, in processes of its own
    env = os.environ | {"PYTHONPATH": str(TREE), "CC": f"gcc {COUNTING}"}
    with (PLACE / "log" / f"{place}.txt").open("w") as log:
        subprocess.run([*command, *options, name], cwd=TREE, env=env, stdout=log, stderr=log, check=False)
    return ((PLACE / "log" / f"{place}.txt").read_text().splitlines() or ["nothing said"])[-1]


def test(selected: list[str]) -> None:
    """The quick tests, or some, a process for each file: its counters outlive whatever ends the others."""
    for folder in ("log", "pytest", "python"):
        (PLACE / folder).mkdir(parents=True, exist_ok=True)
    every = sorted(str(file.relative_to(TREE)) for file in (TREE / "tests").rglob("test_*.py"))
    first = [name for name in every if re.search(LONG, name)]  # so that none of them is the last
    names = selected or [*first, *(name for name in every if name not in first)]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for number, (name, said) in enumerate(zip(names, pool.map(test_file, names), strict=True), 1):
            print(f"{number}/{len(names)} {name}: {said}", flush=True)


# ---- what was reached ---------------------------------------------------------------------------


@dataclass
class Measured:
    """What a file has, how much of it the tests reached, and the lines where something was not."""

    name: str
    reached: int = 0
    total: int = 0
    missing: dict[int, str] = field(default_factory=dict)  # line: how much of it


def rule(rules: tuple[tuple[str, str], ...], name: str, line: str) -> str:
    """The reason that the first rule which matches gives; empty if none does."""
    return next((text for pattern, text in rules if re.search(pattern, f"{name}: {line}")), "")


def lines_of(name: str) -> list[str]:
    """The source as it was compiled."""
    return ["", *(TREE / name).read_text().splitlines()]


def python_lines(left_out: Counter[str]) -> list[Measured]:
    """Statements of the package."""
    rules, output = f"--rcfile={settings()}", PLACE / "python.json"
    coverage = [sys.executable, "-m", "coverage"]
    subprocess.run(
        [*coverage, "combine", "-q", "--append", rules], cwd=TREE, check=False, capture_output=True
    )
    subprocess.run([*coverage, "json", "-q", rules, "-o", str(output)], cwd=TREE, check=True)
    found = []
    for path, file in json.loads(output.read_text())["files"].items():
        name = "hostmot2/" + path.split("hostmot2/")[-1]
        summary, text = file["summary"], lines_of(name)
        reason = rule(NOT_COUNTED, name, "")
        left_out[reason] += summary["num_statements"] if reason else 0
        why = EXCLUDED[0][1]  # whose first lines do not show it yet
        for number in sorted(file["excluded_lines"]):  # a block belongs to its first line
            why = next((each for pattern, each in EXCLUDED if re.search(pattern, text[number])), why)
            left_out[why] += 1
        if not reason:
            missing = {number: "" for number in file["missing_lines"]}
            found.append(Measured(name, summary["covered_lines"], summary["num_statements"], missing))
    return found


def c_branches(left_out: Counter[str]) -> list[Measured]:
    """Branches of the C files, as gcc counts them without optimization, of extension and C units together."""
    output = PLACE / "c.json"
    command = [sys.executable, "-m", "gcovr", "-r", str(TREE), str(TREE / "build"), str(PLACE / "pytest")]
    filters = ["--filter", f"{TREE}/csrc/", "--filter", "csrc/", "--filter", f"{TREE}/hostmot2/"]
    merge = ["--gcov-ignore-errors=all", "--merge-mode-functions=separate"]
    options = [*merge, "--gcov-suspicious-hits-threshold=0", "--json", str(output)]  # loops run very often
    subprocess.run([*command, *filters, *options], cwd=TREE, check=True, capture_output=True)
    found = []
    for file in json.loads(output.read_text())["files"]:
        measured = Measured(file["file"])
        text = lines_of(measured.name) if (TREE / measured.name).exists() else []
        for line in file["lines"]:
            taken = [branch["count"] > 0 for branch in line["branches"]]
            number = line["line_number"]
            if reason := rule(NOT_COUNTED, measured.name, text[number] if text else ""):
                left_out[reason] += len(taken)
                continue
            measured.reached += sum(taken)
            measured.total += len(taken)
            if not all(taken):
                measured.missing[number] = f"{len(taken) - sum(taken)} of {len(taken)}"
        found.append(measured)
    return found


# ---- the page -----------------------------------------------------------------------------------


def heading(title: str, files: list[Measured]) -> str:
    """The title with its totals."""
    reached, total = sum(f.reached for f in files), sum(f.total for f in files)
    return f"{title}: {100 * reached / max(total, 1):.1f} % ({reached} of {total})"


def by_file(files: list[Measured]) -> list[str]:
    """How many files are reached whole, and how many lines or branches each reason leaves."""
    whole = sum(not file.missing for file in files)
    reasons = Counter(reason_left(file, number) for file in files for number in file.missing)
    lines = ["", f"{whole} of {len(files)} files are reached whole. Places left, by reason:", ""]
    return [*lines, *(f"- {count}: {why}" for why, count in reasons.most_common())]


def reason_left(file: Measured, number: int) -> str:
    """Why this line of the file is left."""
    return rule(LEFT, file.name, lines_of(file.name)[number]) or "no test yet"


def runs(file: Measured) -> list[tuple[int, int, str, str]]:
    """Neighbouring lines that are left for one reason: first, last, how much, why."""
    found: list[tuple[int, int, str, str]] = []
    for number, share in sorted(file.missing.items()):
        why = reason_left(file, number)
        if found and found[-1][1:] == (number - 1, share, why):
            found[-1] = (found[-1][0], number, share, why)
        else:
            found.append((number, number, share, why))
    return found


def left(files: list[Measured]) -> list[str]:
    """Every place that is left, with its text and reason, the file with most of them first."""
    lines = []
    for file in sorted(files, key=lambda each: (each.reached - each.total, each.name)):
        if not file.missing:
            continue
        text = lines_of(file.name)
        lines += ["", f"### {file.name}: {file.reached} of {file.total}", ""]
        for first, last, share, why in runs(file):
            place = f"{first}" if first == last else f"{first} to {last}"
            shown = text[first].strip().replace("`", "'")
            lines.append(f"- {place}{share and f' ({share})'}: `{shown}` {why}")
    return lines


def page() -> list[str]:
    """The whole page; the totals are printed."""
    left_out: Counter[str] = Counter()
    parts = [("Lines of Python", python_lines(left_out)), ("Branches of C", c_branches(left_out))]
    lines = [
        "# Coverage",
        "",
        f"Written by `make coverage` on {date.today()}: what quick tests and C units together do not reach.",
        "",
        "Not counted, each by a rule of `tools/coverage_report.py`:",
        "",
        *(f"- {count} because: {reason}" for reason, count in sorted(left_out.items()) if count),
        "",
        "Compiled without optimization and sanitizers, so that a branch is one of the source:",
        "",
        *(f"- `{plain}` of `{name}`: {why}" for name, plain, _, why in PLAIN if why),
    ]
    for title, files in parts:
        print(heading(title, files))
        lines += ["", f"## {heading(title, files)}", *by_file(files), *left(files)]
    return lines


def show(name: str) -> None:
    """What is left in files with this in their name."""
    files = [f for f in python_lines(Counter()) + c_branches(Counter()) if name in f.name]
    print(heading(name, files), *left(files), sep="\n")


def main() -> int:
    """Builds, tests, reports."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--report-only", action="store_true", help="from the counters that are there")
    parser.add_argument("--only", nargs="+", default=[], metavar="TEST", help="run only these; no page")
    parser.add_argument("--show", metavar="NAME", help="print what is left in files with this name; no page")
    options = parser.parse_args()
    if not options.report_only:
        build(fresh=not options.only)
        test(options.only)
    if options.show:
        show(options.show)
        return 0
    lines = page()
    target = PLACE / "coverage.md" if options.only else Path(REPORT)
    target.write_text("\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
