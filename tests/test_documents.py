"""README and the pages of docs/: every block of code runs, or says in the page why it cannot."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tomllib
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path

import page as pages
import pytest

ROOT = Path(__file__).parent.parent
GENERATED = ("docs/reference/registers.md",)  # tables only
PAGES = sorted(
    str(path.relative_to(ROOT))
    for path in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"))
    if str(path.relative_to(ROOT)) not in GENERATED
)
BLOCKS = {name: list(pages.blocks(ROOT / name)) for name in PAGES}
RUN = [name for name in PAGES if any(not b.not_run and b.language != "text" for b in BLOCKS[name])]
NOT_RUN = [(name, block) for name in PAGES for block in BLOCKS[name] if block.not_run]


@cache
def namespaces() -> list[str]:
    """What puts a command into a network namespace of its own; nothing where that is not permitted."""
    command = ["unshare", "-rn"]
    try:
        tried = subprocess.run([*command, "ip", "link"], capture_output=True, check=False)
    except FileNotFoundError:
        return []
    return command if tried.returncode == 0 else []


@pytest.mark.parametrize(
    "name", [name if name == "README.md" else pytest.param(name, marks=pytest.mark.slow) for name in RUN]
)
def test_every_block_of_a_page_runs(name: str, tmp_path: Path) -> None:
    page = ROOT / name
    alone = namespaces()
    if not alone and "<!-- page: card" in page.read_text():
        pytest.skip("needs a network namespace (unshare -rn, ip)")
    command = [*alone, sys.executable, str(ROOT / "tests" / "page.py"), str(page)]
    inherited = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "HM2_BOARD")}
    environment = inherited | {
        "HM2_PAGE_ALONE": "1" if alone else "",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "MPLBACKEND": "Agg",
    }
    said = tmp_path / "said.txt"  # not a pipe: what a page leaves running would hold it open
    with said.open("w") as output:
        running = subprocess.Popen(
            command, cwd=tmp_path, env=environment, stdout=output, stderr=output, start_new_session=True
        )
        try:
            status = running.wait(timeout=240)
        finally:
            with suppress(ProcessLookupError):  # nothing was left running
                os.killpg(running.pid, signal.SIGKILL)
    assert status == 0, said.read_text()[-6000:]


@pytest.mark.parametrize(("name", "block"), [pytest.param(n, b, id=f"{n}:{b.line}") for n, b in NOT_RUN])
def test_a_block_that_cannot_run_says_why(name: str, block: pages.Block) -> None:
    """Skipped, so that pytest counts them and repeats the reasons."""
    assert len(block.not_run) >= 10
    pytest.skip(block.not_run)


@pytest.mark.parametrize("name", PAGES)
def test_every_block_is_fenced_and_names_its_language(name: str) -> None:
    unknown = [
        (block.line, block.language) for block in BLOCKS[name] if block.language not in pages.LANGUAGES
    ]
    assert not unknown
    text = (ROOT / name).read_text()
    outside = re.sub(r"^ *```.*?^ *```$", "", text, flags=re.DOTALL | re.MULTILINE)
    # a paragraph that is indented by four without a list above it
    assert not re.findall(r"\n\n(?! *[-*\d])[^\n]*[.:]\n\n    \S[^\n]*", outside)


def test_the_page_on_installing_lists_base_and_extras() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    text = (ROOT / "docs" / "start" / "install.md").read_text()
    table = dict(re.findall(r"^\| `hostmot2(?:\[(\w+)\])?` \| ([^|]+) \|", text, re.MULTILINE))
    wanted = {"": project["dependencies"]} | project["optional-dependencies"]
    assert set(table) == set(wanted)
    for extra in set(wanted) - {"all"}:
        others = [re.sub(r"^hostmot2\[(\w+)\]", r"what `\1` brings", each) for each in wanted[extra]]
        packages = [re.split("[>=]", requirement)[0].strip() for requirement in others]
        assert table[extra] == ", ".join(packages), extra


@pytest.mark.parametrize("name", [name for name in PAGES if "/" not in name])
def test_links_of_a_page_outside_the_site_lead_somewhere(name: str) -> None:
    """Those between the pages of docs/ are checked when the site is built."""
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", (ROOT / name).read_text())
    assert not [link for link in links if not (ROOT / link).exists()]


@pytest.mark.parametrize("package", ["sserial", "lbp", "recording", "live", "emulator"])
def test_what_public_classes_inherit_is_on_a_page_of_the_api(package: str) -> None:
    """mkdocstrings shows what a class itself defines."""
    public = import_module(f"hostmot2.{package}")
    shown = "\n".join(page.read_text() for page in (ROOT / "docs" / "reference" / "api").glob("*.md"))
    classes = [getattr(public, name) for name in public.__all__ if isinstance(getattr(public, name), type)]
    bases = {base for each in classes if not issubclass(each, Exception) for base in each.__mro__[1:]}
    ours = {base for base in bases if base.__module__.startswith("hostmot2.")} - set(classes)
    missing = [f"{base.__module__}.{base.__qualname__}" for base in ours]
    assert not [name for name in sorted(missing) if f"::: {name}\n" not in shown]
