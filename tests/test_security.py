"""What docs/explanation/security.md says, sentence by sentence."""

from __future__ import annotations

import ast
import base64
import inspect
import json
import stat
import tomllib
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hostmot2 import dump, live
from hostmot2.bitfile import read_bitfile
from hostmot2.cli.live import live as live_command
from hostmot2.emulator import EmulatedBoard, catalog
from hostmot2.emulator.control import Controls, ControlServer
from hostmot2.emulator.ethernet import EthernetServer
from hostmot2.emulator.remote_state import MOST_BYTES, RemoteState
from hostmot2.errors import HostMot2Error
from hostmot2.lbp.firmware import read_firmware
from hostmot2.remotes import backup

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "hostmot2"
LISTENERS = {"emulator/control.py"}
"""Modules that accept connections, on a Unix socket."""


def calls() -> Iterator[tuple[str, str, ast.Call]]:
    """Every call in the package: the module, what is called, and the call."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call):
                yield str(path.relative_to(PACKAGE)), ast.unparse(node.func), node


def imports() -> Iterator[tuple[str, str]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                yield from ((str(path.relative_to(PACKAGE)), alias.name) for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                yield str(path.relative_to(PACKAGE)), node.module or ""


def test_no_file_is_run() -> None:
    forbidden = {"pickle", "marshal", "shelve", "yaml", "dill", "joblib"}
    assert not [(where, name) for where, name in imports() if name.split(".")[0] in forbidden]
    assert not [
        (where, name) for where, name, _ in calls() if name in ("eval", "exec", "os.system", "os.popen")
    ]
    for where, name, call in calls():
        assert not any(keyword.arg == "shell" for keyword in call.keywords), f"{where}: {name}"


def test_nothing_asks_for_more_rights() -> None:
    changes = {"os.setuid", "os.seteuid", "os.setgid", "os.setegid", "os.setresuid"}
    assert not [
        (where, name) for where, name, _ in calls() if name in changes or "sudo" in ast.unparse(_)[:40]
    ]


def test_nothing_but_the_control_socket_accepts_connections_in_python() -> None:
    listening = {where for where, name, _ in calls() if name.endswith((".listen", ".accept"))}
    assert listening <= LISTENERS
    servers = ("http", "socketserver", "asyncio")
    found = {(where, name) for where, name in imports() if name.split(".")[0] in servers}
    assert found <= {("monitor/app.py", "asyncio")}, "the terminal's event loop, which serves nobody"


def test_the_live_view_alone_serves_a_network_and_on_loopback_unless_told_otherwise() -> None:
    assert {where for where, name in imports() if name.split(".")[0] in ("foxglove", "websockets")} == {
        "live/server.py"
    }
    for serves in (live.serve, live.LiveView):
        assert inspect.signature(serves).parameters["host"].default == "127.0.0.1"
    (host,) = (option for option in live_command.params if option.name == "host")
    assert host.default == "127.0.0.1"


def test_the_emulated_card_is_on_loopback_unless_told_otherwise(caplog: pytest.LogCaptureFixture) -> None:
    with EthernetServer(None) as server:
        assert server.is_loopback
        assert server.url.startswith("udp://127.0.0.1:")
    assert not caplog.records
    with EthernetServer(None, "0.0.0.0") as server:
        assert not server.is_loopback
    assert "can be driven from the network" in caplog.text


def test_the_control_socket_is_its_owners_alone(tmp_path: Path) -> None:
    board = EmulatedBoard("7i92+7i77")
    path = tmp_path / "control"
    with EthernetServer(board) as server, ControlServer(path, Controls(board, server)):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600


def state(tmp_path: Path, document: object) -> Path:
    path = tmp_path / "state"
    path.write_text(document if isinstance(document, str) else json.dumps(document))
    return path


@pytest.mark.parametrize(
    "document",
    [
        {"remote": "7i77-io", "eeprom": base64.b64encode(zlib.compress(bytes(MOST_BYTES + 1))).decode()},
        {"remote": "7i77-io", "eeprom": base64.b64encode(zlib.compress(bytes(10))[:-4]).decode()},
        "[" * 100_000,
        "{",
    ],
    ids=["bomb", "cut short", "nested", "no JSON"],
)
def test_a_state_that_cannot_be_is_refused(tmp_path: Path, document: object) -> None:
    with pytest.raises(ValueError, match="no state of a remote"):
        RemoteState(catalog.remote("7i77-io"), state(tmp_path, document), "7i77-io")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = " + "[" * 100_000, None),
        ("# " + "x" * (1 << 20), "longer than 1048576 bytes"),
        ("[remote]\nname = 1979-05-27\nunit_number = 'x'", None),
        ("[remote]\nname = 'a'\nunit_number = 1\n[working]\ngain = 'import os'", None),
    ],
    ids=["nested", "long", "types", "text for a number"],
)
def test_a_backup_that_cannot_be_is_refused(tmp_path: Path, text: str, said: str | None) -> None:
    path = tmp_path / "backup.toml"
    path.write_text(text)
    with pytest.raises(HostMot2Error, match=said):
        backup.read(path)


@pytest.mark.parametrize("reader", [read_bitfile, read_firmware, dump.load])
def test_a_file_that_cannot_be_is_not_read_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reader: Callable[[Path], object]
) -> None:
    """A wrong file, of a disk's size, or /dev/zero: an error, where memory ran out."""
    path = tmp_path / "7I77.BIN"
    with path.open("wb") as file:
        file.truncate(1 << 26)
    monkeypatch.setattr(Path, "read_bytes", lambda _self: pytest.fail("read without a limit"))
    monkeypatch.setattr(Path, "read_text", lambda _self, **_: pytest.fail("read without a limit"))
    with pytest.raises(HostMot2Error, match="at most"):
        reader(path)


def test_a_link_beside_a_file_that_is_replaced_is_not_followed(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("untouched")
    path = tmp_path / "state"
    for name in ("state.new", "state.tmp", "state~"):
        (tmp_path / name).symlink_to(precious)
    RemoteState(catalog.remote("7i77-io"), path, "7i77-io").save()
    assert json.loads(path.read_text())["remote"] == "7i77-io"
    assert precious.read_text() == "untouched"


def test_there_are_five_dependencies_each_with_its_reason() -> None:
    text = (ROOT / "pyproject.toml").read_text()
    dependencies = tomllib.loads(text)["project"]["dependencies"]
    names = [dependency.split(">")[0] for dependency in dependencies]
    assert names == ["cffi", "numpy", "click", "rich", "tomlkit"]
    for dependency in dependencies:
        line = next(line for line in text.splitlines() if line.strip().startswith(f'"{dependency}"'))
        assert "#" in line, line
