"""Looks for inputs that break a target, under coverage guidance.

python tests/fuzz/run.py TARGET [libFuzzer's options and corpus folders]
python tests/fuzz/run.py --all SECONDS     each target for so long; what it finds goes to build/fuzz
python tests/fuzz/run.py --runs COUNT      each target with so many inputs, the same each time
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
PLACE = TESTS.parent / "build" / "fuzz"


SAME = ("-seed=1", "-reload=0", "-use_cmp=0")
"""With these a target is given the same inputs each time."""

TIMED = "found"
"""Where inputs are kept that timed runs build upon."""


def run_all(options: list[str], keep: str) -> int:
    """Every target with these options of libFuzzer; 1 if one failed. keep: folder for what they find."""
    failed = 0
    for corpus in sorted((TESTS / "fuzz" / "corpus").iterdir()):
        name, found = corpus.name, PLACE / keep / corpus.name
        if keep != TIMED:
            shutil.rmtree(found, ignore_errors=True)
        found.mkdir(parents=True, exist_ok=True)
        always = ["-print_final_stats=1", f"-artifact_prefix={PLACE}/{name}-"]
        command = [sys.executable, __file__, name, *options, *always, str(found), str(corpus)]
        env = os.environ | {"PYTHONHASHSEED": "0"}  # a set's order decides which code runs
        done = subprocess.run(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        log = done.stdout.decode("utf-8", "replace")
        (PLACE / f"{name}.log").write_text(log)
        inputs = re.search(r"number_of_executed_units: *(\d+)|Done (\d+) in", log)
        said = f"{inputs[1] or inputs[2]} inputs" if inputs else "?"
        if done.returncode:
            print(log[-4000:])
            failed, said = 1, "FAILED"
        print(f"{name}: {said}", flush=True)
    return failed


def run_one(name: str, arguments: list[str]) -> None:
    import atheris

    sys.path.insert(0, str(TESTS))
    with atheris.instrument_imports(include=["hostmot2", "mcap", "tomllib", "json"]):
        from fuzz.targets import TARGETS
    atheris.Setup([sys.argv[0], *arguments], TARGETS[name])
    atheris.Fuzz()


if __name__ == "__main__":
    if sys.argv[1] == "--all":
        sys.exit(run_all([f"-max_total_time={int(sys.argv[2])}"], TIMED))
    if sys.argv[1] == "--runs":
        sys.exit(run_all([f"-atheris_runs={int(sys.argv[2])}", *SAME], "runs"))
    run_one(sys.argv[1], sys.argv[2:])
