"""hm2 explain: error codes, status words and registers in plain words."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import click
from click.shell_completion import CompletionItem

from hostmot2.cli import catalogue, failure
from hostmot2.cli.register_meaning import meanings
from hostmot2.cli.session import Session, reports, rows, text_width
from hostmot2.errors.base import HostMot2Error, numbered, wrapped
from hostmot2.registers import CsStatus
from hostmot2.sserial.checklist import checklist_of
from hostmot2.sserial.errors import NoRemote
from hostmot2.sserial.status import ChannelStatus
from hostmot2.sserial.words import Words, explain_command, explain_cs, explain_data
from hostmot2.wiring import WIRING

_NUMBER = re.compile(r"0[xX][0-9a-fA-F]+|0[bB][01]+|\d+")
_WORDS = {"CS": explain_cs, "COMMAND": explain_command, "DATA": explain_data}


def _complete(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    known = [(kind, catalogue.short(kind)) for kind in catalogue.all_errors()]
    names = [(name, kind.__name__) for kind, code in known for name in (code, kind.__name__)]
    return [CompletionItem(name, help=told) for name, told in names if name.lower().startswith(typed.lower())]


@click.command()
@click.argument("what", required=False, metavar="[WHAT]", shell_complete=_complete)
@reports
def explain(session: Session, what: str | None) -> None:
    """What a code, status word or register means; what to do.

    WHAT is an error's code or name, a smart-serial CS word as messages show it, a COMMAND or DATA word by its
    name, or ADDRESS=VALUE for any register. Registers are those of --board if one is given, else of cards
    with either register map. Without WHAT all codes are listed.

    \b
    Examples:
      hm2 explain E021
      hm2 explain NoRemote
      hm2 explain 0x00422088
      hm2 explain COMMAND=0x1003
      hm2 explain 0x5A00=0x81
    """
    if what is None:
        known = catalogue.all_errors()
        lines = [(error.code, error.__name__, catalogue.meaning(error)) for error in known]
        session.report(
            [catalogue.document(error) for error in known], rows(("code", "error", "meaning"), lines)
        )
        return
    name, equals, value = what.partition("=")
    if equals:
        _explain_assignment(session, name.strip().upper(), _number(value))
    elif _NUMBER.fullmatch(what) and what[:2].lower() in ("0x", "0b"):
        _explain_word(session, _number(what))
    else:
        _explain_error(session, what)


def _number(text: str) -> int:
    if not _NUMBER.fullmatch(text.strip()) or not 0 <= int(text, 0) <= 0xFFFFFFFF:
        raise click.UsageError(f"{text!r} is not a number of 32 bits, such as 0x00422088")
    return int(text, 0)


# ---- errors


def _explain_error(session: Session, what: str) -> None:
    found = catalogue.find(what)
    if found is None:
        raise click.UsageError(
            f"there is no error {what!r}; `hm2 explain` lists all, and words are written 0x00422088"
        )
    document = catalogue.document(found)
    if found is NoRemote:
        document["checklists"] = {card: checklist_of(card) for card in WIRING}
    session.report(document, *_error_lines(found))


def _error_lines(found: type[HostMot2Error]) -> list[str]:
    width = text_width()
    meaning = catalogue.exit_meaning(found)
    lines = [f"{found.code} {found.__name__}", *wrapped([catalogue.meaning(found)], width, 0)]
    lines += ["", "Likely, in this order:", *_indented(numbered(found.causes), width)]
    if found is NoRemote:
        lines += _checklists(width)
    lines += ["", "What to do:", *_indented([found.fix], width)]
    return [*lines, "", f"Exit status of hm2: {failure.exit_code_of(found)} ({meaning})"]


def _checklists(width: int) -> list[str]:
    lines = ["", "Which remotes of a card do answer decides what to look at; from the cards' manuals:"]
    for card in WIRING.values():
        for situation, checks in checklist_of(card.name).items():
            lines += [f"  {card.name.upper()}, {situation}:", *_indented(numbered(checks), width, 4)]
    return lines


def _indented(lines: list[str], width: int, by: int = 2) -> list[str]:
    return [" " * by + line for line in wrapped(lines, width, by)]


# ---- words


def _explain_word(session: Session, word: int) -> None:
    """A bare word is a CS register; a short one a command or its result, unless it says "not ready"."""
    document: dict[str, Any] = {"word": word}
    readings: dict[str, Words] = {}
    if word > 0xFFFF or word & CsStatus.NOT_READY << 8:
        readings["cs"] = explain_cs(word)
        document |= _status(word)
    if word <= 0xFFFF:
        readings["command"] = explain_command(word)
    if word <= 0xFF:
        readings["data"] = explain_data(word)
    document |= {name: asdict(words) for name, words in readings.items()}
    lines: list[Any] = []
    for name, words in readings.items():
        lines += [f"0x{word:08X} as {name.upper()}:", *_word_lines(words)]
    session.report(document, *lines)


def _status(word: int) -> dict[str, Any]:
    status = ChannelStatus(word)
    return {"state": status.state, "live": status.live, "sticky": status.sticky}


def _word_lines(words: Words) -> list[Any]:
    width = text_width()
    lines: list[Any] = _indented([words.summary], width)
    if words.parts:
        table = [
            (f"  {part.bits}", part.name, "now" if part.live else "since the last stop", part.text)
            for part in words.parts
        ]
        lines.append(rows(("  bits", "name", "holds", "meaning"), table))
    return lines + (_indented([f"Do: {words.do}"], width) if words.do else [])


def _explain_assignment(session: Session, name: str, value: int) -> None:
    if name in _WORDS:
        words = _WORDS[name](value)
        document = {name.lower(): value} | asdict(words) | (_status(value) if name == "CS" else {})
        session.report(document, f"{name} = 0x{value:08X}", *_word_lines(words))
        return
    address = _number(name)
    if address > 0xFFFF:
        raise click.UsageError(f"0x{address:X} is beyond the card's registers, which end at 0xFFFF")
    found = meanings(session, address & ~3)
    if not found:
        raise click.UsageError(f"no known register at 0x{address:04X}; --board URL asks the card's own map")
    lines: list[Any] = []
    for meaning in found:
        lines += [f"0x{address:04X} = 0x{value:08X}: {meaning.title}", *meaning.lines(value)]
        explained = _words_of(meaning.register_name)
        lines += _word_lines(explained(value)) if explained else []
    session.report([meaning.document(value) for meaning in found], *lines)


def _words_of(register: str) -> Callable[[int], Words] | None:
    module, _, name = register.partition(".")
    return _WORDS.get(name.upper()) if module.startswith("sserial") else None
