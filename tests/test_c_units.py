"""Every tests/c/test_*.c is a program of its own, built with the whole core under the sanitizers and run.

A file may include parts of the core as `../../csrc/name.c` to test them from the inside, and may ask for
more with a comment line: `link: OPTIONS` for the linker, or `no sanitizers`. Programs with threads say `also
under the thread sanitizer`, and are built with the driver's half of the core and run a second time.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
BUILD = ROOT / "build" / "c_units"
TESTS = sorted((ROOT / "tests" / "c").glob("test_*.c"))
COMPILER = os.environ.get("CC", "ccache gcc" if shutil.which("ccache") else "gcc").split()
WARNINGS = "-Wall -Wextra -Wconversion -Wshadow -Wstrict-prototypes -Werror"
FLAGS = f"-std=c11 -D_GNU_SOURCE -g -O1 -pthread {WARNINGS} -Icsrc -Itests/c"
SANITIZERS = "-fsanitize=address,undefined -fno-sanitize-recover=all"
# the fences of memory_map.c mean nothing to it, and no thread shares what they order
THREAD_SANITIZER = "-fsanitize=thread -Wno-tsan"
SKIPPED = 77
THREADED = [test for test in TESTS if "/* also under the thread sanitizer */" in test.read_text()]


def run(command):
    """Skips the test if the program says, by its status, that this machine does not let it show a thing."""
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    if done.returncode == SKIPPED:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stdout + done.stderr


def newest_header():
    return max(header.stat().st_mtime for header in (ROOT / "csrc").rglob("*.h"))


def object_file(source, flags):
    """Compiled unless there is one newer than the source and every header. Safe beside other processes."""
    kind = "sanitized" if SANITIZERS in flags else "threads" if THREAD_SANITIZER in flags else "plain"
    folder = BUILD / kind
    target = folder / (str(source.relative_to(ROOT)).replace("/", "_") + ".o")
    if target.exists() and target.stat().st_mtime > max(source.stat().st_mtime, newest_header()):
        return target
    folder.mkdir(parents=True, exist_ok=True)
    made = target.with_name(f"{target.stem}-{os.getpid()}.o")  # beside it: --coverage keeps its counts there
    run([*COMPILER, *flags.split(), "-c", source, "-o", made])
    made.replace(target)
    return target


@pytest.mark.parametrize("source", TESTS, ids=[test.stem for test in TESTS])
def test_c_unit(source, tmp_path):
    text = source.read_text()
    flags = FLAGS if "/* no sanitizers */" in text else f"{FLAGS} {SANITIZERS}"
    options = re.search(r"/\* link: (.*?) \*/", text)
    included = {ROOT / name for name in re.findall(r'#include "\.\./\.\./(csrc/.*?\.c)"', text)}
    core = sorted(set((ROOT / "csrc").rglob("*.c")) - included)
    program = tmp_path / source.stem
    run([*COMPILER, *flags.split(), "-c", source, "-o", tmp_path / "test.o"])
    objects = [tmp_path / "test.o", *(object_file(each, flags) for each in core)]
    run([*COMPILER, *flags.split(), *objects, *(options[1].split() if options else []), "-lm", "-o", program])
    run([program])


@pytest.mark.parametrize("source", THREADED, ids=[test.stem for test in THREADED])
def test_c_unit_under_the_thread_sanitizer(source, tmp_path):
    flags = f"{FLAGS} {THREAD_SANITIZER}"
    driver = sorted(file for file in (ROOT / "csrc").glob("*.c") if file.name != "_core.c")
    program = tmp_path / source.stem
    run([*COMPILER, *flags.split(), "-c", source, "-o", tmp_path / "test.o"])
    objects = [tmp_path / "test.o", *(object_file(each, flags) for each in driver)]
    run([*COMPILER, *flags.split(), *objects, "-lm", "-o", program])
    run([program])
