"""Help that teaches: every command has examples, every example works; what reports has --json."""

from __future__ import annotations

import contextlib
import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

import hostmot2
from hostmot2 import recording
from hostmot2.cli import main
from hostmot2.cli.main import COMMANDS, hm2
from hostmot2.cli.session import Session

SILENT = {"emulate", "emulate-remote", "completion", "monitor", "live"}
"""They serve, show or print a script until they are ended: nothing to report as a document."""


def leaves(group: click.Group, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    context = click.Context(group, info_name="hm2", obj=Session())
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from leaves(command, (*path, name))
        else:
            yield (*path, name), command


LEAVES = dict(leaves(hm2))
GROUPS = sorted({path[:1] for path in LEAVES if len(path) > 1})
INTERFACE = (
    "info", "pins", "modules", "discover", "peek", "poke", "dump", "diff", "sserial/scan", "sserial/start",
    "sserial/stop", "sserial/status", "sserial/counters", "param/list", "param/get", "param/set",
    "param/save", "param/backup", "param/restore", "param/diff", "rpd", "wpd", "uflbp", "emulate",
    "emu/get", "emu/set", "emulate-remote", "bench", "record", "play", "plot", "explain", "doctor",
    "setup/udev", "setup/rt", "setup/net", "ip",
    "flash/info", "flash/backup", "flash/verify", "flash/write", "reload",
)  # fmt: skip


def examples(command: click.Command) -> list[str]:
    text = (command.help or "").partition("Examples:\n")[2]
    return [line.strip() for line in text.splitlines() if line.strip().startswith("hm2 ")]


@pytest.mark.parametrize("name", INTERFACE)
def test_every_command_of_the_interface_is_there(name: str) -> None:
    assert tuple(name.split("/")) in LEAVES


@pytest.mark.parametrize("path", LEAVES, ids="-".join)
def test_every_command_has_examples(path: tuple[str, ...]) -> None:
    found = examples(LEAVES[path])
    assert found, f"hm2 {' '.join(path)} --help has no examples"
    assert all(re.search(r"\b" + r"\b.* ".join(path) + r"\b", line) for line in found), found


@pytest.mark.parametrize("path", LEAVES, ids="-".join)
def test_examples_name_options_that_exist(path: tuple[str, ...]) -> None:
    for line in examples(LEAVES[path]):
        words = shlex.split(line, comments=True)[1:]
        command: click.Command = hm2
        while True:
            context = click.Context(command, info_name="hm2", obj=Session())
            parser = command.make_parser(context)
            parser.allow_interspersed_args = not isinstance(command, click.Group)
            _, words, _ = parser.parse_args(list(words))
            if not isinstance(command, click.Group):
                break
            found = command.get_command(context, words[0])
            assert found is not None, line
            command, words = found, words[1:]
        assert command is LEAVES[path], line


@pytest.mark.parametrize("path", [path for path in LEAVES if path[0] not in SILENT], ids="-".join)
def test_every_command_that_reports_has_json(path: tuple[str, ...]) -> None:
    assert any("--json" in parameter.opts for parameter in LEAVES[path].params)


@pytest.mark.parametrize("path", [(), *LEAVES, *GROUPS], ids=" ".join)
def test_help_fits_and_says_all(path: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main([*path, "--help"])
    assert end.value.code == 0
    out = capsys.readouterr().out
    assert out.startswith("Usage: hm2")
    assert "\b" not in out
    assert not re.search(r"^\s+\S+ {2,}.*\.\.\.$", out, re.MULTILINE), "a short help is cut off"


def test_the_list_of_commands_has_them_all(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    out = capsys.readouterr().out
    assert all(re.search(rf"^  {name} ", out, re.MULTILINE) for name in COMMANDS)


# ---- examples at work

NEEDS_MORE = (
    "10.10.10.10",
    "192.168.",
    "pci://",
    "/dev/",
    "/tmp/card",
    "--subnet",
    "bench",
    "discover",
    "setup ",
    "doctor",
)
"""Hardware, a served card, or minutes: those are tested where they belong."""

RUN = sorted(
    line
    for path, command in LEAVES.items()
    if path[0] not in SILENT - {"completion"}
    for line in examples(command)
    if not any(word in line for word in NEEDS_MORE)
)
STATUS = {"hm2 poke 0x1104 0x155": 2}
"""Examples that show a refusal."""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the files that examples speak of."""
    place = tmp_path_factory.mktemp("examples")
    for name in ("8I20_A50.BIN", "7I77_A15.BIN"):
        (place / name).write_bytes(bytes(0x400) + b"\xa5" * 0x400)
    with hostmot2.open("emu://5i25+7i77?clock=virtual") as board:
        hostmot2.dump.save(hostmot2.dump.take(board), place / "before.hm2dump")
        board.sserial.start(0x03).raise_for_failed()
        engine = board.engine(1000)
        with recording.record(engine, place / "run.mcap"), engine:
            for _ in range(200):
                engine.step()
    text = (place / "before.hm2dump").read_text()
    (place / "after.hm2dump").write_text(text.replace("1104 00000000", "1104 00000155"))
    with contextlib.chdir(place), pytest.raises(SystemExit):
        main(["--board", "emu://5i25+7i77?clock=virtual", "param", "backup", "0.0", "7i77.toml"])
    return place


@pytest.mark.parametrize("line", RUN)
@pytest.mark.parametrize("as_json", [False, True], ids=["text", "json"])
def test_examples_work(
    line: str,
    as_json: bool,
    place: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(place)
    monkeypatch.setenv("HM2_BOARD", "emu://5i25+7i77?clock=virtual")
    monkeypatch.setenv("XDG_STATE_HOME", str(place))
    words = shlex.split(line, comments=True)[1:]
    if "completion" in words and as_json:
        pytest.skip("prints a script")
    with pytest.raises(SystemExit) as end:
        main(["--json", *words] if as_json else words)
    out, err = capfd.readouterr()
    assert int(end.value.code or 0) == STATUS.get(line, 0), err
    assert "Traceback" not in err
    assert "\x1b" not in out + err, "colours in a pipe"
    if as_json:
        json.loads(out)
    elif not end.value.code:
        assert out
