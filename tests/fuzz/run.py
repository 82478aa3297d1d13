"""Looks for inputs that break a target, under coverage guidance.

python tests/fuzz/run.py TARGET [libFuzzer's options and corpus folders]
python tests/fuzz/run.py --all SECONDS     each target for so long; what it finds goes to build/fuzz
"""

import re
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
PLACE = TESTS.parent / "build" / "fuzz"


def run_all(seconds: int) -> int:
    failed = 0
    for corpus in sorted((TESTS / "fuzz" / "corpus").iterdir()):
        name, found = corpus.name, PLACE / corpus.name
        found.mkdir(parents=True, exist_ok=True)
        options = [f"-max_total_time={seconds}", "-print_final_stats=1", f"-artifact_prefix={PLACE}/{name}-"]
        command = [sys.executable, __file__, name, *options, str(found), str(corpus)]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        log = done.stdout.decode("utf-8", "replace")
        (PLACE / f"{name}.log").write_text(log)
        inputs = re.search(r"number_of_executed_units: *(\d+)", log)
        if done.returncode:
            print(log[-4000:])
            failed = 1
        print(
            f"{name}: {'FAILED' if done.returncode else inputs[1] + ' inputs' if inputs else '?'}", flush=True
        )
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
        sys.exit(run_all(int(sys.argv[2])))
    run_one(sys.argv[1], sys.argv[2:])
