"""Bounded proofs: every `prove_NAME` function of tests/c/proof, by the model checker ESBMC.

python tools/prove.py [NAME...]

ESBMC (Apache 2.0) is one static program; the package `ethcheck` on PyPI carries it. It is unpacked from it
into build/; nothing of the package itself is installed. A comment `proof: OPTIONS` stands above a function.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PLACE = ROOT / "build" / "proof"
PROOFS = ROOT / "tests" / "c" / "proof"
PACKAGE = "ethcheck==0.1.4"
SHA256 = "8031781735d2e6dc04c5789aed539ac1475ecfee0d50dab3282a5b37fd04663e"  # of the program in it
INCLUDES = ("-I", "csrc", "-I", "tests/c/proof")
UNWIND = 18
LIMIT_SECONDS = 400
FUNCTION = re.compile(
    r"(?:/\* proof: (?P<options>.*?) \*/\n)?^void (?P<name>prove_\w+)\(void\)", re.MULTILINE
)


class NoModelChecker(Exception):
    """ESBMC is not here and cannot be had."""


@dataclass(frozen=True)
class Proof:
    """One function, and what the checker is told about it."""

    file: Path
    name: str
    options: tuple[str, ...]


def proofs() -> Iterator[Proof]:
    """All of them, in the order of the files."""
    for file in sorted(PROOFS.glob("prove_*.c")):
        for found in FUNCTION.finditer(file.read_text()):
            yield Proof(file.relative_to(ROOT), found["name"], tuple((found["options"] or "").split()))


def esbmc() -> str:
    """Where the checker is: on PATH, or unpacked from its package. Raises NoModelChecker."""
    program = PLACE / "esbmc"
    if found := shutil.which("esbmc"):
        return found
    if not program.exists():
        PLACE.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "-d", str(PLACE), PACKAGE]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise NoModelChecker(f"ESBMC could not be fetched ({PACKAGE}): {done.stderr.strip()[-300:]}")
        (wheel,) = PLACE.glob("ethcheck-*.whl")
        with zipfile.ZipFile(wheel) as archive:
            (member,) = (name for name in archive.namelist() if name.endswith("/bin/esbmc"))
            content = archive.read(member)
        wheel.unlink()
        if hashlib.sha256(content).hexdigest() != SHA256:
            raise NoModelChecker(f"{PACKAGE} holds another program than it did")
        program.write_bytes(content)
        program.chmod(0o755)
    if subprocess.run([program, "--version"], capture_output=True, check=False).returncode:
        raise NoModelChecker("ESBMC does not run here")
    return str(program)


def prove(program: str, proof: Proof) -> str:
    """Empty if it holds for everything within the bounds, else what the checker says."""
    unwind = () if "--unwind" in proof.options else ("--unwind", str(UNWIND))
    command = [program, str(proof.file), *INCLUDES, "--function", proof.name, *unwind, *proof.options]
    try:
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        return f"no answer within {LIMIT_SECONDS} s"
    output = done.stdout + done.stderr
    if done.returncode == 0 and "VERIFICATION SUCCESSFUL" in output:
        return ""
    violated = output.find("Violated property")
    return output[violated:] if violated >= 0 else output[-2000:]


def main() -> int:
    """Proves what is named, or all."""
    names = set(sys.argv[1:])
    program, failed = esbmc(), 0
    for proof in proofs():
        if names and proof.name not in names:
            continue
        start = time.monotonic()
        problem = prove(program, proof)
        failed += bool(problem)
        print(
            f"{'FAILED' if problem else 'proved'} {proof.name} ({time.monotonic() - start:.1f} s)", flush=True
        )
        print(problem, end="")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
