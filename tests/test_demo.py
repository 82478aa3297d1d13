"""The demo and the README's examples run as they are printed."""

import re
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from hostmot2.demo import demo, draw

ROOT = Path(__file__).parent.parent


def test_the_demo_finds_starts_cycles_and_times_a_7i77(tmp_path: Path) -> None:
    picture = tmp_path / "latency.png"
    arguments = ["--board", "emu://5i25+7i77?wire=off", "--count", "50", "-o", str(picture)]
    result = CliRunner().invoke(demo, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    assert "5I25" in result.output
    assert "after 50 cycles, 0 of them failed" in result.output
    assert re.search(r"min +p50 +p99 +p99\.9 +max", result.output)
    if pytest.importorskip("matplotlib"):
        assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_demo_refuses_to_time_a_card_without_remotes(tmp_path: Path) -> None:
    from hostmot2 import dump
    from hostmot2.opening import open_board

    with open_board("emu://5i25+7i77") as board:
        dump.save(dump.take(board), tmp_path / "empty.hm2dump")
    result = CliRunner().invoke(demo, ["--board", f"emu://{tmp_path}/empty.hm2dump?clock=virtual"])
    assert result.exit_code != 0
    assert "no remote answers" in result.output


@pytest.mark.parametrize("name", ["README.md"])
def test_python_examples_of_the_documents_run(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / name).read_text(), re.MULTILINE | re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, name, "exec"), {})


def test_without_matplotlib_there_is_no_picture_and_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("matplotlib", "matplotlib.figure"):
        monkeypatch.setitem(sys.modules, name, None)
    assert not draw({}, tmp_path / "latency.png")
    assert "hostmot2[plot]" in capsys.readouterr().err
    assert not (tmp_path / "latency.png").exists()


def test_the_emulated_card_is_timed_without_its_wire_as_well(tmp_path: Path) -> None:
    arguments = ["--count", "5", "-o", str(tmp_path / "latency.png")]
    result = CliRunner().invoke(demo, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    assert "driver alone" in result.output
