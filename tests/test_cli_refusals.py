"""What the command line refuses before anything is done: status 2, and a sentence that names the mistake."""

from __future__ import annotations

import errno
import importlib
import json
import os
import signal
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import hostmot2
from hostmot2 import host_facts
from hostmot2.cli import catalogue
from hostmot2.cli import monitor as cli_monitor
from hostmot2.cli import uflbp as cli_uflbp
from hostmot2.cli.identify import _connector
from hostmot2.cli.live import _audience
from hostmot2.cli.run import start_remotes
from hostmot2.emulator import EmulatedBoard
from hostmot2.errors import CardNotFound, LinkFailed
from hostmot2.lbp.errors import UpdateFailed
from hostmot2.lbp.firmware import Plan, read_firmware
from hostmot2.remotes.parameters import Parameter

cli = importlib.import_module("hostmot2.cli.main")  # hostmot2.cli.main is its function
CommandLine = Callable[..., tuple[int, str, str]]
CARD = ("--board", "emu://5i25+7i77?clock=virtual")
DRIVE = ("-p", "emu:8i20")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("param", "list", "BUSV", *DRIVE), "BUSV: hm2 param get reads single ones"),
        ((*CARD, "param", "get", "0.1"), "which parameter?"),
        (("param", "get", "h", *DRIVE), "has no parameter 'h'"),
        (("param", "set", "KQP", *DRIVE), "NAME VALUE [H]"),
        (("param", "set", "KQP", "1", "X", *DRIVE), "NAME VALUE [H]"),
        (("param", "set", "KQP", "10", "", *DRIVE), "NAME VALUE [H]"),
        (("param", "set", "KQP", "fast", *DRIVE), "KQP takes whole numbers, not 'fast'"),
        ((*CARD, "param", "backup", "0.1"), "which file?"),
        (("param", "save", "BUSV", *DRIVE), "BUSV is not kept in EEPROM"),
        ((*CARD, "param", "list", "-c", "0-1"), "'0-1' is no PORT.CHANNEL"),
        ((*CARD, "pins", "--svg", "x.svg"), "--connector and --svg need a daughter card"),
        (("emu", "get", "input"), "which card? hm2 emu --control PATH"),
        (("doctor", "--cpu", "4095"), "processor 4095 is not there"),
        (("doctor", "--ab", "rx-usecs"), "'rx-usecs' is not KEY=VALUE"),
        (("doctor", "--ab", "rx-usecs="), "'rx-usecs=' is not KEY=VALUE"),
        (("monitor", "--start", "all", "--start", "0:1"), "`all` goes alone"),
        (("monitor", "--start", "x:1"), "'x' is not a number"),
        (("monitor", "--start", "all", "--mode", "1"), "'1' is not CHANNEL=MODE"),
        (("monitor", "--start", "all", "--mode", "x=1"), "'x' is not a number"),
        (("monitor", "--mode", "0=2"), "--mode is for --start"),
    ],
)
def test_it_is_told_what_is_wrong(command_line: CommandLine, arguments: tuple[str, ...], said: str) -> None:
    status, out, err = command_line(*arguments)
    assert (status, out) == (2, "")
    assert said in err


@pytest.mark.parametrize(
    ("variable", "value"), [("BAUDRATE", "99999999999"), ("BAUDRATE", "12000001"), ("BAUDRATEMUL", "1000")]
)
def test_a_rate_in_the_environment_is_bounded_as_the_option_is(
    command_line: CommandLine, monkeypatch: pytest.MonkeyPatch, variable: str, value: str
) -> None:
    monkeypatch.setenv(variable, value)
    status, _, err = command_line("rpd", "KQP", "-p", "/dev/ptmx")
    assert (status, "no rate from 300 to 12000000" in err) == (2, True)


def test_a_stored_parameter_is_saved_under_either_name(command_line: CommandLine) -> None:
    for name in ("KQP", "NVKQP"):
        status, out, _ = command_line("param", "set", name, "51", "--save", "--dry-run", *DRIVE)
        assert status == 0
        assert "would write NVKQP = 51" in out


@pytest.mark.parametrize("command", [("wpd",), ("param", "set")])
@pytest.mark.parametrize(("name", "lasts"), [("SWREVISION", False), ("KQP", True)])
def test_whoever_writes_what_only_the_remote_sets_is_told(
    command_line: CommandLine, command: tuple[str, ...], name: str, lasts: bool
) -> None:
    status, _, err = command_line(*command, name, "7", "--dry-run", *DRIVE)
    assert (status, "is set by the remote itself" in err) == (0, not lasts)


# ---- the frame around every command


def test_ctrl_c_ends_with_130_and_one_line(
    command_line: CommandLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_arguments: object, **_options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli.hm2, "main", interrupt)
    assert command_line("info") == (130, "", "hm2: interrupted\n")


def test_a_card_lost_behind_the_report_leaves_one_document(
    command_line: CommandLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    close = hostmot2.Board.close

    def lost(board: hostmot2.Board) -> None:
        was = board.closed
        close(board)
        if not was:
            raise LinkFailed("the cable is out")

    monkeypatch.setattr(hostmot2.Board, "close", lost)
    status, out, _ = command_line("--json", *CARD, "info")
    assert (status, json.loads(out)["error"]["type"]) == (5, "LinkFailed")


@pytest.mark.parametrize("end", [LinkFailed("the cable is out"), KeyboardInterrupt()])
def test_a_restore_that_is_cut_short_says_what_it_has_written(
    command_line: CommandLine, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, end: BaseException
) -> None:
    file = tmp_path / "drive.toml"
    assert command_line("param", "backup", file, *DRIVE)[0] == 0
    file.write_text(file.read_text().replace("NVKQP = 50", "NVKQP = 51").replace("NVKDP = 50", "NVKDP = 51"))
    write, names = Parameter.write, []

    def lost(parameter: Parameter, value: float) -> bool:
        names.append(parameter.name)
        if len(names) == 2:
            raise end
        return write(parameter, value)

    monkeypatch.setattr(Parameter, "write", lost)
    status, out, err = command_line("param", "restore", file, *DRIVE)
    assert (status, out) == (130 if isinstance(end, KeyboardInterrupt) else 5, "")
    assert names == ["NVKQP", "NVKDP"]
    assert "written before this: NVKQP = 51" in " ".join(err.split())


def test_a_number_that_json_does_not_have_is_null(
    command_line: CommandLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A FLOAT in an erased EEPROM, all bits set, is no number."""

    def constant(text: str) -> None:
        raise AssertionError(f"{text} is no JSON")

    monkeypatch.setattr(Parameter, "read", lambda _self: float("nan"))
    status, out, _ = command_line("--json", *CARD, "param", "backup", "--all", "0.0", "/dev/null")
    assert status == 0
    assert None in json.loads(out, parse_constant=constant)["values"].values()


def test_a_warning_is_a_line_on_stderr(command_line: CommandLine, monkeypatch: pytest.MonkeyPatch) -> None:
    import warnings

    def warn(*_arguments: object, **_options: object) -> int:
        warnings.warn("encoder 0 turns too fast", UserWarning, stacklevel=1)
        return 0

    monkeypatch.setattr(cli.hm2, "main", warn)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)  # as before afterwards
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        status, out, err = command_line("info")
    assert (status, out) == (0, "")
    assert "encoder 0 turns too fast" in err
    assert ".py" not in err, "no place in the source"


def test_no_adapter_is_not_found(command_line: CommandLine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hostmot2.cli.adapters.adapters", list)
    status, out, _ = command_line("discover", "--serial")
    assert (status, out.strip()) == (3, "no serial port or adapter")
    monkeypatch.setattr("hostmot2.cli.adapters.find_spec", lambda _name: None)
    assert "hostmot2[serial]" in command_line("discover", "--serial")[1]


# ---- the monitor


def test_the_monitor_needs_a_terminal_and_opens_no_card_without(command_line: CommandLine) -> None:
    status, _, err = command_line("--board", "emu://nonsense", "monitor")
    assert status == 2
    assert "needs a terminal" in err


@pytest.mark.parametrize(
    ("arguments", "start", "modes"),
    [
        ((), None, {}),
        (("--start", "all"), {}, {}),
        (("--allow-write",), {}, {}),
        (("--start", "0x3", "--start", "1:0x1", "--mode", "0=2", "--mode", "1.0=1"), {0: 3, 1: 1}, {}),
    ],
)
def test_the_monitor_starts_what_it_is_told_and_ends_with_its_views_status(
    command_line: CommandLine, monkeypatch: pytest.MonkeyPatch, arguments: Any, start: Any, modes: Any
) -> None:
    made: list[Any] = []

    class Source:
        def __init__(self, board: object, **options: Any) -> None:
            self.board, self.options, self.calls = board, options, ["made"]
            made.append(self)

        def start(self) -> None:
            self.calls.append("started")

        def close(self) -> None:
            self.calls.append("closed")

    monkeypatch.setattr(cli_monitor, "_is_terminal", lambda: True)
    monkeypatch.setattr(cli_monitor, "Source", Source)
    monkeypatch.setattr(cli_monitor, "_app", lambda: SimpleNamespace(run=lambda *_: 7))
    assert command_line(*CARD, "monitor", *arguments)[0] == 7
    (source,) = made
    assert source.calls == ["made", "started", "closed"]
    assert source.options["start"] == start
    assert source.board.closed
    if "--mode" in arguments:
        assert source.options["modes"] == {(0, 0): 2, (1, 0): 1}


# ---- firmware updates


@pytest.fixture
def record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Of an update of five blocks; its file lies in a directory of the test's own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    (tmp_path / "7I77.BIN").write_bytes(b"\1" * 0x900)
    plan = Plan("7I77", 0x12000001, 0x400, 0x100, (1, 2, 3, 4, 5), 0)
    return cli_uflbp._Record(read_firmware(tmp_path / "7I77.BIN"), plan)


def test_progress_is_kept_and_forgotten(record: Any) -> None:
    assert record.done() == 0
    record.keep(3)
    assert record.done() == 3
    record.forget()
    assert record.done() == 0


@pytest.mark.parametrize("done", [-1, 6, 99, "3", None, 2.5])
def test_progress_that_cannot_be_is_none(record: Any, done: Any) -> None:
    """Else blocks would be left out and the update called whole."""
    record.keep(3)
    text = json.loads(record._path.read_text())
    record._path.write_text(json.dumps(text | {"done": done}))
    assert record.done() == 0


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", "null", "[" * 100_000])
def test_progress_that_cannot_be_read_is_none(record: Any, text: str) -> None:
    record.keep(3)
    record._path.write_text(text)
    assert record.done() == 0


def test_without_a_place_for_it_an_update_goes_on(
    record: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "hostmot2").write_text("a file where a directory is to be")
    record.keep(1)
    assert "cannot keep the progress" in capsys.readouterr().err


def test_ctrl_c_waits_for_the_end_of_a_block(capsys: pytest.CaptureFixture[str]) -> None:
    before = signal.getsignal(signal.SIGINT)
    with cli_uflbp._no_interrupt() as interrupted:
        assert not interrupted()
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupted()
    assert "ending after this block" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGINT) is before


def test_an_interrupted_update_goes_on_where_it_was(
    command_line: CommandLine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    (tmp_path / "7I77.BIN").write_bytes(bytes(range(1, 256)) * 20)
    arguments = ("uflbp", str(tmp_path / "7I77.BIN"), "-p", "emu:7i77-io")
    real, kept = cli_uflbp._Record.keep, []

    def keep(self: Any, done: int) -> None:
        real(self, done)
        kept.append(done)
        if done == 2:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(cli_uflbp._Record, "keep", keep)
    status, _, err = command_line(*arguments)
    assert status == 130
    assert "repeat the update with --resume" in err
    assert kept == [1, 2]
    assert command_line(*arguments, "--resume")[0] == 0
    assert kept == [1, 2, 3, 4]


def updates_fail(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The first behind three blocks, the next at once; filled with how many each took for done before."""
    begun: list[int] = []

    def interrupted(_remote: Any, _firmware: Any, todo: Any, *, done: int, progress: Any) -> None:
        begun.append(done)
        if len(begun) == 1:
            progress(3, len(todo.blocks))
        raise UpdateFailed("silent")

    monkeypatch.setattr(cli_uflbp, "update", interrupted)
    return begun


@pytest.mark.parametrize("resumed", [False, True])
def test_what_an_update_that_began_anew_has_erased_is_not_left_out_by_the_next(
    record: Any, command_line: CommandLine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, resumed: bool
) -> None:
    """The remote went silent in the first block: what an earlier update had written is gone."""
    (tmp_path / "7I77.BIN").write_bytes(bytes(range(1, 256)) * 20)
    arguments = ("uflbp", str(tmp_path / "7I77.BIN"), "-p", "emu:7i77-io")
    begun = updates_fail(monkeypatch)
    for more in ((), ("--resume",) if resumed else (), ("--resume",)):
        assert command_line(*arguments, *more)[0] == 5
    assert begun == ([0, 3, 3] if resumed else [0, 0, 0])


def test_what_another_file_has_overwritten_is_not_left_out(
    record: Any, command_line: CommandLine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, fill in (("7I77.BIN", 1), ("7I77_NEW.BIN", 2)):
        (tmp_path / name).write_bytes(bytes([fill]) * 0x1400)
    begun = updates_fail(monkeypatch)
    for name, *more in (("7I77.BIN",), ("7I77_NEW.BIN",), ("7I77.BIN", "--resume")):
        assert command_line("uflbp", str(tmp_path / name), "-p", "emu:7i77-io", *more)[0] == 5
    assert begun == [0, 0, 0]


def test_a_terminal_that_is_closed_waits_for_the_end_of_a_block(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_arguments: object, **_options: object) -> None:
        raise OSError(errno.EIO, "the terminal is gone")

    before = signal.getsignal(signal.SIGHUP)
    monkeypatch.setattr(cli_uflbp.click, "echo", gone)
    with cli_uflbp._no_interrupt() as interrupted:
        os.kill(os.getpid(), signal.SIGHUP)
        assert interrupted()
    assert signal.getsignal(signal.SIGHUP) is before


# ---- remotes that do not start


def test_a_command_that_runs_remotes_says_which_did_not_start(capsys: pytest.CaptureFixture[str]) -> None:
    emulated = EmulatedBoard("5i25+7i77", clock="virtual")
    field = emulated.sserial[0].remote(0)
    assert field is not None
    field.fault, field.fault_clears = 0x08, False
    with hostmot2.open(emulated) as board:
        start_remotes(board)
        assert board.sserial.started == 0x02
    assert "channels 0x01 did not start" in capsys.readouterr().err


# ---- what is said beside the answer


def test_a_read_that_changes_something_says_so(command_line: CommandLine) -> None:
    err = command_line("--board", "emu://7i76e?clock=virtual", "peek", "0x7600")[2]
    assert "reading dpll sync: " in err


def test_a_completion_script_on_a_terminal_says_where_it_goes(
    command_line: CommandLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    status, out, err = command_line("completion", "bash")
    assert status == 0
    assert "to install it" in err
    assert "to install it" not in out


@pytest.mark.parametrize(
    ("host", "who"),
    [
        ("127.0.0.1", "only programs on this computer"),
        ("::1", "only programs on this computer"),
        ("localhost", "only programs on this computer"),
        ("0.0.0.0", "everybody who reaches 0.0.0.0"),
        ("machine.example", "everybody who reaches machine.example"),
    ],
)
def test_who_may_look_is_said(host: str, who: str) -> None:
    assert _audience(host) == who


def test_a_package_that_is_not_installed_is_no_fault_of_the_facts(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", missing)
    assert "not installed" in host_facts.facts().values()


def test_errors_of_a_part_whose_packages_are_missing_are_read_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    name = "hostmot2.recording.errors"
    path = Path(importlib.import_module(name).__file__ or "")

    def missing(_name: str) -> None:
        raise ModuleNotFoundError("mcap")

    with monkeypatch.context() as patched:
        patched.delitem(sys.modules, name)
        patched.setattr(importlib, "import_module", missing)
        catalogue._load(path)
        assert sys.modules[name].BrokenRecording.code == "HM2-E111"


def test_a_stored_parameter_is_found_by_the_manuals_other_name(command_line: CommandLine) -> None:
    arguments = ("param", "set", "WATCHDOGTIME", "60", "--save", "--dry-run", "-p", "emu:7i77-io")
    status, out, _ = command_line(*arguments)
    assert (status, "would write NVWatchDogTimeout = 60" in out) == (0, True)


def test_a_pin_that_leads_nowhere_known_has_no_connector() -> None:
    assert _connector(SimpleNamespace(connector="", connector_pin=None)) == ""  # type: ignore[arg-type]
    assert _connector(SimpleNamespace(connector="P3", connector_pin=17)) == "P3-17"  # type: ignore[arg-type]


def test_with_hm2_debug_an_error_comes_with_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HM2_DEBUG", "1")
    with pytest.raises(CardNotFound, match="nowhere"):
        cli.main(["--board", "pci:///nowhere", "info"])


def test_a_reader_that_has_seen_enough_is_no_error(
    command_line: CommandLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_arguments: object, **_options: object) -> None:
        raise BrokenPipeError

    turned: list[object] = []
    monkeypatch.setattr(cli.hm2, "main", broken)
    monkeypatch.setattr(cli, "_turn_away", turned.append)  # not os.dup2: capfd needs it to end
    assert command_line("info") == (0, "", "")
    assert turned == [sys.stdout]


def test_a_card_without_smart_serial_has_no_remotes_to_start() -> None:
    with hostmot2.open(EmulatedBoard("7i80hd", clock="virtual")) as board:
        before = board.counters["words_written"]
        start_remotes(board)
        assert board.counters["words_written"] == before
