"""What a recording says about the card and the computer it was made with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hostmot2 import dump as dumps
from hostmot2.host_facts import facts
from hostmot2.recording import format as form
from hostmot2.recording.descriptors import describe
from hostmot2.recording.file import Attachment

if TYPE_CHECKING:
    from hostmot2.board import Board


def attachments_of(board: Board) -> list[Attachment]:
    """A dump of the card's registers, IDROM included, and the process data of its remotes.

    With them the file can be decoded and replayed where the card is not. Call it when remotes have been
    started and before cycles run: every register without side effects is read once. Raises TransportError.
    """
    text = dumps.to_text(dumps.take(board)).encode()
    return [Attachment(form.DUMP_NAME, text, "text/plain"), descriptors_of(board)]


def descriptors_of(board: Board) -> Attachment:
    """The process data of its remotes with the scalings in use now. Reads nothing from the card."""
    return Attachment(form.DESCRIPTORS_NAME, describe(board))


def host_metadata() -> dict[str, dict[str, str]]:
    """Processor, kernel, versions, as the metadata record hm2.host."""
    return {form.HOST: facts()}
