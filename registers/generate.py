"""Compiles registers/*.rdl and writes the C header, the Python module and the reference document.

python registers/generate.py            writes the files
python registers/generate.py --check    fails if a committed file differs
"""

import argparse
import subprocess
import sys
from pathlib import Path

from description import compile_description
from write_c import c_header, check_names
from write_docs import reference
from write_python import python_module

ROOT = Path(__file__).resolve().parent.parent
HEADER = ROOT / "csrc" / "registers.h"
MODULE = ROOT / "hostmot2" / "registers.py"
REFERENCE = ROOT / "docs" / "reference" / "registers.md"


def ruff_format(code: str) -> str:
    """The Python module as ruff format leaves it."""
    command = [sys.executable, "-m", "ruff", "format", "--stdin-filename", str(MODULE), "-"]
    return subprocess.run(command, input=code, stdout=subprocess.PIPE, text=True, check=True, cwd=ROOT).stdout


def outputs() -> dict[Path, str]:
    """Every generated file with its content."""
    description = compile_description()
    header = c_header(description)
    check_names(header, (ROOT / "csrc" / "hm2.h").read_text())
    return {
        HEADER: header,
        MODULE: ruff_format(python_module(description)),
        REFERENCE: reference(description),
    }


def main() -> int:
    """Writes or checks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--check", action="store_true", help="fail if a committed file differs")
    check = parser.parse_args().check
    stale = False
    for path, content in outputs().items():
        if path.exists() and path.read_text() == content:
            continue
        stale = True
        print(f"{path.relative_to(ROOT)}: {'differs from the register description' if check else 'written'}")
        if not check:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(content)
    return 1 if check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
