"""Files for users are there whole or not at all, whatever ends their writing."""

from __future__ import annotations

import os
import resource
import secrets
import signal
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from recording.making import record_file, records

import hostmot2
from hostmot2 import dump
from hostmot2.emulator import EmulatedBoard
from hostmot2.recording import read, to_csv
from hostmot2.remotes import backup
from hostmot2.whole_file import whole_file

SMALL = 200
"""Bytes that a file may have here; each of these is longer."""


@pytest.fixture
def full() -> Iterator[Callable[[], None]]:
    """Call it, and no file grows beyond SMALL bytes, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    yield lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (SMALL, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def _dump(path: Path) -> Callable[[], Any]:
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        taken = dump.take(board)
    return lambda: dump.save(taken, path)


def _backup(path: Path) -> Callable[[], Any]:
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        found = board.sserial[0].channels[0]
        found.discover()
        parameters = found.parameters
        values = {name: n for n, name in enumerate(parameters)}
    return lambda: backup.write(backup.Backup("7I77", 1, values, values), path, parameters)


def _csv(path: Path) -> Callable[[], Any]:
    run = read(record_file(path.with_name("run.mcap"), records(0, 300)))
    return lambda: to_csv(run, path)


@pytest.mark.parametrize("before", [None, "what was there before"])
@pytest.mark.parametrize("prepare", [_dump, _backup, _csv])
def test_a_full_disk_leaves_what_was_there(
    tmp_path: Path, full: Callable[[], None], prepare: Callable[[Path], Callable[[], Any]], before: str | None
) -> None:
    path = tmp_path / "file"
    if before:
        path.write_text(before)
    write = prepare(path)
    full()
    with pytest.raises(OSError, match="too large"):
        write()
    assert (path.read_text() if path.exists() else None) == before
    assert {each.name for each in tmp_path.iterdir()} <= {"file", "run.mcap"}


def test_ctrl_c_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("before")

    def interrupted() -> None:
        with whole_file(path) as place:
            place.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "before"
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


def test_mode_and_link_of_the_file_before_are_kept(tmp_path: Path) -> None:
    path, link = tmp_path / "file", tmp_path / "link"
    path.write_text("before")
    path.chmod(0o640)
    link.symlink_to(path)
    with whole_file(link) as place:
        place.write_text("after")
    assert link.is_symlink()
    assert path.read_text() == "after"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_device_is_written_to_directly() -> None:
    with whole_file(os.devnull) as place:
        assert place == Path(os.devnull)


def test_a_directory_that_is_not_there_is_named_as_the_user_did(tmp_path: Path) -> None:
    path = tmp_path / "no" / "file"
    with pytest.raises(FileNotFoundError) as caught, whole_file(path) as place:
        place.write_text("text")
    assert caught.value.filename == str(path)


def test_nothing_is_written_through_a_link_that_lies_beside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(secrets, "token_hex", lambda _size: "guessed")
    victim, path = tmp_path / "victim", tmp_path / "file"
    victim.write_text("precious")
    (tmp_path / ".file.guessed.part").symlink_to(victim)
    with whole_file(path) as place:
        place.write_text("text")
    assert (victim.read_text(), path.read_text()) == ("precious", "text")
