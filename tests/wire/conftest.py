"""What tests of remotes behind a serial line share."""

from __future__ import annotations

from collections.abc import Callable

import pytest


@pytest.fixture
def hm2(command_line: Callable[..., tuple[int, str, str]]) -> Callable[..., tuple[int, str, str]]:
    """`hm2 ARGUMENTS`, its output without the last line's end."""

    def run(*arguments: str) -> tuple[int, str, str]:
        status, out, err = command_line(*arguments)
        return status, out.strip(), err

    return run
