"""A recording is replayed on a card like its own, or not at all: its words would be taken for others."""

from __future__ import annotations

from dataclasses import replace

import pytest

import hostmot2
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.cards import card as described
from hostmot2.recording import Replay, read, record
from hostmot2.transports.emulated import transport_of

CARD = "5i25+7i77"
DUMP = "board.hm2dump"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A 7I77 with its analog inputs, for some cycles."""
    path = tmp_path_factory.mktemp("likeness") / "run.mcap"
    with hostmot2.open(EmulatedBoard(CARD, clock="virtual")) as board:
        board.sserial.channels[0].mode = 2
        board.sserial.start(0x03).raise_for_failed()
        engine = board.engine(1000)
        with record(engine, path), engine:
            for _ in range(5):
                engine.step()
    return read(path)


def start(board, mode=2):
    board.sserial.channels[0].mode = mode
    board.sserial.start(0x03).raise_for_failed()
    board.sserial.cyclic = 0x03


def test_the_same_card_is_taken_and_so_is_the_one_of_the_attached_dump(run, tmp_path):
    (tmp_path / DUMP).write_bytes(run.attachments[DUMP])
    for url in (f"emu://{CARD}?clock=virtual", f"emu://{tmp_path / DUMP}?clock=virtual"):
        with Replay(run, url).open() as board:
            assert board.idrom.board_name == "MESA5I25"


@pytest.mark.parametrize("other", ["7i80hd", "7i96"])
def test_a_card_with_other_modules_is_refused(run, other):
    with pytest.raises(ValueError, match=r"run\.mcap was recorded with other firmware"):
        Replay(run, f"emu://{other}?clock=virtual").open()


def test_a_card_on_another_clock_is_refused(run):
    slower = replace(described(CARD), clock_low=25_000_000)
    with EmulatedBoard(slower, clock="virtual") as card, pytest.raises(ValueError, match="other firmware"):
        Replay(run, transport_of(card)).open()


def test_a_remote_in_another_software_mode_is_refused(run):
    replay = Replay(run, f"emu://{CARD}?clock=virtual")
    with replay.open() as board:
        start(board, mode=0)
        with pytest.raises(
            ValueError, match=r"sserial0\.0 was '7I77' in software mode 2 in .*, and is '7I77' in "
        ):
            replay.play(0)


def test_remotes_as_they_were_are_taken_whatever_their_scaling(run):
    replay = Replay(run, f"emu://{CARD}?clock=virtual")
    with replay.open() as board:
        start(board)
        board.sserial.channels[0].inputs.configure("fieldvoltage", scale=7.0)
        replay.play(0)
        replay.stop()


def test_a_recording_that_says_nothing_of_its_card_is_replayed_on_any(run):
    bare = read(run.path)
    bare.attachments = {}
    replay = Replay(bare, "emu://7i96?clock=virtual")
    with replay.open():
        replay.play(0)
