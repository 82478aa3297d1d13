"""Of a cycle's two exchanges the second got lost: its readings count, the result of its DOIT does not."""

from __future__ import annotations

import pytest

from hostmot2 import Board
from hostmot2._core import ffi, lib
from hostmot2.emulator import EmulatedBoard
from hostmot2.errors import TransportTimeout
from hostmot2.recording import Replay, read, record
from hostmot2.recording.bus import BusAround, places
from hostmot2.transports.emulated import transport_of

CARD = "5i25+7i77"
MASK = 0x03
CYCLES = 40
LOST = {0, 10, 20, 21, 30}


class LosingWrites(BusAround):
    """Exchanges that only write are carried out while it is `losing`, but never answered."""

    losing = False
    _writes = False

    def begin(self, transfers, count, error):
        self._writes = all(write for _, write, _, _ in places(transfers, count))
        return super().begin(transfers, count, error)

    def finish(self, deadline_ns, error):
        status = super().finish(deadline_ns, error)
        if not (self.losing and self._writes):
            return status
        error.status = lib.HM2_ERR_TIMEOUT
        ffi.memmove(error.where, b"lost", 5)
        return lib.HM2_ERR_TIMEOUT


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The recording, and the field inputs that the driver had in each cycle."""
    path = tmp_path_factory.mktemp("lost") / "run.mcap"
    with EmulatedBoard(CARD, clock="virtual") as card:
        line = LosingWrites(transport_of(card))
        with Board(line.transport) as board:
            board.sserial.start(MASK).raise_for_failed()
            engine = board.engine(1000, style="read-modify-write", dead_man=0)
            seen = []
            with record(engine, path), engine:
                for cycle in range(CYCLES):
                    card.sserial[0].remote(0).inputs = bytes([cycle, 2, 3, 255 - cycle])
                    line.losing = cycle in LOST
                    seen.append(engine.step()["sserial0.0.Input"])
                line.losing = False
    return read(path), seen


def test_the_run_was_worth_recording(recorded):
    run, seen = recorded
    assert [index for index, status in enumerate(run["status"][:CYCLES]) if status] == sorted(LOST)
    assert len(set(seen)) > CYCLES / 2


def test_what_is_decoded_is_what_the_driver_took(recorded):
    run, seen = recorded
    assert run["sserial0.0.Input"].tolist()[:CYCLES] == seen
    assert run.elements["sserial0.0.Input"].tolist() == run["sserial0.0.Input"].tolist()


def test_the_replay_reads_what_was_read_and_loses_what_was_lost(recorded):
    run, seen = recorded
    replay = Replay(run, f"emu://{CARD}?clock=virtual")
    lost = set()
    with replay.open() as board:
        board.sserial.start(MASK).raise_for_failed()
        board.sserial.cyclic = MASK
        board.encoders  # noqa: B018 - took part then
        for index in range(CYCLES):
            replay.play(index)
            board.cycle.read()
            try:
                board.cycle.write()
            except TransportTimeout:
                lost.add(index)
            assert float(board.sserial.channels[0].inputs["input"]) == seen[index], index
        replay.stop()
    assert lost == LOST
