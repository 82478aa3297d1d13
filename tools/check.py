"""Everything `make check` checks, two steps at a time; prints what failed and, loudly, what was skipped.

python tools/check.py [STEP...]     all steps, or those named
python tools/check.py --list
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import threading
from importlib.metadata import version
from pathlib import Path

import prove
from steps import ROOT, SANITIZER_REPORT, STEPS, Failed, Repeat, Skipped, last_line, outcomes_of, run, step

BUILD = ROOT / "build"
PYTHON = sys.executable
PYTEST = ("-m", "pytest", "-q", "-rfE")  # what was skipped, `make test` has told
FUZZ_RUNS = 20_000
FUZZ_PYTHON_RUNS = 2_000
MAKE = ("make", "--no-print-directory", "-j2", "-f", "tests/c/Makefile")
SANITIZE = "-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer -g"


SETUPTOOLS = threading.Lock()  # two builds in one tree would share hostmot2.egg-info
CLANG = threading.Lock()


def clang() -> None:
    """clang with its fuzzer runtime, installed if that is possible; else Skipped with the reason."""
    with CLANG:
        reason = clang_missing()
        if reason and os.geteuid() == 0 and shutil.which("apt-get"):
            apt("update")
            # where the runtime has no package of its own it comes with clang
            if not apt("install", "-y", "clang", "libclang-rt-dev"):
                apt("install", "-y", "clang")
            reason = clang_missing()
        if reason:
            raise Skipped(f"{reason}, and apt-get as root could not install it")


def apt(*arguments: str) -> bool:
    """Runs apt-get; whether it worked."""
    env = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    return (
        subprocess.run(["apt-get", "-qq", *arguments], capture_output=True, check=False, env=env).returncode
        == 0
    )


def clang_missing() -> str:
    """What keeps clang from building a fuzz target; nothing if it can."""
    if not shutil.which("clang"):
        return "there is no clang"
    program = "int LLVMFuzzerTestOneInput(void); int LLVMFuzzerTestOneInput(void) { return 0; }"
    command = ["clang", "-fsanitize=fuzzer,address,undefined", "-x", "c", "-", "-o", os.devnull]
    built = subprocess.run(command, input=program, capture_output=True, text=True, check=False)
    return "" if built.returncode == 0 else "clang has no fuzzer runtime (libclang-rt-dev)"


# ---- tests under sanitizers ---------------------------------------------------------------------


def sanitized_package() -> tuple[Path, dict[str, str]]:
    """The package with a sanitized extension in a place of its own, and the environment to run it."""
    place = BUILD / "sanitized" / "lib"
    with SETUPTOOLS:
        flags = {"CC": "gcc", "CFLAGS": f"{SANITIZE} -O1", "LDFLAGS": "-fsanitize=address,undefined"}
        base = str(BUILD / "sanitized")
        run(PYTHON, "setup.py", "-q", "build", "--build-base", base, "--build-lib", str(place), env=flags)
    # libstdc++ too: the address sanitizer must know it before numpy's C++ throws
    runtime = [run("gcc", f"-print-file-name={name}").strip() for name in ("libasan.so", "libstdc++.so.6")]
    return place, {
        "LD_PRELOAD": " ".join(runtime),
        "ASAN_OPTIONS": "detect_leaks=0",  # Python itself never frees all
        "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1",
        "PYTHONPATH": f"{place}{os.pathsep}{ROOT}",
        "PYTHONMALLOC": "malloc",  # so that a wrong pointer into Python's memory is seen as well
    }


@step
def tests_sanitized() -> str:
    """The quick tests with the extension under address and undefined-behaviour sanitizers."""
    place, env = sanitized_package()
    where = run(PYTHON, "-P", "-c", "import hostmot2._core as core; print(core.__file__)", env=env, cwd=BUILD)
    if not where.strip().endswith(".so") or str(place) not in where:
        raise Failed(f"the sanitized extension was not the one loaded: {where}")
    command = [PYTHON, "-P", *PYTEST, "-n", "2", "-m", "not slow", "-p", "no:cacheprovider"]
    options = ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(ROOT), str(ROOT / "tests")]
    # the C units are sanitized by themselves; a test that counts allocations needs an allocator of its own
    apart = [f"--ignore={ROOT}/tests/test_{name}.py" for name in ("c_units", "no_allocation")]
    # --capture=sys: pytest keeps no crashed worker's stderr, and there the sanitizers speak
    try:
        return last_line(run(*command, *options, *apart, "--capture=sys", env=env, cwd=BUILD))
    except Failed as first:
        raise repeat_alone(first, [*command, *options[:-1], "--capture=sys"], env) from first


def repeat_alone(first: Failed, command: list[str], env: dict[str, str]) -> Repeat:
    """Once more what failed, alone: real-time tests can be hit by a stall, a finding comes back."""
    names = re.findall(r"^FAILED (\S+?)(?: - .*)?$", str(first), re.MULTILINE)
    if not names or SANITIZER_REPORT.search(str(first)):
        raise first
    tests = [str(ROOT / "tests" / name.split("tests/", 1)[-1]) for name in names]

    def again() -> str:
        output = run(*command, *tests, env=env, cwd=BUILD)
        return f"{last_line(output)} (REPEATED after a failure: {', '.join(names)})"

    return Repeat(str(first), again)


@step
def tests_slow() -> str:
    """The tests marked slow."""
    command = [PYTHON, *PYTEST, "-m", "slow"]
    try:
        return last_line(run(*command, "-n", "2", codes=(0, 5)))
    except Failed as first:
        raise repeat_alone(first, command, {}) from first


@step
def fuzz() -> str:
    """Every libFuzzer target of tests/c/fuzz on the same inputs each time; `make fuzz` looks for new ones."""
    clang()
    output = run(*MAKE, "fuzz-runs", f"RUNS_EACH={FUZZ_RUNS}")
    return "inputs: " + ", ".join(output.splitlines())


@step
def proof() -> str:
    """Packing, scaling and the LBP16 codec hold for all inputs within bounds, says a model checker."""
    try:
        prove.esbmc()
    except prove.NoModelChecker as reason:
        raise Skipped(str(reason)) from None
    return f"{len(run(PYTHON, 'tools/prove.py').splitlines())} proofs by ESBMC"


@step
def mutant_list() -> str:
    """Every mistake of tools/mutants.toml can still be made."""
    return f"{len(run(PYTHON, 'tools/mutants.py', '--list').splitlines())} mistakes"


@step
def fuzz_python() -> str:
    """Every target of tests/fuzz under atheris, on the same inputs each time."""
    if subprocess.run([PYTHON, "-c", "import atheris"], capture_output=True, check=False).returncode:
        try:
            run(PYTHON, "-m", "pip", "install", "-q", "--group", f"{ROOT}/pyproject.toml:fuzz")
        except Failed as problem:
            raise Skipped(f"atheris cannot be installed for this Python: {str(problem)[-300:]}") from None
    return ", ".join(run(PYTHON, "tests/fuzz/run.py", "--runs", str(FUZZ_PYTHON_RUNS)).splitlines())


@step
def numba() -> str:
    """Controllers compiled by numba, where there is one for this Python and this numpy."""
    if subprocess.run([PYTHON, "-c", "import numba"], capture_output=True, check=False).returncode:
        here = f"numpy=={version('numpy')}"  # what the other tests have stays as it is
        try:
            run(PYTHON, "-m", "pip", "install", "-q", here, "--group", f"{ROOT}/pyproject.toml:numba")
        except Failed as problem:
            raise Skipped(f"numba cannot be installed for this Python: {str(problem)[-300:]}") from None
    return last_line(run(PYTHON, "-m", "pytest", "-q", "tests/test_engine_controller.py", "-k", "numba"))


@step
def c_units() -> str:
    """The C unit tests under sanitizers."""
    return last_line(run(PYTHON, "-m", "pytest", "-q", "tests/test_c_units.py"))


@step
def c_analyze() -> str:
    """gcc's static analyzer on every C file."""
    run(*MAKE, "-k", "analyze")
    return "gcc -fanalyzer"


@step
def c_strict() -> str:
    """Strict warnings as errors on every C file."""
    run(*MAKE, "-k", "strict", f"PYTHON_INCLUDE={sysconfig.get_path('include')}")
    return "-Wall -Wextra -Wconversion -Wshadow -Wstrict-prototypes -Werror"


# ---- packages -----------------------------------------------------------------------------------


@step
def package() -> str:
    """sdist, a wheel from it, abi3audit, exported symbols, the wheel in clean environments."""
    out = BUILD / "dist"
    shutil.rmtree(out, ignore_errors=True)
    with SETUPTOOLS:
        run(PYTHON, "-m", "build", "--no-isolation", "--outdir", str(out))
    (wheel,) = out.glob("*.whl")
    if "-cp311-abi3-" not in wheel.name:
        raise Failed(f"{wheel.name} is not a cp311-abi3 wheel")
    run(PYTHON, "-m", "abi3audit", "--strict", str(wheel))
    check_published()
    place = out / "installed"
    run(PYTHON, "-m", "pip", "install", "-q", "--no-deps", "--target", str(place), str(wheel))
    for extension in (place / "hostmot2").glob("*.so"):
        name = extension.name.split(".")[0]
        exported = {
            line.split()[-1] for line in run("nm", "-D", "--defined-only", str(extension)).splitlines()
        }
        if exported - {"_init", "_fini"} != {f"PyInit_{name}"}:
            raise Failed(f"{name} exports {sorted(exported)}; it should be PyInit_{name} alone")
    program = "import hostmot2; print(hostmot2.__file__, hostmot2.open('emu://5i25+7i77').idrom.board_name)"
    said = run(PYTHON, "-P", "-c", program, env={"PYTHONPATH": str(place)}, cwd=out)
    if str(place) not in said:
        raise Failed(f"not the installed wheel: {said}")
    return f"{wheel.name}: {last_line(run(PYTHON, 'tools/packages.py', str(wheel), str(out / 'clean')))}"


def check_published() -> None:
    """cibuildwheel understands its configuration: one wheel for each processor."""
    command = [PYTHON, "-m", "cibuildwheel", "--print-build-identifiers", "--platform", "linux"]
    planned = run(*command, "--archs", "x86_64,aarch64").split()
    if planned != ["cp311-manylinux_x86_64", "cp311-manylinux_aarch64"]:
        raise Failed(f"cibuildwheel would build {planned}")


@step
def site() -> str:
    """The documentation, built strictly: no dead link, no page without its docstrings, nothing fetched."""
    place = ROOT / "site"
    run(PYTHON, "-m", "mkdocs", "build", "-q", "--strict", env={"NO_MKDOCS_2_WARNING": "1"})
    pages = list(place.rglob("*.html"))
    fetched = re.compile(r'<(?:script|img|iframe)[^>]+src="?https?:|<link[^>]+stylesheet[^>]+href="?https?:')
    for page in pages:
        if found := fetched.search(page.read_text(encoding="utf-8")):
            raise Failed(f"{page.relative_to(ROOT)} fetches: {found[0]}")
    return f"{len(pages)} pages"


@step
def editable_install() -> str:
    """The environment's own install is editable and works from anywhere."""
    program = "import hostmot2, hostmot2._core as core; print(core.__file__)"
    said = run(PYTHON, "-P", "-c", program, cwd=Path("/"), env={"PYTHONPATH": ""}).strip()
    if Path(said).parent != ROOT / "hostmot2":
        raise Failed(f"imported from {said}, not from {ROOT}")
    return said


# ---- style and structure ------------------------------------------------------------------------


@step
def types() -> str:
    """mypy --strict."""
    run(PYTHON, "-m", "mypy", "--strict", "registers/generate.py")
    for generator in sorted(ROOT.glob("docs/generate_*.py")):
        run(PYTHON, "-m", "mypy", "--strict", str(generator))
    run(PYTHON, "-m", "mypy", "--strict", *sorted(map(str, (ROOT / "tools").glob("*.py"))))
    return last_line(run(PYTHON, "-m", "mypy"))


@step
def imports() -> str:
    """The dependency rule of ARCHITECTURE.md."""
    return last_line(run(str(Path(PYTHON).parent / "lint-imports"), "--no-cache"))


@step
def lint() -> str:
    """ruff check."""
    return last_line(run(PYTHON, "-m", "ruff", "check", "."))


@step
def format() -> str:
    """ruff format."""
    return last_line(run(PYTHON, "-m", "ruff", "format", "--check", "."))


@step
def registers() -> str:
    """The generated files follow from registers/*.rdl."""
    run(PYTHON, "registers/generate.py", "--check")
    return "no drift"


@step
def generated_pages() -> str:
    """The pages that docs/generate_*.py write name what exists and are up to date."""
    generators = sorted(ROOT.glob("docs/generate_*.py"))
    for generator in generators:
        run(PYTHON, str(generator), "--check")
    return f"no drift from {len(generators)} generators"


@step
def sizes() -> str:
    """No function and no file is too long."""
    run(PYTHON, "tools/sizes.py")
    return "functions and files"


# ---- the run ------------------------------------------------------------------------------------


def main() -> int:
    """Runs the steps and sums up."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("step", nargs="*", help="steps to run, all if none is named")
    parser.add_argument("--list", action="store_true", help="list the steps")
    arguments = parser.parse_args()
    if arguments.list:
        print("\n".join(f"{name:<18} {function.__doc__}" for name, function in STEPS.items()))
        return 0
    unknown = set(arguments.step) - set(STEPS)
    if unknown:
        parser.error(f"unknown step: {', '.join(sorted(unknown))}")
    outcomes = []
    for outcome in outcomes_of(arguments.step or list(STEPS)):
        outcomes.append(outcome)
        text = outcome.text if outcome.verdict == "ok" else ""
        print(f"{outcome.verdict:<8} {outcome.name:<18} {outcome.seconds:6.1f} s  {text}", flush=True)
    for outcome in outcomes:
        if outcome.verdict in ("FAILED", "REPEAT"):
            print(f"\n==== {outcome.verdict} {outcome.name}\n{outcome.text}")
    for outcome in outcomes:
        if outcome.verdict == "SKIPPED":
            print(f"\n**** SKIPPED {outcome.name}: {outcome.text}")
    return 1 if any(outcome.verdict == "FAILED" for outcome in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
