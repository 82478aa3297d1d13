"""A page of the documentation as something that runs: its fenced blocks, in order, in one session.

python tests/page.py PAGE.md      runs it in the present directory, output to stdout

Python blocks share their names, one with test functions is run by pytest; shell blocks share their exported
variables. Which blocks cannot run is said in the page:

    <!-- not run: needs a PCI card -->     before a block
    <!-- page: card 7i92+7i77 at 10.10.10.10 -->     a served card, in a network namespace of the page's own
    <!-- page: remote 8i20 -->     an emulated remote on a serial port, $COMPORT
    <!-- page: HM2_BOARD=emu://5i25+7i77x2 -->     another environment
"""

from __future__ import annotations

import doctest
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

LANGUAGES = ("python", "shell", "console", "toml", "json", "text")
"""What a block may be: console shows what commands print, and is compared; text is neither run nor read."""

FENCE = re.compile(r"^( *)(```+)(.*)$")
NOT_RUN = re.compile(r"<!-- not run: (.+) -->")
DIRECTIVE = re.compile(r"^<!-- page: (.+) -->$", re.MULTILINE)
KNOWN = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@dataclass(frozen=True)
class Block:
    """One fenced block; line: of its first line, not_run: why it cannot run here."""

    language: str
    text: str
    line: int
    not_run: str = ""


def blocks(page: Path) -> Iterator[Block]:
    """The fenced blocks of a page. Raises ValueError for one without an end."""
    lines = page.read_text(encoding="utf-8").splitlines()
    number, reason = 0, ""
    while number < len(lines):
        if opened := FENCE.match(lines[number]):
            indent, fence, language = opened.groups()
            start = number + 1
            number = start
            while number < len(lines) and lines[number].strip() != fence:
                number += 1
            if number == len(lines):
                raise ValueError(f"{page}:{start}: the block has no end")
            text = "\n".join(line.removeprefix(indent) for line in lines[start:number]) + "\n"
            yield Block(language.strip(), text, start + 1, reason)
        if lines[number].strip():
            marked = NOT_RUN.search(lines[number])
            reason = marked[1] if marked else ""
        number += 1


class Session:
    """Runs blocks one after the other. Raises what a block raises, AssertionError for other output."""

    def __init__(self, page: Path) -> None:
        self.page = page
        self.names: dict[str, object] = {"__name__": "__main__"}

    def run(self, block: Block) -> None:
        """Run one block."""
        print(f"---- {self.page.name}:{block.line} {block.language}", flush=True)
        getattr(self, f"_{block.language}")(block)

    def _python(self, block: Block) -> None:
        if re.search("^def test_", block.text, re.MULTILINE):
            Path(f"test_line_{block.line}.py").write_text(block.text)
            self._bash(f"python -m pytest -q -p no:cacheprovider test_line_{block.line}.py")
            return
        source = "\n" * (block.line - 1) + block.text  # errors then name the page's lines
        exec(compile(source, str(self.page), "exec"), self.names)

    def _shell(self, block: Block) -> None:
        self._bash(block.text)

    def _console(self, block: Block) -> None:
        for part in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
            command, _, shown = part.partition("\n")
            said = self._bash(command, output=subprocess.PIPE)
            print(f"$ {command}\n{said}", flush=True)
            if not doctest.OutputChecker().check_output(shown, said, KNOWN):
                raise AssertionError(f"line {block.line}: {command}\nshown:\n{shown}\nprinted:\n{said}")

    def _toml(self, block: Block) -> None:
        tomllib.loads(block.text)

    def _json(self, block: Block) -> None:
        json.loads(block.text)

    def _text(self, block: Block) -> None:
        """Only to be read."""

    def _bash(self, text: str, output: int | None = None) -> str:
        """Runs commands; what they export holds for the blocks that follow."""
        kept = Path(".page_environment").absolute()
        script = f"trap 'env -0 >{shlex.quote(str(kept))}' EXIT\n{text}"
        ran = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", script], stdout=output, text=True, check=False
        )
        os.environ.update(line.split("=", 1) for line in kept.read_text().split("\0") if "=" in line)
        if ran.returncode:
            raise AssertionError(f"exit status {ran.returncode} of:\n{text}")
        return ran.stdout or ""


def prepare(page: Path, around: ExitStack) -> None:
    """What the page's directives ask for. In a network namespace of the page's own, its ports are free."""
    if os.environ.pop("HM2_PAGE_ALONE", ""):
        subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    os.environ["HM2_BOARD"] = "emu://5i25+7i77"
    for directive in DIRECTIVE.findall(page.read_text(encoding="utf-8")):
        match directive.split():
            case ["card", spec, "at", address]:
                subprocess.run(["ip", "addr", "add", f"{address}/32", "dev", "lo"], check=True)
                serve(around, "hm2", "emulate", spec, "--listen", address)
            case ["remote", name]:
                ready = serve(around, "hm2", "emulate-remote", name, "--pty", "--state", "remote.json")
                os.environ["COMPORT"] = ready.split()[1]
            case [setting] if "=" in setting:
                os.environ.update([setting.split("=", 1)])
            case _:
                raise ValueError(f"{page}: unknown directive {directive!r}")


def serve(around: ExitStack, *command: str) -> str:
    """Starts what runs beside the page; the line it prints when it is ready."""
    server = around.enter_context(
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    )
    around.callback(server.terminate)
    assert server.stdout is not None
    return server.stdout.readline()


def main(page: Path) -> None:
    """Runs what can run of a page."""
    with ExitStack() as around:
        prepare(page, around)
        session = Session(page)
        for block in blocks(page):
            if not block.not_run:
                session.run(block)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
