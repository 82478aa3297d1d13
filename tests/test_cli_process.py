"""hm2 as a process, as shells and scripts have it: exit codes, no traceback, colours, completion."""

from __future__ import annotations

import ctypes
import errno
import fcntl
import json
import os
import pty
import re
import select
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from fake_sysfs import image

QUICK = ("--board", "emu://5i25+7i77?clock=virtual")
ROOT = Path(__file__).parent.parent
HM2 = (sys.executable, "-c", "from hostmot2.cli import main; main()")
_PR_CAPBSET_DROP, _CAP_DAC_OVERRIDE, _CAP_DAC_READ_SEARCH = 24, 1, 2


def run(*arguments: str, **options: object) -> subprocess.CompletedProcess[str]:
    env = {name: value for name, value in os.environ.items() if name not in ("HM2_BOARD", "HM2_DEBUG")}
    env |= {"PYTHONPATH": str(ROOT)} | options.pop("env", {})  # type: ignore[operator]
    return subprocess.run(
        [*HM2, *arguments], env=env, capture_output=True, text=True, timeout=60, check=False, **options
    )  # type: ignore[call-overload,no-any-return]


def obey_permissions() -> None:
    """Root is asked for its permissions, too, from the next exec on."""
    libc = ctypes.CDLL(None)
    for capability in (_CAP_DAC_OVERRIDE, _CAP_DAC_READ_SEARCH):
        libc.prctl(_PR_CAPBSET_DROP, capability, 0, 0, 0)


@pytest.fixture
def card(tmp_path: Path) -> Path:
    path = tmp_path / "card"
    path.write_bytes(image())
    return path


@pytest.fixture
def locked(card: Path) -> Iterator[Path]:
    """A card that another process, this one, drives."""
    with card.open("r+b") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        yield card


@pytest.fixture
def deaf() -> Iterator[str]:
    """A UDP port that never answers."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        yield f"udp://127.0.0.1:{sock.getsockname()[1]}"


def assert_told(done: subprocess.CompletedProcess[str], status: int, code: str = "") -> None:
    assert done.returncode == status, done.stderr
    assert "Traceback" not in done.stderr
    assert code in done.stderr
    if code.startswith("HM2"):
        assert re.search(r"^  Likely: ", done.stderr, re.MULTILINE)
        assert re.search(r"^  Do: ", done.stderr, re.MULTILINE)
        assert f"hm2 explain {code[4:8]}" in done.stderr


def test_status_0_is_success() -> None:
    done = run("info")
    assert_told(done, 0)
    assert "5I25" in done.stdout


@pytest.mark.parametrize(
    "arguments", [("nonsense",), ("peek", "banana"), ("info", "--bogus"), ("--board", "ftp://x", "info")]
)
def test_status_2_is_usage(arguments: tuple[str, ...]) -> None:
    assert_told(run(*arguments), 2)


def test_status_3_is_not_found(tmp_path: Path) -> None:
    assert_told(run("--board", "pci:///no/such/card", "info"), 3, "HM2-E017")
    assert_told(run("rpd", "BUSV", "-p", str(tmp_path / "ttyUSB9")), 3, "HM2-E105")
    assert_told(run("diff", "nothing.hm2dump", "nothing.hm2dump"), 3, "HM2-E017")
    assert_told(run("param", "diff", "nothing.toml", "nothing.toml"), 3)


def test_status_4_is_permission(card: Path) -> None:
    card.chmod(0)
    options = {"preexec_fn": obey_permissions} if os.geteuid() == 0 else {}
    assert_told(run("--board", f"pci://{card}", "info", **options), 4, "HM2-E012")


def test_status_5_is_communication(deaf: str) -> None:
    assert_told(run("--board", deaf, "info"), 5, "HM2-E011")


def test_status_6_is_a_device_fault(tmp_path: Path) -> None:
    (tmp_path / "zeros").write_bytes(bytes(0x10000))
    assert_told(run("--board", f"pci://{tmp_path}/zeros", "info"), 6, "HM2-E053")
    silent = "emu://5i25+7i77?clock=virtual&silent=0"
    assert_told(run("--board", silent, "param", "list"), 6, "HM2-E021")


def test_status_7_is_busy(locked: Path) -> None:
    done = run("--board", f"pci://{locked}", "info")
    assert_told(done, 7, "HM2-E013")
    assert f"pid {os.getpid()}" in done.stderr


@pytest.mark.parametrize("status", [3, 5, 6, 7])
def test_with_json_the_error_is_the_document(status: int, locked: Path, deaf: str, tmp_path: Path) -> None:
    (tmp_path / "zeros").write_bytes(bytes(0x10000))
    url = {3: "pci:///no/such/card", 5: deaf, 6: f"pci://{tmp_path}/zeros", 7: f"pci://{locked}"}[status]
    done = run("--json", "--board", url, "info")
    error = json.loads(done.stdout)["error"]
    assert (done.returncode, error["exit_code"]) == (status, status)
    assert error["causes"]
    assert error["fix"]
    assert error["code"] in done.stderr


def test_an_operating_system_error_is_a_sentence(tmp_path: Path) -> None:
    done = run("dump", "-o", str(tmp_path / "no" / "such" / "directory" / "x.hm2dump"))
    assert_told(done, 3)
    assert re.fullmatch(
        r"hm2: /.*x\.hm2dump: No such file or directory\n", done.stderr.partition("emu://5i25+7i77\n")[2]
    )
    full = run("dump", "-o", "/dev/full")
    assert_told(full, 5)
    assert os.strerror(errno.ENOSPC) in full.stderr


def test_a_pipe_that_is_closed_early_is_no_error() -> None:
    command = f"{shutil.which('head')} -1"
    line = " ".join(f"'{part}'" for part in HM2) + f" pins | {command}"
    done = subprocess.run(
        ["bash", "-c", line],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("more", [("info",), ("--json", "info"), ("--help",)])
def test_a_reader_that_is_gone_before_anything_is_said_is_no_error(more: tuple[str, ...]) -> None:
    """Tables and documents go out through different packages, each with its own idea of a closed pipe."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as gone:
        done = subprocess.run(
            [*HM2, *QUICK, *more],
            stdout=gone,
            stderr=subprocess.PIPE,
            check=False,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize("buffered", [True, False])
@pytest.mark.parametrize("more", [(), ("--json",)])
@pytest.mark.parametrize("place", ["&-", "/dev/full"])
def test_an_output_that_takes_nothing_is_no_traceback(
    place: str, more: tuple[str, ...], buffered: bool
) -> None:
    line = " ".join(f"'{part}'" for part in (*HM2, *QUICK, *more, "info")) + f" >{place}"
    done = subprocess.run(
        ["bash", "-c", line],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "" if buffered else "1"},
    )
    assert "Traceback" not in done.stderr
    assert "ignored" not in done.stderr
    assert done.returncode == (0 if place == "&-" else 5)
    assert (os.strerror(errno.ENOSPC) in done.stderr) == (place == "/dev/full")


def test_verbose_says_what_was_done_and_what_led_to_an_error() -> None:
    done = run("-v", "--board", "emu://5i25+7i77?clock=virtual", "info")
    assert "open after" in done.stderr
    assert "outputs off" in done.stderr
    done = run("-v", "--board", "pci:///no/such/card", "info")
    assert_told(done, 3)
    assert re.search(r"raised: CardNotFound at .*pci\.py:\d+", done.stderr)
    assert "because of: /no/such/card" in done.stderr


# ---- colours and bars


def on_terminal(
    *arguments: str, env: dict[str, str] | None = None, until_exit_s: float = 60
) -> tuple[int, str]:
    """Status and output of hm2 with all its streams on a terminal."""
    pid, terminal = pty.fork()
    if pid == 0:
        clean = {name: value for name, value in os.environ.items() if name not in ("HM2_BOARD", "NO_COLOR")}
        os.execve(
            HM2[0], [*HM2, *arguments], clean | {"PYTHONPATH": str(ROOT), "TERM": "xterm"} | (env or {})
        )
    output, end = b"", time.monotonic() + until_exit_s
    while time.monotonic() < end:
        if not select.select([terminal], [], [], 1)[0]:
            continue
        try:
            data = os.read(terminal, 65536)
        except OSError:  # the other end is closed
            break
        if not data:
            break
        output += data
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), output.decode()


COLOUR = re.compile(r"\x1b\[[0-9;]*m")


def test_errors_are_red_on_a_terminal_and_nowhere_else() -> None:
    arguments = ("--board", "pci:///no/such/card", "info")
    status, said = on_terminal(*arguments)
    assert status == 3
    assert COLOUR.search(said)
    assert not COLOUR.search(on_terminal(*arguments, env={"NO_COLOR": "1"})[1])
    assert not COLOUR.search(on_terminal(*arguments, env={"TERM": "dumb"})[1])
    done = run(*arguments)
    assert not COLOUR.search(done.stdout + done.stderr)


def test_tables_have_no_colours_with_no_color() -> None:
    arguments = ("--board", "emu://5i25+7i77?clock=virtual", "modules")
    plain = COLOUR.sub("", on_terminal(*arguments)[1])
    quiet = on_terminal(*arguments, env={"NO_COLOR": "1"})[1]
    assert not re.search(r"\x1b\[[0-9;]*3[0-7]m", quiet)
    assert "watchdog" in plain


def test_long_work_shows_a_bar_on_a_terminal_and_is_silent_in_a_pipe(tmp_path: Path) -> None:
    (tmp_path / "7I77.BIN").write_bytes(bytes(0x400) + b"\xa5" * 0x2000)
    arguments = ("uflbp", str(tmp_path / "7I77.BIN"), "-p", "emu:7i77-io")
    env = {"XDG_STATE_HOME": str(tmp_path)}
    status, said = on_terminal(*arguments, env=env)
    assert status == 0, said
    assert "blocks" in said
    assert "100%" in said
    done = run(*arguments, env=env)
    assert done.returncode == 0, done.stderr
    assert "%" not in done.stderr
    assert "\x1b" not in done.stderr


# ---- completion


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_completion_script_is_printed_and_nothing_else(shell: str) -> None:
    done = run("completion", shell)
    assert done.returncode == 0
    assert done.stderr == ""
    assert f"_HM2_COMPLETE={shell}_complete" in done.stdout
    if shutil.which(shell):
        check = subprocess.run([shell, "-n"], input=done.stdout, capture_output=True, text=True, check=False)
        assert check.returncode == 0, check.stderr


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("hm2 sser", {"sserial"}),
        ("hm2 sserial s", {"scan", "start", "stop", "status"}),
        ("hm2 explain E02", {"E020", "E021"}),
        ("hm2 explain NoR", {"NoRemote"}),
        ("hm2 --board emu", {"emu://5i25+7i77"}),
        ("hm2 pins 8", {"8i20"}),
        ("hm2 sserial scan --p", {"--port"}),
    ],
)
def test_a_shell_gets_completions(words: str, wanted: set[str]) -> None:
    typed = words.split(" ")
    env = {"_HM2_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(len(typed) - 1)}
    done = run(env=env)
    assert done.returncode == 0, done.stderr
    assert wanted <= {line.partition(",")[2] for line in done.stdout.splitlines()}


def test_bash_completes_with_the_script(tmp_path: Path) -> None:
    (tmp_path / "hm2").write_text(f'#!/bin/sh\nexec {" ".join(repr(part) for part in HM2)} "$@"\n')
    (tmp_path / "hm2").chmod(0o755)
    script = run("completion", "bash").stdout
    asked = 'COMP_WORDS=(hm2 sserial coun); COMP_CWORD=2; _hm2_completion hm2; echo "${COMPREPLY[@]}"'
    program = f"{script}\n{asked}\n"
    env = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(["bash", "-c", program], env=env, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "counters", done.stderr
