"""Functions of at most 40 lines, files of at most 400. Exceptions are in pyproject.toml.

python tools/sizes.py
"""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FUNCTION = 40
FILE = 400
PLACES = ("csrc/**/*.c", "csrc/**/*.h", "hostmot2/*.c", "hostmot2/**/*.py", "registers/*.py", "tools/*.py")
GENERATED = {"csrc/registers.h", "hostmot2/registers.py", "hostmot2/_core.c"}
HEAD = re.compile(r"^[A-Za-z_].*?\b(\w+)\(")  # a line at the margin that names a function


def c_functions(text: str) -> Iterator[tuple[str, int]]:
    """Names and lengths, braces included. The opening brace must be at the margin or ending the head."""
    name, start, inside = "", 0, False
    for number, line in enumerate(text.splitlines(), 1):
        if not inside:
            head = HEAD.match(line)
            if head:
                name = head[1]
            if line == "{" or (head and line.endswith("{")):
                start, inside = number, True
        elif line == "}":
            yield name, number - start + 1
            inside = False
        elif line.startswith("}"):  # the end of a table or type
            inside = False


def python_functions(text: str) -> Iterator[tuple[str, int]]:
    """Names and lengths without the docstring."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.body[1:] if ast.get_docstring(node) and len(node.body) > 1 else node.body
            assert node.end_lineno
            yield node.name, node.end_lineno - body[0].lineno + 2


def too_long(path: Path) -> Iterator[tuple[str, int, int]]:
    """What is longer than it may be: its name as in the allow-list, its length, the limit."""
    text = path.read_text()
    name = path.relative_to(ROOT).as_posix()
    lines = text.count("\n")
    if lines > FILE:
        yield name, lines, FILE
    functions = python_functions(text) if path.suffix == ".py" else c_functions(text)
    for function, length in functions:
        if length > FUNCTION:
            yield f"{name}:{function}", length, FUNCTION


def main() -> int:
    """Lists what is too long and what need not be excepted any more."""
    allowed: dict[str, str] = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["sizes"]["allow"]
    found = {}
    for place in PLACES:
        for path in sorted(ROOT.glob(place)):
            if path.relative_to(ROOT).as_posix() not in GENERATED:
                found.update({name: (length, limit) for name, length, limit in too_long(path)})
    failed = False
    for name, (length, limit) in found.items():
        if name not in allowed:
            print(f"{name}: {length} lines, at most {limit}")
            failed = True
    for name in sorted(set(allowed) - set(found)):
        print(f"{name}: excepted in pyproject.toml but short enough")
        failed = True
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
