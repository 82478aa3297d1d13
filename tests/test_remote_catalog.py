"""The built-in remotes describe themselves consistently and behave like cards."""

import contextlib

import pytest
from lbp import ask, clear_faults, read, with_crc, write
from test_remote_wire import Line
from toc_reader import Mode, Record, toc

from hostmot2._core import lib
from hostmot2.emulator import DescribedRemote, RemoteDescription, SoftwareMode
from hostmot2.emulator.catalog import CATALOG, remote
from hostmot2.fields import Direction, Field, FieldKind

DISCOVERED = [name for name, description in CATALOG.items() if description.model is None]
INPUT, BOTH, OUTPUT = 0x00, 0x40, 0x80
US = 1_000_000


def advance(card: DescribedRemote, now_us: float) -> None:
    lib.hm2_remote_advance(card.handle, round(now_us * US))


def discover(card: DescribedRemote, mode: int) -> tuple[int, int, list[Record | Mode], list[Record | Mode]]:
    """Sizes, PTOC and GTOC through the line, as a host finds them."""

    def get(address: int, size: int) -> bytes:
        answer = read(card, address, size)
        assert answer is not None, f"no memory at {address:#06x}"
        return answer

    assert ask(card, 0xE6, mode) == b""
    answer = ask(card, 0xBB)
    assert answer is not None
    receive, transmit = answer[0], answer[1]
    ptoc, gtoc = (int.from_bytes(answer[at : at + 2], "little") for at in (2, 4))
    return receive, transmit, toc(get, ptoc), toc(get, gtoc)


@pytest.mark.parametrize("name", DISCOVERED)
def test_tables_agree_with_the_sizes_in_every_software_mode(name: str) -> None:
    card = remote(name)
    for mode in card.description.modes:
        receive, transmit, ptoc, gtoc = discover(card, mode.index)
        elements = [entry for entry in ptoc if isinstance(entry, Record)]
        inputs = sum(e.bits for e in elements if e.direction in (INPUT, BOTH))
        outputs = sum(e.bits for e in elements if e.direction in (OUTPUT, BOTH))
        assert receive == 1 + -(-inputs // 8)
        assert transmit == -(-outputs // 8)
        assert receive <= 13
        assert transmit <= 12
        assert len(ask(card, 0xBD, bytes(transmit)) or b"") == receive
        modes = [entry for entry in ptoc if isinstance(entry, Mode)]
        if card.description.modes_in_ptoc:
            assert modes == [Mode(*_hardware(card)), Mode(mode.index, 1, mode.name)]
        names = [e.name.lower() for e in elements if e.kind]
        assert len(set(names)) == len(names)
        if card.description.globals_listed:
            software = [entry for entry in gtoc if isinstance(entry, Mode)]
            assert software == [Mode(m.index, 1, m.name) for m in card.description.modes]
        listed = {e.address for e in elements}
        for entry in gtoc:
            if isinstance(entry, Record) and entry.address not in listed:
                assert entry.bits in (8, 16, 32, 64)
                assert entry.name.lower() not in names


def _hardware(card: DescribedRemote) -> tuple[int, int, str]:
    index, name = card.description.hardware_mode
    return index, 0, name


def names(entries: list[Record | Mode]) -> list[tuple[str, int, int]]:
    return [(e.name, e.kind, e.bits) for e in entries if isinstance(e, Record)]


def test_7i77_field_io_modes() -> None:
    card = remote("7i77-io")
    digital = [("Output", 1, 16), ("Input", 1, 32)]
    analog = [(f"AnalogIn{n}", 2, 8) for n in range(4)]
    more = [("FieldVoltage", 2, 8), ("Enc0", 8, 8), ("Enc1", 8, 8)]
    for mode, expected, sizes in (
        (0, digital, (5, 2)),
        (1, digital + analog, (9, 2)),
        (2, digital + analog + more[:1], (10, 2)),
        (3, digital + analog + more, (12, 2)),
    ):
        receive, transmit, ptoc, _ = discover(card, mode)
        assert (names(ptoc), receive, transmit) == (expected, *sizes)
    _, _, _, gtoc = discover(card, 0)
    listed = {name.lower() for name, _, _ in names(gtoc)}
    assert listed >= {
        *("analogin0", "analogin1", "analogin2", "analogin3", "encmode0", "encmode1", "fieldvoltage"),
        *("nvencmode0", "nvencmode1", "nvunitnumber", "nvwatchdogtimeout", "swrevision"),
    }


def test_7i77_analog_takes_the_published_frames() -> None:
    card = remote("7i77-analog")
    assert discover(card, 0)[:2] == (1, 10)
    clear_faults(card)
    answer = card.exchange(bytes.fromhex("BD 99 61 66 30 13 33 F3 7F 00 60 62"))
    assert answer == b"\0\0"
    volts = [card.get(f"analogout{axis}") for axis in range(6)]
    assert volts == pytest.approx([1, 2, 3, 4, 5, -10], abs=0.003)
    assert (card.get("analogena"), card.get("spinena")) == (True, False)
    card.exchange(bytes.fromhex("BD FF 0F 00 02 80 FF 03 80 FF C7 A5"))
    assert [card.get_raw(f"AnalogOut{axis}") for axis in range(6)] == [
        *(0x0FFF, 0x1000, 0, 0x07FF, 0x1800, 0x03FF),
    ]


def test_reference_remote_and_stmbl_have_their_published_tables() -> None:
    card = remote("7i90")
    receive, transmit, ptoc, gtoc = discover(card, 0)
    assert (receive, transmit, gtoc, card.ptoc, card.gtoc) == (10, 9, [], 0x200, 0x220)
    assert ask(card, 0xBC) == (0x12345678).to_bytes(4, "little")
    assert [e.name for e in ptoc] == [
        *("standard", "standard", "P1-Out", "P2-Out", "P3-Out", "P1-In", "P2-In", "P3-In"),
    ]
    assert read(card, 0x01FF) is None
    assert read(card, 0x0800) is None
    assert read(card, 0x07FF) == b"\0"
    assert card.lbp_status == 0x20
    drive = remote("stmbl")
    receive, transmit, ptoc, gtoc = discover(drive, 0)
    assert (receive, transmit, drive.ptoc, drive.gtoc) == (11, 9, 0x18B, 0x1A5)
    assert "scale" in [e.name for e in gtoc]


def test_stmbl_floats_and_the_bidirectional_index_enable() -> None:
    drive = remote("stmbl")
    clear_faults(drive)
    drive.set("pos_fb", -1.5)
    drive.set("current", 30.0)
    drive.set("in", 0b1010)
    host = bytes.fromhex("0000 c03f 0000 0040") + bytes(
        [0b0011_0101]
    )  # 1.5, 2.0, out 5, enable, index_enable
    answer = ask(drive, 0xBD, host)
    assert answer is not None
    assert answer[:9] == b"\0" + bytes.fromhex("0000 c0bf 0000 0000")
    assert answer[9] == 0x7F
    assert answer[10] == 0b0010_1010
    assert (drive.get("pos_cmd"), drive.get("vel_cmd"), drive.get("out"), drive.get("enable")) == (
        1.5,
        2.0,
        5,
        True,
    )
    drive.set("index_enable", False)
    assert ask(drive, 0xBD, host[:8] + b"\x15")[10] == 0b0000_1010  # type: ignore[index]


@pytest.mark.parametrize("name", DISCOVERED)
def test_a_freshly_powered_card_keeps_its_outputs_off_until_its_fault_is_cleared(name: str) -> None:
    card = remote(name)
    size = card.transmit_size
    assert ask(card, 0xD7) == b"\x01"
    assert (ask(card, 0xBD, b"\xff" * size) or b"")[0] == 0x01
    assert card.outputs == bytes(size)
    clear_faults(card)
    assert ask(card, 0xD7) == b"\0"
    assert (ask(card, 0xBD, b"\xff" * size) or b"")[0] == 0
    assert card.outputs == b"\xff" * size


@pytest.mark.parametrize("name", CATALOG)
def test_the_watchdog_turns_outputs_off_for_good(name: str) -> None:
    card = remote(name)
    start(card)
    size = card.transmit_size
    on = b"\xff" * (size if card.model != "7i64" else 3) + bytes(0 if card.model != "7i64" else 1)
    period = 41_667.0 if name == "8i20" else 49_408.0 if name == "7i90" else 50_000.0
    assert ask(card, 0xBD, on)
    advance(card, 10.0)
    assert ask(card, 0xBD, on)
    advance(card, 10.0 + period - 1)
    assert card.outputs == on
    advance(card, 10.0 + period + 2)
    assert card.outputs == bytes(size)
    answer = ask(card, 0xBD, on) or b""
    assert {"8i20": answer[2:3], "7i64": answer[3:4]}.get(name, answer[:1]) == (
        b"\x08" if name == "7i64" else b"\x01"
    )
    assert card.outputs == bytes(size)
    start(card)
    ask(card, 0xBD, on)
    assert card.outputs == on


def start(card: DescribedRemote) -> None:
    if card.model == "8i20":
        assert write(card, 0x0854, b"\xff\xff") == b""
        assert read(card, 0x0852, 2) == b"\0\0"
        assert write(card, 0x0804, b"\xff\xff") == b""
        assert read(card, 0x08FE, 2) == b"\xff\xff"
    elif card.model == "7i64":
        assert ask(card, 0xBD, b"\0\0\0\x08") is not None
    else:
        clear_faults(card)


def test_chatter_feeds_the_watchdog() -> None:
    card = remote("7i77-io")
    clear_faults(card)
    for step in range(10):
        advance(card, 30_000.0 * step)
        ask(card, 0xBD, b"\x01\x00")
    assert card.fault == 0


def test_an_illegal_software_mode_is_a_fault_that_cannot_be_cleared() -> None:
    card = remote("7i77-io")
    assert ask(card, 0xE6, 9) == b""
    clear_faults(card)
    assert ask(card, 0xD7) == b"\x40"
    assert ask(card, 0xE6, 1) == b""
    clear_faults(card)
    assert ask(card, 0xD7) == b"\0"
    assert (ask(card, 0xBB) or b"")[:2] == b"\x09\x02"


def test_inputs_by_name_survive_a_change_of_mode_and_show_in_ram() -> None:
    card = remote("7i77-io")
    card.set("input", 0x89ABCDEF)
    card.set("analogin2", 36.3)
    card.set("fieldvoltage", 23.3614)
    card.set("enc1", -3)
    assert ask(card, 0xE6, 3) == b""
    clear_faults(card)
    answer = ask(card, 0xBD, b"\x55\xaa")
    assert answer == bytes.fromhex("00 ef cd ab 89 00 00 ff 00 a4 00 fd")
    assert card.get("output") == 0xAA55
    output = card.elements["Output"].address
    assert read(card, output, 2) == b"\x55\xaa"
    assert write(card, output, b"\x0f\xf0") == b""
    assert card.outputs == b"\x0f\xf0"
    assert read(card, card.elements["Input"].address, 4) == bytes.fromhex("ef cd ab 89")


def test_nonvolatile_parameters_take_effect_after_a_power_cycle() -> None:
    card = remote("7i77-io", unit_number=0x12345678)
    assert ask(card, 0xBC) == bytes.fromhex("78 56 34 12")
    nonvolatile = card.parameters["NVWatchDogTimeout"].address
    ask(card, 0xEC, 1)
    assert read(card, nonvolatile, 2) == (50).to_bytes(2, "little")
    assert write(card, nonvolatile, (100).to_bytes(2, "little")) == b""
    assert write(card, card.parameters["NVUnitNumber"].address, b"\x01\x02\x03\x04") == b""
    ask(card, 0xEC, 0)
    assert card.get("watchdogtime") == 50
    card.power_cycle()
    assert card.get("watchdogtime") == 100
    assert ask(card, 0xBC) == b"\x01\x02\x03\x04"
    assert card.fault == 0x01


def test_the_baud_index_counts_after_a_power_cycle_and_the_jumper_overrides_it() -> None:
    card = remote("7i77-analog")
    assert (card.baud, card.timeout_bits) == (2_500_000, 40)
    card.set("nvbaudrate", 4)
    assert card.baud == 2_500_000
    card.power_cycle()
    assert card.baud == 115200
    in_setup = remote("7i77-analog", setup_jumper=True)
    assert (in_setup.baud, in_setup.timeout_bits) == (115200, 255)


def test_tables_cannot_be_written_and_memory_ends() -> None:
    card = remote("7i77-io")
    assert write(card, card.ptoc, b"\0") is None
    assert card.lbp_status & 0x20
    assert read(card, 0xFFF0) is None


def test_fe_5a_resets_the_processor_without_an_answer() -> None:
    card = remote("7i77-io")
    clear_faults(card)
    assert ask(card, 0xFE, 0x11) == b""
    assert card.fault == 0
    assert ask(card, 0xFE, 0x5A) is None
    assert card.fault == 0x01


def test_8i20_has_the_published_addresses_and_copies_its_eeprom() -> None:
    drive = remote("8i20", unit_number=0x1F)
    assert read(drive, 0x0928, 4) == b"\x1f\0\0\0"
    assert ask(drive, 0xBC) == b"\x1f\0\0\0"
    assert read(drive, 0x08E8, 2) == (750).to_bytes(2, "little")
    assert drive.exchange(bytes.fromhex("EC 01 66")) == b"\0"
    assert drive.exchange(bytes.fromhex("65 02 00 C4 09 D7")) == b"\0"
    assert drive.exchange(bytes.fromhex("45 02 00 95")).hex(" ") == "c4 09 13"
    assert drive.exchange(bytes.fromhex("EC 00 38")) == b"\0"
    assert drive.get("maxcurrent") == pytest.approx(7.5)
    drive.power_cycle()
    assert drive.get("maxcurrent") == pytest.approx(25.0)
    assert drive.get("nvkqi") == 150_000
    assert drive.get("kqi") == 150_000


def test_8i20_process_answer_is_status_fault_bus_voltage_temperature() -> None:
    drive = remote("8i20")
    start(drive)
    drive.set("busv", 320.0)
    drive.set("temperature", 71.5)  # above TEMPILIMIT: current limited
    answer = ask(drive, 0xBD, bytes.fromhex("34 12 cd ab"))
    assert answer == bytes.fromhex("01 02 00 00") + (32000).to_bytes(2, "little") + (7150).to_bytes(
        2, "little"
    )
    assert read(drive, 0x0830, 2) == b"\x34\x12"
    assert read(drive, 0x0860, 2) == b"\xcd\xab"


def broken(card: DescribedRemote, sound: object) -> bool:
    try:
        return repr(discover(card, 0)) != repr(sound)
    except AssertionError:
        return True


@pytest.mark.parametrize(
    "what", ["record_type", "bits", "data_type", "direction", "limits", "pointer", "string"]
)
def test_a_corrupt_table_is_whole_again_after_a_power_cycle(what: str) -> None:
    card, whole = remote("7i77-io"), remote("7i77-io")
    sound = discover(whole, 0)
    card.corrupt(what)
    with contextlib.suppress(UnicodeDecodeError):  # the plain reader stumbles: broken enough
        assert broken(card, sound)
    card.power_cycle()
    assert discover(card, 0) == sound


def test_values_are_checked() -> None:
    card = remote("7i77-io")
    with pytest.raises(KeyError, match="FieldVoltage"):
        card.get("nonsense")
    with pytest.raises(ValueError, match="output"):
        card.set("output", 1)
    with pytest.raises(ValueError, match="bits"):
        card.set("input", 1 << 32)
    with pytest.raises(ValueError, match="number"):
        card.set("analogin0", float("nan"))
    with pytest.raises(KeyError, match="7i77-io"):
        remote("7i78")


def test_a_remote_from_a_users_description() -> None:
    description = RemoteDescription(
        name="MINE",
        unit_number=7,
        modes=(
            SoftwareMode(
                0,
                "only",
                (
                    Field("Speed", FieldKind.SIGNED, 12, Direction.OUTPUT, -100.0, 100.0, "rpm"),
                    Field("", FieldKind.PAD, 4, Direction.OUTPUT),
                    Field("Level", FieldKind.UNSIGNED, 10, Direction.INPUT, -5.0, 5.0, "V"),
                ),
            ),
        ),
        gated=False,
    )
    mine = DescribedRemote(description)
    assert discover(mine, 0)[:2] == (3, 2)
    mine.set("level", 5.0)
    assert ask(mine, 0xBD, b"\x00\x08") == b"\x00\xff\x03"
    assert mine.get("speed") == pytest.approx(-100.0)
    assert mine.get("level") == pytest.approx(5.0)


def test_a_card_on_the_line_answers_within_its_turnaround() -> None:
    card = remote("7i77-io", turnaround_us=3.0)
    line = Line(card)
    middle = line.send_frame(0, bytes.fromhex("bb 12"))
    heard = line.heard()
    assert heard[0][0] == middle + 3 * US
    assert len(heard) == 7


def flash_frames(block: bytes) -> list[bytes]:
    return [
        bytes([0x67]) + offset.to_bytes(2, "little") + block[offset : offset + 8]
        for offset in range(0, len(block), 8)
    ]


def test_flash_is_erased_and_written_in_blocks_and_outlives_power() -> None:
    card = remote("7i77-io")
    assert ask(card, 0xD4) == b"\x0d"
    assert card.exchange(bytes.fromhex("EC 02 84")) == b"\0"
    assert (ask(card, 0x44, b"\x04\x80"), ask(card, 0x44, b"\x05\x80")) == (b"\x0a", b"\x08")
    card.poke(0x400, bytes(1024), space=2)
    assert card.exchange(bytes.fromhex("66 00 80 00 04 00 00 F3")) == b"\0"
    assert card.exchange(bytes.fromhex("64 07 80 FE A0")) == b"\0"
    assert card.peek(0x3FF, 1026, space=2) == b"\xff" * 1026
    data = bytes(range(256))
    for frame in flash_frames(data):
        assert ask(card, frame) == b""
    assert card.peek(0x400, 256, space=2) == b"\xff" * 256
    assert ask(card, 0x64, b"\x07\x80\xfd") == b""
    assert card.peek(0x400, 256, space=2) == data
    assert ask(card, 0x64, b"\x07\x80\x11") is None  # no such commit
    assert ask(card, 0x64, b"\x00\x01\x00") is None  # behind the buffer
    saved = card.nonvolatile
    card.power_cycle()
    assert card.peek(0x400, 256, space=2) == data
    other = remote("7i77-io")
    other.nonvolatile = saved
    assert other.nonvolatile == saved
    with pytest.raises(ValueError, match="flash"):
        other.nonvolatile = {"flash": b"short"}


def test_flash_programming_only_clears_bits() -> None:
    card = remote("7i77-io")
    ask(card, 0xEC, 2)
    for value in (0xF0, 0x3C):
        assert ask(card, 0x64, b"\x00\x00", value) == b""
        assert ask(card, 0x64, b"\x07\x80\xfd") == b""
    assert card.peek(0, 1, space=2) == b"\x30"


def test_the_cookie_after_a_commit_comes_when_the_flash_is_done() -> None:
    card = remote("7i77-io", turnaround_us=3.0)
    line = Line(card)
    line.send_frame(0, with_crc(b"\xec\x02"))
    middle = line.send_frame(10**8, bytes.fromhex("64 07 80 FE A0"))
    assert [start - middle for start, _, _ in line.heard()[1:]] == [3 * US]
    line.send_frame(2 * 10**8, b"\xdf\x16")
    assert line.heard()[0][0] == middle + 20_000 * US
