"""What holds for every test."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from hypothesis import settings

import hostmot2
from hostmot2.cli import main
from hostmot2.emulator import EmulatedBoard

VARIABLES = ("COMPORT", "BAUDRATE", "BAUDRATEMUL", "PROTOCOL", "INTERFACE")
"""Of the 8I20 manual's programs."""
CommandLine = Callable[..., tuple[int, str, str]]

# no test is timed: a busy machine, or the sanitizers, would fail it
settings.register_profile("hostmot2", deadline=None)
settings.load_profile("hostmot2")


@pytest.fixture
def command_line(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> CommandLine:
    """`hm2 ARGUMENTS` in this process, as in a pipe, without the user's variables: status, stdout, stderr."""
    for name in ("HM2_BOARD", "HM2_DEBUG", "COLUMNS", *VARIABLES):
        monkeypatch.delenv(name, raising=False)

    def run(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as end:
            main([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        return int(end.value.code or 0), out, err

    return run


@pytest.fixture
def hm2(command_line: CommandLine) -> CommandLine:
    """The same; where `hm2` is a board, tests have it by the other name."""
    return command_line


@pytest.fixture
def emulated() -> EmulatedBoard:
    """A 7I77 in virtual time."""
    return EmulatedBoard("5i25+7i77", clock="virtual")


@pytest.fixture
def board(emulated: EmulatedBoard) -> Iterator[Any]:
    """The same, opened, its remotes started."""
    with hostmot2.open(emulated) as opened:
        opened.card("7i77").start()
        yield opened
