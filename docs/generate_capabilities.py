"""Writes docs/reference/capabilities.md: what drives what, what emulates it, where it is tested; gaps.

Every class and file named must exist, and every attribute of hostmot2/parts.py must have a row. What other
pages list by hand (modules and cards of the API, emulated cards, URLs) is looked for there.

    python docs/generate_capabilities.py [--check]
"""

from __future__ import annotations

import importlib
import re
import sys

from capabilities import BOARD, MODULES, Row
from generating import DOCS, ROOT, main, table
from peers import LINUXCNC_BOARD, LINUXCNC_CONFIG, LINUXCNC_MODULES, MESAFLASH, Peer

PEERS = {
    "LinuxCNC's hostmot2: the board": LINUXCNC_BOARD,
    "LinuxCNC's hostmot2: the config string": LINUXCNC_CONFIG,
    "LinuxCNC's hostmot2: modules": LINUXCNC_MODULES,
    "mesaflash": MESAFLASH,
}


def problem(name: str) -> str:
    """Why a class, module or file cannot be named; nothing if it exists."""
    if "/" in name:
        return "" if (ROOT / name).is_file() else f"there is no file {name}"
    path, _, attribute = name.partition(":")
    try:
        found = importlib.import_module(path)
    except ImportError as error:
        return f"{name}: {error}"
    return "" if not attribute or hasattr(found, attribute) else f"{path} has no {attribute}"


def problems() -> list[str]:
    """Everything named that does not exist, and every part of a board that has no row."""
    rows = BOARD + MODULES
    named = [name for row in rows for name in (*row.driver, *row.emulator, *row.tests)]
    named += [name for peers in PEERS.values() for peer in peers for name in peer.ours]
    found = [text for name in sorted(set(named)) if (text := problem(name))]
    parts = importlib.import_module("hostmot2.parts").PARTS
    have = {row.part for row in rows if row.part}
    found += [f"Board.{part} has no row" for part in sorted(set(parts) - have - {"cards", "cycle"})]
    found += [f"a row names Board.{part}, which is no part" for part in sorted(have - set(parts))]
    found += [f"{row.capability}: no test" for row in rows if not row.tests]
    driven = [row for row in MODULES if not row.refused]
    found += [f"{row.capability}: no emulator" for row in driven if not row.emulator]
    found += left_out()
    silent = [peer for peers in PEERS.values() for peer in peers if not peer.ours and not peer.gap]
    return found + [f"{peer.feature}: missing without a word" for peer in silent]


def left_out() -> list[str]:
    """What the pages that are written by hand should list and do not."""
    tables = [
        importlib.import_module(f"hostmot2.{name}") for name in ("cards", "emulator.cards", "transports")
    ]
    cards, emulated, transports = tables
    drivers = {name.partition(":")[0] for row in MODULES if not row.refused for name in row.driver}
    modules = {name for name in drivers if name.startswith("hostmot2.modules.")}
    pages = "\n".join(path.read_text(encoding="utf-8") for path in (DOCS / "reference/api").glob("*.md"))
    documented = set(re.findall(r"^::: (\S+)$", pages, re.MULTILINE))
    found = [
        f"docs/reference/api has no {name}"
        for name in sorted((modules | {module for module, _ in cards.CARDS.values()}) - documented)
    ]
    start = (DOCS / "start/emulator.md").read_text(encoding="utf-8")
    wanted = [f"`{name}`" for name in emulated.CARD_NAMES] + [
        f"`{scheme}://" for scheme in transports.TRANSPORTS
    ]
    found += [f"docs/start/emulator.md has no {text}" for text in wanted if text not in start]
    driven = {name.partition(":")[0] for row in BOARD for name in row.driver}
    return found + [f"{name} has no row" for name in sorted(set(transports.TRANSPORTS.values()) - driven)]


def names(values: tuple[str, ...]) -> str:
    """Names as code, without what they all have in common."""
    short = (value.removeprefix("hostmot2.").replace(":", ".") for value in values)
    return ", ".join(f"`{name}`" for name in short) or "-"


def capabilities(rows: list[Row], with_part: bool) -> list[str]:
    """The table of what there is."""
    lines = []
    for row in rows:
        part = f"`Board.{row.part}`: " if with_part else ""
        refused = "**refused** (`UnsupportedFirmware`): " if row.refused else ""
        note = f" ({row.note})" if row.note else ""
        driver = f"{refused}{part}{names(row.driver)}"
        lines.append((row.capability + note, driver, names(row.emulator), names(row.tests)))
    return table(("capability", "driver", "emulated by", "tests"), lines)


def gaps() -> list[str]:
    """What the others have: a table for each, and a line that counts."""
    lines = []
    for title, peers in PEERS.items():
        rows = [(peer.feature, peer.verdict, names(peer.ours), peer.gap) for peer in peers]
        lines += [f"### {title}", "", counted(peers), ""]
        lines += [*table(("feature", "here", "by", "what is missing or different"), rows), ""]
    return lines


def counted(peers: list[Peer]) -> str:
    """How many of the features are here."""
    whole = sum(peer.verdict == "yes" for peer in peers)
    partly = sum(peer.verdict == "partly" for peer in peers)
    missing = len(peers) - whole - partly
    return f"{len(peers)} features: {whole} here, {partly} partly or differently, {missing} not."


def pages() -> dict[str, str]:
    """The page."""
    lines = [
        "# Capabilities and gaps",
        "",
        "<!-- Generated by docs/generate_capabilities.py; do not edit -->",
        "",
        "What is driven is driven against an emulated counterpart that is written from the same facts, "
        "never from the driver. Where the sources contradict each other about hardware nobody here could "
        "measure, the part is refused, and the refusal says what disagrees. No real card has been driven.",
        "",
        "## Compared with other programs",
        "",
        *gaps(),
        "## Modules of the firmware",
        "",
        *capabilities(MODULES, True),
        "",
        "## The board",
        "",
        *capabilities(BOARD, False),
        "",
    ]
    return {"reference/capabilities.md": "\n".join(lines)}


if __name__ == "__main__":
    sys.exit(main(__doc__, pages, problems()))
