"""Transports of other packages: found by entry point, written in Python."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

import hostmot2
from hostmot2 import errors
from hostmot2.board import Board
from hostmot2.transports import schemes
from hostmot2.transports.host import HostBus

GOLDEN = Path(__file__).parent.parent / "golden/card/idrom_5i25_7i77x2.hex"


class Memory(HostBus):
    """A card that is a dictionary, with a FIFO at 0x6000."""

    def __init__(self) -> None:
        self.words = {int(a, 16): int(w, 16) for a, w in map(str.split, GOLDEN.read_text().splitlines())}
        self.fifo = [1, 2, 3]
        self.failure: Exception | None = None
        self.closed = 0

    def read(self, address: int, count: int) -> Sequence[int]:
        if self.failure:
            raise self.failure
        if address == 0x6000:
            return [self.fifo.pop(0)]
        return [self.words.get(address + 4 * i, 0) for i in range(count)]

    def write(self, address: int, words: Sequence[int]) -> None:
        if self.failure:
            raise self.failure
        for i, word in enumerate(words):
            self.words[address + 4 * i] = word

    def close(self) -> None:
        self.closed += 1


PACKAGE = """
import test_other_packages
opened = []
def open_transport(url):
    bus = test_other_packages.Memory()
    opened.append(bus)
    return bus.transport(url, model="5I25")
"""


def test_an_entry_point_opens_its_scheme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "parport_card.py").write_text(PACKAGE)
    metadata = tmp_path / "parport_card-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: parport-card\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[hostmot2.transports]\nepp = parport_card:open_transport\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setitem(sys.modules, "test_other_packages", sys.modules[__name__])
    assert "epp" in schemes()
    with hostmot2.open("epp://0x378") as board:
        assert (board.name, board.url, len(board.modules)) == ("5I25", "epp://0x378", 6)
        board.write(0x1100, [1, 2])
        assert board.read(0x1100, 2) == [1, 2]


def test_a_bus_in_python_is_closed_once() -> None:
    bus = Memory()
    with Board(bus.transport("memory://")) as board:
        board.close()
    assert bus.closed == 1


def test_a_fifo_is_read_word_by_word() -> None:
    from hostmot2._core import ffi, lib

    with Board(Memory().transport("memory://")) as board:
        words = ffi.new("uint32_t[3]")
        flags = lib.HM2_TRANSFER_READ | lib.HM2_TRANSFER_SAME_ADDRESS
        transfer = ffi.new("hm2_transfer *", (0x6000, 3, flags, words))
        assert lib.hm2_exchange(board.handle, transfer, 1, ffi.NULL) == lib.HM2_OK
        assert list(words) == [1, 2, 3]


@pytest.mark.parametrize(
    ("failure", "kind"),
    [
        (TimeoutError("nobody"), errors.TransportTimeout),
        (OSError(5, "broken"), errors.TransportError),
        (RuntimeError("bug"), errors.TransportError),
    ],
)
def test_what_a_bus_in_python_raises_becomes_a_transport_error(failure: Exception, kind: type) -> None:
    bus = Memory()
    with Board(bus.transport("memory://")) as board:
        bus.failure = failure
        with pytest.raises(kind, match=type(failure).__name__) as caught:
            board.read(0x1000)
        assert type(caught.value) is kind
        assert caught.value.address == 0x1000
        assert caught.value.os_errno == (5 if isinstance(failure, OSError) and failure.errno else None)


def test_a_bus_that_returns_too_few_words_is_an_error() -> None:
    class Short(Memory):
        def read(self, address: int, count: int) -> Sequence[int]:
            return super().read(address, count)[: 1 if address == 0x2000 else None]

    with (
        Board(Short().transport("memory://")) as board,
        pytest.raises(errors.TransportError, match="1 words"),
    ):
        board.read(0x2000, 2)
