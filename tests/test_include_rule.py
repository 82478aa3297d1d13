"""The C half of the dependency rule: driver and emulator share declarations, never code."""

import re
from pathlib import Path

CSRC = Path(__file__).parent.parent / "csrc"
SHARED = {"hm2.h", "registers.h"}


def includes(path: Path) -> set[str]:
    return set(re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(), re.MULTILINE))


def test_the_driver_never_includes_the_emulator() -> None:
    emulator = {path.name for path in (CSRC / "emulator").glob("*.h")}
    for path in [*CSRC.glob("*.c"), *CSRC.glob("*.h")]:
        assert not {name for name in includes(path) if "emulator" in name}, path.name
        own = {name for name in includes(path) if (CSRC / name).exists()}
        assert includes(path) - own <= set(), f"{path.name} includes {includes(path) & emulator}"


def test_the_emulator_includes_of_the_driver_only_what_both_declare() -> None:
    for path in (CSRC / "emulator").glob("**/*.[ch]"):
        foreign = {name for name in includes(path) if not (path.parent / name).exists()}
        assert foreign <= SHARED, f"{path.name} includes {sorted(foreign - SHARED)}"
