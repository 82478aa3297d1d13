"""A board: words at addresses, checked, counted, and made safe on every way out."""

from __future__ import annotations

import dataclasses
import struct
import threading
from pathlib import Path

import pytest

import hostmot2
from hostmot2 import errors, transports
from hostmot2.board import SafeOff
from hostmot2.boards import BoardFacts
from hostmot2.default import DefaultBoard
from hostmot2.emulator import EmulatedBoard
from hostmot2.idrom import HostMot2Warning

GOLDEN = Path(__file__).parent / "golden" / "card"


def golden_words(name: str = "idrom_5i25_7i77x2") -> dict[int, int]:
    lines = (GOLDEN / f"{name}.hex").read_text().splitlines()
    return {int(address, 16): int(value, 16) for address, value in map(str.split, lines)}


@pytest.fixture
def card_file(tmp_path: Path) -> Path:
    image = bytearray(0x10000)
    for address, word in golden_words().items():
        struct.pack_into("<I", image, address, word)
    path = tmp_path / "card.bin"
    path.write_bytes(image)
    return path


def file_word(path: Path, address: int) -> int:
    return struct.unpack_from("<I", path.read_bytes(), address)[0]


def test_words_are_little_endian_in_the_mapped_file(card_file: Path) -> None:
    with hostmot2.open(f"pci://{card_file}") as board:
        board.write(0x1000, 0x11223344)
        assert card_file.read_bytes()[0x1000:0x1004] == b"\x44\x33\x22\x11"
        assert board.read(0x0100) == 0x55AACAFE


def test_a_read_of_one_is_a_word_and_of_several_a_list(card_file: Path) -> None:
    with hostmot2.open(f"pci://{card_file}") as board:
        assert board.read(0x0104) == 0x54534F48
        assert board.read(0x0104, 2) == [0x54534F48, 0x32544F4D]
        assert board.read(0x0104, count=1) == 0x54534F48


def test_consecutive_words_are_written_in_place(card_file: Path) -> None:
    with hostmot2.open(f"pci://{card_file}") as board:
        board.write(0xFFF8, [1, 0xFFFFFFFF])
        assert board.read(0xFFF8, 2) == [1, 0xFFFFFFFF]
    assert file_word(card_file, 0xFFFC) == 0xFFFFFFFF


@pytest.mark.parametrize("address", [0x1001, 0x1002, -4, 0x10000, 0xFFFFFFFF0])
def test_an_impossible_address_is_a_value_error(card_file: Path, address: int) -> None:
    with hostmot2.open(f"pci://{card_file}") as board:
        with pytest.raises(ValueError, match="0x"):
            board.read(address)
        with pytest.raises(ValueError, match="0x"):
            board.write(address, 0)


def test_words_beyond_the_register_file_are_a_value_error(card_file: Path) -> None:
    with hostmot2.open(f"pci://{card_file}") as board:
        with pytest.raises(ValueError, match="out of range"):
            board.read(0xFFFC, 2)
        with pytest.raises(ValueError, match="out of range"):
            board.write(0xFFFC, [1, 2])
        with pytest.raises(ValueError, match="at least 1"):
            board.read(0x1000, 0)
        with pytest.raises(ValueError, match="0xFFFFFFFF"):
            board.write(0x1000, 1 << 32)
        assert board.read(0xFFFC) == 0


def test_words_and_exchanges_are_counted(card_file: Path) -> None:
    with hostmot2.open(f"pci://{card_file}") as board:
        before = board.counters
        board.read(0x1000, 3)
        board.write(0x1000, [1, 2])
        after = board.counters
    assert {name: after[name] - before[name] for name in after} == {
        "exchanges": 2, "failures": 0, "words_read": 3, "words_written": 2,
    }  # fmt: skip


def test_a_closed_board_says_so(card_file: Path) -> None:
    board = hostmot2.open(f"pci://{card_file}")
    board.close()
    board.close()
    with pytest.raises(errors.TransportClosed):
        board.read(0x100)
    with pytest.raises(errors.TransportClosed):
        board.write(0x1000, 1)


def test_safe_off_runs_in_order_once_and_while_the_card_can_be_written(card_file: Path) -> None:
    board = hostmot2.open(f"pci://{card_file}")
    order: list[str] = []
    board.on_close(lambda: order.append("watchdog"), SafeOff.WATCHDOG)
    board.on_close(lambda: board.write(0x1100, 0xAB), SafeOff.IOPORT)
    board.on_close(lambda: order.append("generators"), SafeOff.GENERATORS)
    board.on_close(lambda: order.append("sserial"), SafeOff.SSERIAL)
    board.on_close(lambda: order.append("later sserial"), SafeOff.SSERIAL)
    board.close()
    board.close()
    assert order == ["later sserial", "sserial", "generators", "watchdog"]
    assert file_word(card_file, 0x1100) == 0xAB


def test_restoring_goes_on_behind_a_part_that_fails(card_file: Path) -> None:
    board = hostmot2.open(f"pci://{card_file}")
    ran: list[str] = []

    def fail() -> None:
        ran.append("fails")
        raise errors.ModuleTimeout("the first that failed")

    board.on_restore(fail, SafeOff.GENERATORS)
    board.on_restore(lambda: ran.append("I/O ports"), SafeOff.IOPORT)
    with pytest.raises(errors.ModuleTimeout, match="the first"):
        board.restore()
    assert ran == ["fails", "I/O ports"]
    board.close()


def test_safe_off_goes_on_behind_an_action_that_fails(card_file: Path) -> None:
    board = hostmot2.open(f"pci://{card_file}")
    ran: list[str] = []

    def fail() -> None:
        raise errors.TransportTimeout("lost")

    board.on_close(fail, SafeOff.SSERIAL)
    board.on_close(lambda: ran.append("watchdog"), SafeOff.WATCHDOG)
    with pytest.raises(errors.TransportTimeout):
        board.close()
    assert ran == ["watchdog"]
    assert board.closed
    board.close()


@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_in_making_safe_does_that_part_again_and_the_others_as_well(
    card_file: Path, times: int
) -> None:
    board = hostmot2.open(f"pci://{card_file}")
    ran: list[str] = []

    def interrupted() -> None:
        ran.append("ioport")
        if len(ran) <= times:
            raise KeyboardInterrupt

    board.on_close(interrupted, SafeOff.IOPORT)
    board.on_close(lambda: board.write(0x1100, 0xAB), SafeOff.WATCHDOG)
    with pytest.raises(KeyboardInterrupt) as caught:
        board.close()
    assert ran == ["ioport", "ioport"]
    assert len(getattr(caught.value, "__notes__", [])) == times - 1, "the second one is told as well"
    assert file_word(card_file, 0x1100) == 0xAB
    assert board.closed


def test_ctrl_c_before_making_safe_leaves_nothing_out(
    card_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    board = hostmot2.open(f"pci://{card_file}")
    make_safe, calls = board._make_safe, []

    def interrupted() -> list[BaseException]:
        calls.append("called")
        if len(calls) == 1:
            raise KeyboardInterrupt
        return make_safe()

    monkeypatch.setattr(board, "_make_safe", interrupted)
    board.on_close(lambda: board.write(0x1100, 0xAB), SafeOff.IOPORT)
    with pytest.raises(KeyboardInterrupt):
        board.close()
    assert file_word(card_file, 0x1100) == 0xAB
    assert board.closed


def test_ctrl_c_while_the_transport_closes_lets_go_of_all_of_it(card_file: Path) -> None:
    board = hostmot2.open(f"pci://{card_file}")

    def interrupted() -> None:
        raise KeyboardInterrupt

    board._transport.on_close.insert(0, interrupted)
    with pytest.raises(KeyboardInterrupt):
        board.close()
    assert board.closed
    hostmot2.open(f"pci://{card_file}").close()  # the lock is free


def test_a_block_that_ends_well_raises_what_closing_could_not_do(card_file: Path) -> None:
    def fail() -> None:
        raise errors.TransportTimeout("lost")

    board = hostmot2.open(f"pci://{card_file}")
    board.on_close(fail, SafeOff.IOPORT)
    with pytest.raises(errors.TransportTimeout, match="lost"), board:
        pass
    assert board.closed


def test_an_exception_in_the_block_closes_and_is_the_one_that_is_raised(card_file: Path) -> None:
    ran: list[str] = []

    def fail() -> None:
        ran.append("ioport")
        raise errors.TransportTimeout("lost")

    board = hostmot2.open(f"pci://{card_file}")
    board.on_close(fail, SafeOff.IOPORT)
    with pytest.raises(ZeroDivisionError) as caught, board:
        raise ZeroDivisionError
    assert ran == ["ioport"]
    assert any("lost" in note for note in caught.value.__notes__)


def test_threads_share_a_board(card_file: Path) -> None:
    with hostmot2.open(f"pci://{card_file}") as board:
        torn: list[list[int]] = []

        def work(value: int) -> None:
            for _ in range(200):
                with board.lock:
                    board.write(0x2000, [value, value])
                    words = board.read(0x2000, 2)
                if words != [value, value]:
                    torn.append(words)

        threads = [threading.Thread(target=work, args=(value,)) for value in (1, 2, 3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert torn == []


def test_an_unknown_attribute_is_an_attribute_error(card_file: Path) -> None:
    with hostmot2.open(f"pci://{card_file}") as board, pytest.raises(AttributeError, match="nonsense"):
        board.nonsense  # noqa: B018


@pytest.mark.parametrize(
    ("url", "name", "modules"),
    [
        ("emu://5i25+7i77", "5I25", 6),
        ("emu://5i25+7i77x2?clock=virtual", "5I25", 6),
        ("emu://6i25+7i77?wire=off", "6I25", 6),
        ("emu://7i92+7i77", "7I92", 7),
        ("emu://7i92+7i77?firmware=a", "7I92", 7),
    ],
)
def test_emulated_cards_open_by_url(url: str, name: str, modules: int) -> None:
    with hostmot2.open(url) as board:
        assert board.name == name
        assert len(board.modules) == modules
        assert len(board.pins) == 34


@pytest.mark.parametrize("url", ["emu://5i25+7i77?clock=slow", "emu://5i25+7i77?wheels=4", "ftp://x", "5i25"])
def test_an_impossible_url_is_a_value_error(url: str) -> None:
    with pytest.raises(ValueError, match=r"must be|unknown option"):
        hostmot2.open(url)


def test_a_card_that_is_not_in_the_board_table_opens_with_facts_of_the_callers(card_file: Path) -> None:
    words = bytearray(card_file.read_bytes())
    words[0x410:0x414] = b"9Z99"
    card_file.write_bytes(words)
    with pytest.warns(HostMot2Warning, match="MESA9Z99"):
        hostmot2.open(f"pci://{card_file}").close()
    mine = BoardFacts("9Z99", "MESA9Z99", 2, 17, ("P7", "P8"), 2, "")
    with hostmot2.open(f"pci://{card_file}", board=mine) as board:
        assert (board.pins[17].connector, board.pins[17].connector_pin) == ("P8", 1)
    with pytest.raises(errors.WrongIoPorts):
        hostmot2.open(f"pci://{card_file}", board=dataclasses.replace(mine, io_ports=3))


def test_an_emulated_board_outlives_the_driver_on_it() -> None:
    card = EmulatedBoard("5i25+7i77", clock="virtual")
    with hostmot2.open(card) as board:
        board.write(0x1100, 0x1)
        start = board.now_ns()
        board.pause(1e-3)
        assert board.now_ns() - start == 1_000_000
    assert card.read(0x1100) == 0x1


def test_the_link_of_an_emulated_card_recovers_to_its_configuration() -> None:
    """Over UDP there is more to it (test_udp_board.py)."""
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        module = board.encoders.modules[0]
        module.filter_rate = 2e6
        word = board.read(0x3900)
        board.write(0x3900, 0)
        board.recover()
        assert board.read(0x3900) == word
        board.cycle.arm_watchdog()
        board.pause(1.0)
        assert board.watchdog.check()
        board.recover()
        assert not board.watchdog.check()


def test_what_a_board_has_is_listed() -> None:
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        assert {"encoders", "sserial", "watchdog", "read", "close"} <= set(dir(board))


def test_a_default_board_opens_no_card_to_be_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HM2_BOARD", "emu://5i25+7i77?clock=virtual")
    default = DefaultBoard()
    assert "encoders" in dir(default)
    with pytest.raises(AttributeError, match="__wrapped__"):
        default.__wrapped__  # noqa: B018
    assert repr(default) == "<default board, not open>"
    with default as board:
        assert board.name == "5I25"
        assert repr(default) == repr(board)
    assert board.closed
    assert repr(default) == "<default board, not open>"
    default.close()


def test_a_never_opened_default_board_closes_as_well() -> None:
    DefaultBoard().__exit__(None, None, None)


def test_cycles_are_counted() -> None:
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        _ = board.encoders
        for _ in range(3):
            board.cycle.run()
        assert board.cycle.counters == {"cycles": 3, "failures": 0}


def test_a_transport_whose_package_is_missing_is_no_card(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(transports.TRANSPORTS, "udp", "hostmot2.transports.nowhere")
    with pytest.raises(errors.CardNotFound, match="the udp:// transport cannot be used here: No module"):
        hostmot2.open("udp://10.10.10.10")


@pytest.mark.parametrize(("width", "pin"), [(32, 8), (25, None)])
def test_pins_of_raw_ports_are_numbered_only_where_that_is_known(width: int, pin: int | None) -> None:
    facts = BoardFacts("X", "MESAX", 1, width, ("P1",), 2, "")
    assert facts.connector_pin(7) == ("P1", pin)


@pytest.mark.parametrize("seconds", [float("inf"), float("nan"), 1e300])
def test_a_pause_for_ever_is_refused(seconds: float) -> None:
    with hostmot2.open("emu://5i25+7i77?clock=virtual") as board:
        with pytest.raises(ValueError, match="a pause of"):
            board.pause(seconds)
        before = board.now_ns()
        board.pause(-1.0)
        assert board.now_ns() == before
