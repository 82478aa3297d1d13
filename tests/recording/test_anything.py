"""Whatever happens to exchanges and remotes: what is decoded of a recording is what the driver made of it."""

from __future__ import annotations

import random

import numpy as np
import pytest

from hostmot2 import Board
from hostmot2._core import ffi, lib
from hostmot2.emulator import EmulatedBoard, catalog
from hostmot2.recording import read, record
from hostmot2.recording.bus import BusAround, places
from hostmot2.transports.emulated import transport_of

FATES = ("request lost", "reply lost", "write's reply lost", "read's reply lost", "not begun")
CYCLES = 150


class Fateful(BusAround):
    """A bus on which exchanges meet their fate."""

    fate = ""
    _writes = False

    def begin(self, transfers, count, error):
        self._writes = all(write for _, write, _, _ in places(transfers, count))
        if self.fate == "not begun":
            return lib.HM2_ERR_IO
        return lib.HM2_OK if self.fate == "request lost" else super().begin(transfers, count, error)

    def finish(self, deadline_ns, error):
        status = lib.HM2_OK if self.fate == "request lost" else super().finish(deadline_ns, error)
        mine = {"write's reply lost": self._writes, "read's reply lost": not self._writes}
        if not self.fate or not mine.get(self.fate, True):
            return status
        error.status = lib.HM2_ERR_TIMEOUT
        ffi.memmove(error.where, b"lost", 5)
        return lib.HM2_ERR_TIMEOUT


def disturb(remotes, line, board, chance):
    for remote in remotes:
        remote.inputs = chance.randbytes(len(remote.inputs))
        if chance.random() < 0.2:
            remote.alive = chance.random() < 0.9
        if chance.random() < 0.02:
            remote.inject(bad_crc=1)
    line.fate = chance.choice(FATES) if chance.random() < 0.15 else ""
    if chance.random() < 0.1:
        board.pause(chance.random() * 0.003)


@pytest.mark.parametrize("style", ["pipelined", "read-modify-write"])
@pytest.mark.parametrize("seed", range(4))
def test_decoded_process_data_is_what_the_driver_saw(tmp_path, style, seed):
    chance = random.Random(seed)
    with EmulatedBoard("5i25+7i77", clock="virtual") as card:
        card.sserial[0].attach(2, catalog.remote("stmbl"), through_pins=True)  # numbers without limits
        line = Fateful(transport_of(card))
        with Board(line.transport) as board:
            board.sserial.start(0x07).raise_for_failed()
            remotes = [card.sserial[0].remote(number) for number in range(3)]
            engine = board.engine(1000, style=style, dead_man=0, stale_limit=0)
            with record(engine, tmp_path / "run.mcap"), engine:
                for _ in range(CYCLES):
                    disturb(remotes, line, board, chance)
                    engine.step()
                line.fate = ""
    run = read(tmp_path / "run.mcap")
    assert not run.missing
    assert any(run["status"])
    inputs = [signal.name for signal in run.inputs if signal.name.startswith("sserial")]
    assert {"sserial0.0.Input", "sserial0.2.pos_fb"} <= set(inputs) <= set(run.elements)
    for name in inputs:
        assert np.array_equal(run.elements[name].astype(float), run[name], equal_nan=True), name
