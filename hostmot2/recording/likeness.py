"""Whether a card is like the one a recording was made with: its registers, its remotes' process data."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hostmot2 import dump as dumps
from hostmot2.recording import format as form
from hostmot2.recording.descriptors import ChannelText, Descriptors, describe, key_prefix
from hostmot2.registers import Idrom

if TYPE_CHECKING:
    from hostmot2.board import Board
    from hostmot2.idrom import ModuleDescriptor
    from hostmot2.recording.recording import Recording

MODULE_WORDS = 3
_IDROM_OFFSET = 0x010C
_HEADER = (
    Idrom.clock_low,
    Idrom.clock_high,
    Idrom.instance_stride_0,
    Idrom.instance_stride_1,
    Idrom.register_stride_0,
    Idrom.register_stride_1,
)


def raise_for_another_card(recording: Recording, board: Board) -> None:
    """ValueError if a module whose registers were recorded is another one here, or runs on other clocks.

    A recording without a dump says nothing about its card.
    """
    text = recording.attachments.get(form.DUMP_NAME)
    if text is None:
        return
    words = dumps.from_text(text.decode("utf-8", "replace")).words
    start = words.get(_IDROM_OFFSET, 0) & 0xFFFF
    there = {at.number: words.get(start + at.number) for at in _HEADER}
    here = {at.number: board.read(board.idrom.address + at.number) for at in _HEADER}
    table = start + words.get(start + Idrom.module_offset.number, 0)
    end = max(words, default=0)
    known = {
        tuple(words.get(at + 4 * k) for k in range(MODULE_WORDS))
        for at in range(table, end, 4 * MODULE_WORDS)
    }
    for module in sorted(_modules(recording, board), key=lambda each: each.base):
        if here != there or tuple(board.read_words(module.address, MODULE_WORDS)) not in known:
            raise ValueError(
                f"{recording.path} was recorded with other firmware than {board.url} has: its {module.name} "
                f"was not as it is here. The recording's attachment {form.DUMP_NAME} is a dump of its card; "
                "with that in a file, emu:///FILE is the same card"
            )


def _modules(recording: Recording, board: Board) -> set[ModuleDescriptor]:
    """Of this card, whose registers were recorded."""
    modules = sorted(board.modules, key=lambda module: module.base)
    found = set()
    for register in recording.image:
        below = [module for module in modules if module.base <= register]
        if below:
            found.add(below[-1])
    return found


def raise_for_other_remotes(recording: Recording, board: Board) -> None:
    """ValueError if a channel that runs has other process data than it had then."""
    if recording.descriptors is None or "sserial" not in board._parts:
        return
    now = {
        key_prefix(port, c): c
        for port in Descriptors.parse(describe(board)).text.ports
        for c in port.channels
    }
    for port in recording.descriptors.text.ports:
        for then in port.channels:
            prefix = key_prefix(port, then)
            running = now.get(prefix)
            if running is not None and _process_data(running) != _process_data(then):
                raise ValueError(
                    f"{prefix[:-1]} was {then.name!r} in software mode {then.mode} in {recording.path}, and "
                    f"is {running.name!r} in software mode {running.mode}: start remotes as they were then"
                )


def _process_data(channel: ChannelText) -> tuple[object, ...]:
    """What must agree; scalings are the program's."""
    fields = [(f.name, f.kind, f.bits, f.direction, f.minimum, f.maximum) for f in channel.fields]
    return channel.name, channel.mode, channel.registers, fields
