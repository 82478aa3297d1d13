"""The IDROM: real ones parse to the published tables, broken ones each raise their own exception.

Broken patterns 0 to 14 are those LinuxCNC rejects (fact sheet registers 1.8), on the same imaginary board:
one connector P99 with 24 pins unless said.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hostmot2 import boards, errors
from hostmot2.idrom import HostMot2Warning, ModuleDescriptor
from hostmot2.inventory import Inventory, read_inventory

GOLDEN = Path(__file__).parent / "golden" / "card"
ID = {0x100: 0x55AACAFE, 0x104: 0x54534F48, 0x108: 0x32544F4D, 0x10C: 0x400}
P99 = boards.BoardFacts("P99", "MESAP99", 1, 24, ("P99",), 0, "")
IOPORT = (0x01010003, 0x00051000, 0x0000001F)
WATCHDOG = (0x01010002, 0x00030C00, 0x00000000)
GPIO = 0x03000000

Words = dict[int, int]


def header(**changes: int) -> Words:
    """An ID block and a header of one 24-pin port; `changes` by field name."""
    fields = {
        "type": 2, "module_offset": 0x40, "pin_offset": 0x200,
        "name_low": 0x4153454D, "name_high": 0x00393950,
        "fpga_size": 9, "fpga_pins": 144, "io_ports": 1, "io_width": 24, "port_width": 24,
        "clock_low": 33333333, "clock_high": 200000000, "instance_stride_0": 4, "instance_stride_1": 64,
        "register_stride_0": 256, "register_stride_1": 256,
    }  # fmt: skip
    fields.update(changes)
    return ID | {0x400 + 4 * i: word for i, word in enumerate(fields.values())}


def good(*modules: tuple[int, int, int], pins: dict[int, int] | None = None, **changes: int) -> Words:
    """A whole, sound IDROM: an IOPort, `modules`, GPIO pins but for `pins`."""
    words = header(**changes)
    descriptors = [word for module in (IOPORT, *modules) for word in module]
    words |= {0x440 + 4 * i: word for i, word in enumerate(descriptors)}
    words |= {0x400 + words[0x408] + 4 * i: GPIO for i in range(words[0x420])}
    words |= {0x400 + words[0x408] + 4 * i: word for i, word in (pins or {}).items()}
    return words


def inventory(words: Words, *, board: boards.BoardFacts | None = P99, strict: bool = True) -> Inventory:
    def read(address: int, count: int) -> list[int]:
        assert address % 4 == 0
        assert 0 <= address <= 0x10000 - 4 * count
        return [words.get(address + 4 * i, 0) for i in range(count)]

    return read_inventory(read, board=board, strict=strict)


def broken(words: Words, kind: type[errors.IdromError], board: boards.BoardFacts = P99) -> errors.IdromError:
    with pytest.raises(errors.IdromError) as caught:
        inventory(words, board=board)
    assert type(caught.value) is kind
    return caught.value


def test_pattern_0_all_zero_fails_with_the_cookie() -> None:
    error = broken({}, errors.WrongCookie)
    assert (error.address, error.expected, error.received) == (0x100, 0x55AACAFE, 0)


@pytest.mark.parametrize("bit", [0, 7, 16, 31])
def test_a_cookie_with_one_wrong_bit_is_none(bit: int) -> None:
    error = broken(good() | {0x100: 0x55AACAFE ^ 1 << bit}, errors.WrongCookie)
    assert (error.expected, error.received) == (0x55AACAFE, 0x55AACAFE ^ 1 << bit)


def test_pattern_1_cookie_alone_fails_with_the_config_name() -> None:
    error = broken({0x100: 0x55AACAFE}, errors.WrongConfigName)
    assert (error.address, error.expected, error.received) == (0x104, 0x54534F48, 0)


def test_pattern_1_half_a_config_name_fails_too() -> None:
    error = broken({0x100: 0x55AACAFE, 0x104: 0x54534F48, 0x108: 0x3254}, errors.WrongConfigName)
    assert error.address == 0x108


def test_pattern_2_idrom_offset_0_fails_with_the_type_read_there() -> None:
    error = broken(ID | {0x10C: 0}, errors.WrongIdromType)
    assert (error.address, error.received) == (0, 0)


def test_pattern_3_type_1234_fails_with_the_type() -> None:
    error = broken(ID | {0x400: 0x1234}, errors.WrongIdromType)
    assert (error.address, error.received) == (0x400, 0x1234)


def test_pattern_4_port_width_0_fails_with_the_port_width() -> None:
    error = broken(ID | {0x400: 2}, errors.WrongPortWidth)
    assert (error.address, error.expected, error.received) == (0x424, 24, 0)


def test_pattern_5_port_width_29_fails_with_the_port_width() -> None:
    error = broken(ID | {0x400: 2, 0x424: 29}, errors.WrongPortWidth)
    assert (error.expected, error.received) == (24, 29)


def test_pattern_6_no_io_ports_fails_with_the_io_ports() -> None:
    error = broken(ID | {0x400: 2, 0x424: 24}, errors.WrongIoPorts)
    assert (error.address, error.expected, error.received) == (0x41C, 1, 0)


def test_pattern_7_io_width_99_fails_with_the_io_width() -> None:
    error = broken(ID | {0x400: 2, 0x424: 24, 0x41C: 1, 0x420: 99}, errors.WrongIoWidth)
    assert (error.address, error.expected, error.received) == (0x420, 24, 99)


def test_pattern_8_two_ports_on_a_board_of_one_fails_with_the_io_ports() -> None:
    error = broken(ID | {0x400: 2, 0x424: 24, 0x41C: 2, 0x420: 48}, errors.WrongIoPorts)
    assert (error.expected, error.received) == (1, 2)


def test_pattern_9_clock_low_12345_fails_with_clock_low() -> None:
    words = ID | {0x400: 2, 0x424: 24, 0x41C: 1, 0x420: 24, 0x428: 12345}
    error = broken(words, errors.ClockLowTooSlow)
    assert (error.address, error.expected, error.received) == (0x428, 1_000_000, 12345)


def test_pattern_10_clock_high_0_fails_with_clock_high() -> None:
    words = ID | {0x400: 2, 0x424: 24, 0x41C: 1, 0x420: 24, 0x428: 2_000_000}
    error = broken(words, errors.ClockHighTooSlow)
    assert (error.address, error.received) == (0x42C, 0)


def test_pattern_11_no_pin_descriptors_fails_with_pin_0_of_144() -> None:
    six = dataclasses.replace(P99, io_ports=6, connectors=("P99",) * 6)
    words = ID | {
        0x400: 2, 0x408: 0x1C0, 0x424: 24, 0x41C: 6, 0x420: 144, 0x428: 2_000_000, 0x42C: 2_000_000,
    }  # fmt: skip
    error = broken(words, errors.PinListTooShort, six)
    assert (error.index, error.address, error.expected) == (0, 0x5C0, 144)


def test_pattern_12_pins_without_an_ioport_module_fail() -> None:
    words = header()
    words |= {0x600 + 4 * i: GPIO for i in range(24)}
    error = broken(words, errors.IoportMissing)
    assert (error.address, error.expected) == (0x440, 3)


def test_pattern_13_port_width_24_on_a_board_of_5_fails_with_the_port_width() -> None:
    error = broken(ID | {0x400: 2, 0x424: 24}, errors.WrongPortWidth, dataclasses.replace(P99, port_width=5))
    assert (error.expected, error.received) == (5, 24)


def test_pattern_14_an_odd_width_the_board_has_passes_so_io_ports_0_is_what_fails() -> None:
    error = broken(ID | {0x400: 2, 0x424: 37}, errors.WrongIoPorts, dataclasses.replace(P99, port_width=37))
    assert error.received == 0


def test_a_sound_idrom_passes() -> None:
    found = inventory(good(WATCHDOG))
    assert [module.gtag for module in found.modules] == [3, 2]
    assert len(found.pins) == 24


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ({"io_ports": 42, "io_width": 1008, "port_width": 24}, errors.IoWidthLimit),
        ({"pin_offset": 0x201}, errors.WrongPinOffset),
        ({"pin_offset": 0x3C}, errors.WrongPinOffset),
        ({"pin_offset": 0xFBA4}, errors.WrongPinOffset),
        ({"pin_offset": 0xFFFFFFFC}, errors.WrongPinOffset),
        ({"module_offset": 0x42}, errors.WrongModuleOffset),
        ({"module_offset": 0}, errors.WrongModuleOffset),
        ({"module_offset": 0xFBF8}, errors.WrongModuleOffset),
        ({"module_offset": 0xFFFFFFF0}, errors.WrongModuleOffset),
    ],
)
def test_a_table_outside_its_room_has_its_own_error(change: dict[str, int], kind: type) -> None:
    ports = change.get("io_ports", 1)
    board = dataclasses.replace(P99, io_ports=ports, connectors=("P99",) * ports)
    broken(good() | header(**change), kind, board)


@pytest.mark.parametrize("offset", [0x402, 0xFFC4, 0xFFFC])
def test_an_idrom_offset_where_no_header_fits_has_its_own_error(offset: int) -> None:
    error = broken(good() | {0x10C: offset}, errors.WrongIdromOffset)
    assert (error.address, error.received) == (0x10C, offset)


def test_the_upper_half_of_the_idrom_offset_is_ignored() -> None:
    assert inventory(good() | {0x10C: 0xDEAD0400}).idrom.address == 0x400


def test_the_idrom_may_lie_anywhere() -> None:
    moved = {address + 0x8000 if address >= 0x400 else address: word for address, word in good().items()}
    found = inventory(moved | {0x10C: 0x8400})
    assert found.idrom.address == 0x8400
    assert len(found.pins) == 24


@pytest.mark.parametrize(("index", "word"), [(0, 0), (23, 0x0000C181)])
def test_a_pin_without_a_primary_tag_ends_the_list_early(index: int, word: int) -> None:
    error = broken(good(pins={index: word}), errors.PinListTooShort)
    assert (error.index, error.address, error.expected) == (index, 0x600 + 4 * index, 24)


def test_a_pin_that_is_no_ioport_pin_has_its_own_error() -> None:
    error = broken(good(pins={5: 0x04000000}), errors.WrongPrimaryTag)
    assert (error.index, error.expected, error.received) == (5, 3, 4)


def test_a_pin_beyond_bit_31_of_its_port_has_its_own_error() -> None:
    board = dataclasses.replace(P99, port_width=37)
    error = broken(good(port_width=37, io_width=37), errors.PinOutOfRange, board)
    assert (error.index, error.received) == (32, 32)


def test_a_module_list_without_an_end_is_walked_no_further_than_the_pins() -> None:
    error = broken(good(*[WATCHDOG] * 31, type=3, pin_offset=0x1C0), errors.ModuleListUnterminated)
    assert (error.index, error.address) == (32, 0x5C0)


def test_a_module_list_without_an_end_is_walked_no_further_than_48() -> None:
    error = broken(good(*[WATCHDOG] * 60, pin_offset=0x4000), errors.ModuleListUnterminated)
    assert error.index == 48


@pytest.mark.parametrize("tag", [0, 3, 0xFF])
def test_a_clock_tag_other_than_low_or_high_has_its_own_error(tag: int) -> None:
    error = broken(good((0x01000002 | tag << 16, *WATCHDOG[1:])), errors.WrongClockTag)
    assert (error.index, error.address, error.received) == (1, 0x44C, tag)


@pytest.mark.parametrize("selects", [0x02, 0x20, 0x0F, 0xF0])
def test_a_stride_selector_other_than_0_or_1_has_its_own_error(selects: int) -> None:
    error = broken(good((WATCHDOG[0], 0x00030C00 | selects << 24, 0)), errors.WrongStrideSelect)
    assert (error.index, error.received) == (1, selects)


def test_a_stride_of_zero_that_is_used_has_its_own_error() -> None:
    error = broken(good((0x020101C1, 0x10065A00, 0x3C), instance_stride_1=0), errors.ZeroStride)
    assert (error.index, error.address) == (1, 0x434)
    error = broken(good((0x010101C1, 0x01065A00, 0x3C), register_stride_1=0), errors.ZeroStride)
    assert (error.index, error.address) == (1, 0x43C)


def test_a_stride_of_zero_that_nothing_uses_passes() -> None:
    assert inventory(good(WATCHDOG, instance_stride_1=0, register_stride_1=0)).modules


def test_registers_beyond_the_register_file_have_their_own_error() -> None:
    error = broken(good((0x010101C1, 0x1006FB00, 0x3C)), errors.ModuleOutOfRange)
    assert (error.index, error.received, error.expected) == (1, 0x10000, 0xFFFC)


def test_instances_beyond_the_register_file_have_their_own_error() -> None:
    error = broken(good((0xFF01017F, 0x0001FFF0, 0x01)), errors.ModuleOutOfRange)
    assert error.received == 0xFFF0 + 254 * 4


def test_a_base_between_words_has_its_own_error() -> None:
    error = broken(good((0x0101017F, 0x00011002, 0x01)), errors.UnalignedModule)
    assert error.received == 0x1002


@pytest.mark.parametrize("stride", ["register_stride_0", "instance_stride_0"])
def test_a_stride_between_words_has_its_own_error(stride: str) -> None:
    error = broken(good(**{stride: 6}), errors.UnalignedModule)
    assert (error.index, error.expected, error.received) == (0, 4, 6)


def test_an_ioport_count_other_than_the_headers_has_its_own_error() -> None:
    words = good() | {0x440: 0x02010003}
    error = broken(words, errors.WrongIoportCount)
    assert (error.expected, error.received) == (1, 2)


def test_a_module_twice_has_its_own_error() -> None:
    error = broken(good(WATCHDOG, WATCHDOG), errors.DuplicateModule)
    assert (error.index, error.expected, error.received) == (2, 1, 2)


def test_an_ioport_twice_has_its_own_error() -> None:
    error = broken(good(IOPORT), errors.DuplicateModule)
    assert (error.index, error.expected) == (1, 0)


# (module, a form that is accepted); every accepted form of the sheet's table
ACCEPTED = [
    (0x02, [0], 3, 4, 0x00), (0x03, [0], 5, 4, 0x1F), (0x80, [0], 1, 4, 0x00),
    (0x04, [1, 2, 3, 0x83], 5, 4, 0x03), (0x0C, [2, 3, 4, 0x84], 5, 4, 0x03),
    (0x05, [0, 1, 2, 0x42, 0xC2], 10, 4, 0x1FF), (0x06, [0, 1], 5, 4, 0x03), (0x13, [0], 4, 4, 0x03),
    (0xC1, [0], 6, 0x40, 0x3C), (0xC6, [0], 10, 0x40, 0x3FC), (0x0E, [0], 3, 0x40, 0x07),
    (0x09, [0], 4, 0x10, 0x0F), (0x0A, [0], 4, 0x10, 0x0F),
    (0x1B, [0, 1, 2, 3], 4, 4, 0x0F), (0x1C, [0, 1, 2, 3], 4, 4, 0x0F),
    (0x08, [0], 4, 4, 0x03), (0x18, [0], 4, 4, 0x07), (0x19, [0], 3, 4, 0x1F), (0x1A, [0], 7, 4, 0),
    (0xC0, [0], 5, 4, 0x1F), (0x2B, [0], 11, 4, 0x1FF), (0xC7, [0], 6, 4, 0x3F), (0xC8, [0], 4, 4, 0x0F),
]  # fmt: skip


def form(gtag: int, version: int, registers: int, stride: int, multiple: int) -> tuple[Words, int]:
    """A sound IDROM with one module of that form, and the module's index."""
    select = 0 if stride == 4 else 0x10
    module = (0x01010000 | version << 8 | gtag, select << 24 | registers << 16 | 0x4000, multiple)
    strides = {"instance_stride_1": 0x40 if stride == 4 else stride}
    if gtag == 0x03:
        return good(**strides) | {0x440: module[0], 0x444: module[1], 0x448: module[2]}, 0
    return good(module, **strides), 1


@pytest.mark.parametrize("row", ACCEPTED, ids=lambda row: f"gtag_{row[0]:02X}")
def test_the_accepted_forms_pass_and_every_other_is_refused(
    row: tuple[int, list[int], int, int, int],
) -> None:
    gtag, versions, registers, stride, multiple = row
    for version in range(256):
        words, index = form(gtag, version, registers, stride, multiple)
        if version in versions:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", HostMot2Warning)
                assert inventory(words).modules[index].version == version
        else:
            assert broken(words, errors.UnsupportedModule).received == version
    for change in (
        (registers + 1, stride, multiple),
        (registers, stride * 2, multiple),
        (registers, stride, multiple ^ 1),
    ):
        words, index = form(gtag, versions[0], *change)
        assert broken(words, errors.UnsupportedModule).index == index


def test_the_old_sserial_with_five_registers_is_refused_with_what_differs() -> None:
    error = broken(good((0x010100C1, 0x10055A00, 0x1F)), errors.UnsupportedModule)
    assert (error.expected, error.received) == (6, 5)
    assert "number of registers" in str(error)


@pytest.mark.parametrize("gtag", [0x1E, 0x23, 0x2C, 0x2D, 0xC3])
def test_modules_without_a_checked_form_may_have_any_but_only_once(gtag: int) -> None:
    module = (0x0101FF00 | gtag, 0x00094000, 0x12345)
    assert len(inventory(good(module)).modules) == 2
    broken(good(module, module), errors.DuplicateModule)


@pytest.mark.parametrize(("gtag", "version"), [(0x04, 1), (0x0C, 2), (0x05, 1)])
def test_a_version_with_known_faults_warns(gtag: int, version: int) -> None:
    row = next(row for row in ACCEPTED if row[0] == gtag)
    with pytest.warns(HostMot2Warning, match=f"version {version}"):
        inventory(form(gtag, version, *row[2:])[0])


def test_an_unknown_gtag_warns_and_is_kept() -> None:
    with pytest.warns(HostMot2Warning, match="0x7F"):
        found = inventory(good((0x0101007F, 0x00014000, 0)))
    assert found.modules[1].name == "gtag 0x7F"


def test_a_pin_of_an_instance_that_is_not_there_has_its_own_error() -> None:
    encoder = (0x04010204, 0x00053000, 0x03)
    error = broken(good(encoder, pins={7: 0x03040401}), errors.WrongPinUnit)
    assert (error.index, error.address, error.expected, error.received) == (7, 0x61C, 4, 4)
    assert inventory(good(encoder, pins={7: 0x03030401, 8: 0x03800405})).pins[8].shared


def test_the_select_pin_of_a_second_7i77_counts_in_encoders() -> None:
    modules = [(0x0C01030C, 0x00053500, 3), (0x0101000D, 0, 0)]
    assert inventory(good(*modules, pins={0: 0x03060D81})).pins[0].secondary_unit == 6
    broken(good(*modules, pins={0: 0x030C0D81}), errors.WrongPinUnit)


def test_pins_of_a_module_that_is_not_there_are_gpio() -> None:
    assert inventory(good(pins={3: 0x03090681})).pins[3].secondary_gtag == 6


def test_an_output_on_two_pins_has_its_own_error() -> None:
    pwm = (0x02020006, 0x00054000, 3)
    error = broken(good(pwm, pins={2: 0x03010681, 9: 0x03010681}), errors.DuplicateOutput)
    assert (error.index, error.expected, error.received) == (9, 2, 0x03010681)
    inventory(good(pwm, pins={2: 0x03010681, 9: 0x03000681}))  # another instance
    inventory(good(pwm, pins={2: 0x03800683, 9: 0x03800683}))  # shared by all
    inventory(good(pins={2: 0x03000401, 9: 0x03000401}))  # an input may listen twice


def test_not_strict_leaves_out_what_it_does_not_know_and_warns() -> None:
    words = good(
        (0x01017702, 0x00030C00, 0),
        (0x02020006, 0x00054000, 3),
        pins={1: 0x03000681, 2: 0x03000681, 3: 0x03020681},
    )
    with pytest.warns(HostMot2Warning) as said:
        found = inventory(words, strict=False)
    assert [module.name for module in found.modules] == ["ioport", "pwmgen"]
    assert [str(one.message)[:8] for one in said] == ["HM2-E076", "HM2-E078", "HM2-E077"]


def table(name: str) -> tuple[list[list[str]], list[list[str]]]:
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in (GOLDEN / f"{name}.md").read_text().splitlines()
        if line.startswith("|") and line[2].isdigit()
    ]
    return [row for row in rows if len(row) == 13], [row for row in rows if len(row) == 5]


def golden(name: str) -> Words:
    lines = (GOLDEN / f"{name}.hex").read_text().splitlines()
    return {int(address, 16): int(word, 16) for address, word in map(str.split, lines)}


@pytest.mark.parametrize("name", ["idrom_5i25_7i77x2", "idrom_5i25_7i77_7i76"])
def test_the_idroms_of_the_published_firmware_parse_to_the_published_tables(name: str) -> None:
    found = inventory(golden(name), board=None)
    modules, pins = table(name)
    assert [
        [
            module.gtag,
            module.version,
            module.clock_tag,
            module.instances,
            module.base,
            module.num_registers,
            module.multiple,
        ]
        for module in found.modules
    ] == [[int(row[i], 0) for i in (2, 3, 4, 5, 6, 7, 9)] for row in modules]
    assert [(pin.index, f"{pin.connector}-{pin.connector_pin}", pin.word) for pin in found.pins] == [
        (int(row[0]), row[1], int(row[3], 0)) for row in pins
    ]
    idrom = found.idrom
    assert (idrom.config_name, idrom.board_name, idrom.type, idrom.fpga_size, idrom.fpga_pins) == (
        "HOSTMOT2", "MESA5I25", 3, 9, 144,
    )  # fmt: skip
    assert (idrom.io_ports, idrom.io_width, idrom.port_width) == (2, 34, 17)
    assert (idrom.clock_low, idrom.clock_high) == (33333333, 200000000)
    assert found.board is not None
    assert found.board.name == "5I25"
    sserial = next(module for module in found.modules if module.gtag == 0xC1)
    assert (sserial.register_stride, sserial.instance_stride, sserial.clock) == (0x100, 0x40, 33333333)


def module(*words: int) -> ModuleDescriptor:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HostMot2Warning)
        strides = {"instance_stride_1": 0x10} if words[0] & 0xFF in (0x09, 0x0A) else {}
        return inventory(good((words[0], words[1], words[2]), **strides)).modules[1]


A, B = "a", "b"
# register addresses of both generations (fact sheet registers 0); timer select is not a counted register
GENERATIONS = [
    (A, (0x010100C1, 0x10065A00, 0x3C), [0x5A00, 0x5B00, 0x5C00, 0x5D00, 0x5E00, 0x5F00]),
    (B, (0x010100C1, 0x10065B00, 0x3C), [0x5B00, 0x5C00, 0x5D00, 0x5E00, 0x5F00, 0x6000]),
    (A, (0x0C01030C, 0x00053500, 0x03), [0x3500, 0x3600, 0x3700, 0x3800, 0x3900]),
    (B, (0x0C01030C, 0x00053600, 0x03), [0x3600, 0x3700, 0x3800, 0x3900, 0x3A00, 0x3B00]),
    (A, (0x02020006, 0x00054000, 0x03), [0x4000, 0x4100, 0x4200, 0x4300, 0x4400]),
    (B, (0x02020006, 0x00054100, 0x03), [0x4100, 0x4200, 0x4300, 0x4400, 0x4500]),
    (A, (0x01010018, 0x00044900, 0x07), [0x4900, 0x4A00, 0x4B00, 0x4C00]),
    (B, (0x01010018, 0x00044A00, 0x07), [0x4A00, 0x4B00, 0x4C00, 0x4D00]),
    (A, (0x0101001A, 0x00077000, 0x00), [0x7000, 0x7100, 0x7200, 0x7300, 0x7400, 0x7500, 0x7600]),
    (B, (0x05010205, 0x000A2000, 0x1FF), [0x2000 + 0x100 * r for r in range(11)]),
    (B, (0x04010204, 0x00053000, 0x03), [0x3000, 0x3100, 0x3200, 0x3300, 0x3400, 0x3500]),
]  # fmt: skip


@pytest.mark.parametrize(("generation", "words", "addresses"), GENERATIONS)
def test_register_addresses_follow_the_descriptor(
    generation: str, words: tuple[int, int, int], addresses: list[int]
) -> None:
    descriptor = module(*words)
    assert [descriptor.register_address(r) for r in range(len(addresses))] == addresses


def test_per_instance_registers_repeat_and_global_ones_do_not() -> None:
    encoder = module(0x0C01030C, 0x00053500, 0x03)
    assert [encoder.register_address(r, instance=11) for r in range(5)] == [
        0x352C,
        0x362C,
        0x3700,
        0x3800,
        0x3900,
    ]
    stepgen = module(0x0A010205, 0x000A2000, 0x1FF)
    assert stepgen.register_address(8, instance=9) == 0x2824
    assert stepgen.register_address(9, instance=9) == 0x2900


def test_every_sserial_register_repeats_per_instance_and_interface_registers_per_channel() -> None:
    sserial = module(0x020100C1, 0x10065A00, 0x3C)
    assert [sserial.register_address(r, instance=1) for r in range(6)] == [
        0x5A40,
        0x5B40,
        0x5C40,
        0x5D40,
        0x5E40,
        0x5F40,
    ]
    assert [sserial.register_address(r, instance=1, channel=2) for r in range(2, 6)] == [
        0x5C48,
        0x5D48,
        0x5E48,
        0x5F48,
    ]
    with pytest.raises(ValueError, match="channel 1"):
        sserial.register_address(1, channel=1)


def test_only_the_fifo_of_bspi_is_as_wide_as_its_stride() -> None:
    bspi = module(0x0301000E, 0x10035400, 0x07)
    assert [bspi.register_address(r, instance=2) for r in range(3)] == [0x5480, 0x5508, 0x5608]
    assert bspi.register_address(0, instance=1, channel=15) == 0x547C


def test_uart_data_spans_four_words() -> None:
    uart = module(0x02010009, 0x10046000, 0x0F)
    assert [uart.register_address(0, instance=1, channel=c) for c in range(4)] == [
        0x6010,
        0x6014,
        0x6018,
        0x601C,
    ]
    assert uart.register_address(3, instance=1) == 0x6310
    with pytest.raises(ValueError, match="channel"):
        uart.register_address(1, channel=1)


def test_the_global_start_of_fanuc_lies_behind_its_counted_registers() -> None:
    fanuc = module(0x02010019, 0x00031500, 0x1F)
    assert fanuc.register_address(4, instance=1) == 0x1904
    assert fanuc.register_address(5, instance=1) == 0x1A00


@pytest.mark.parametrize(
    "ask",
    [
        lambda m: m.register_address(0, instance=12),
        lambda m: m.register_address(0, instance=-1),
        lambda m: m.register_address(-1),
        lambda m: m.register_address(0x100),
        lambda m: m.register_address(0, channel=1),
    ],
)
def test_a_register_that_cannot_be_is_a_value_error(ask: Callable[[ModuleDescriptor], int]) -> None:
    with pytest.raises(ValueError, match="muxed_encoder"):
        ask(module(0x0C01030C, 0x00053500, 0x03))


def test_a_presence_marker_has_no_registers() -> None:
    with pytest.raises(ValueError, match="select"):
        module(0x0101000D, 0, 0).register_address(0)


def test_an_unknown_board_opens_with_a_warning_that_carries_its_name() -> None:
    words = good(port_width=5, io_width=5, name_high=0x39393939)
    with pytest.warns(HostMot2Warning, match="MESA9999"):
        found = inventory(words, board=None)
    assert found.board is None
    assert {(pin.connector, pin.connector_pin) for pin in found.pins} == {("", None)}


def test_an_unknown_board_still_has_ports() -> None:
    with pytest.raises(errors.WrongIoPorts):
        inventory(good(io_ports=0, io_width=0, name_high=0x39393939), board=None)


@pytest.mark.parametrize(("width", "kind"), [(0, errors.WrongPortWidth), (33, errors.WrongPortWidth)])
def test_an_unknown_board_still_has_1_to_32_pins_per_port(width: int, kind: type[Exception]) -> None:
    with pytest.raises(kind):
        inventory(good(port_width=width, io_width=width, name_high=0x39393939), board=None)


word = st.integers(0, 0xFFFFFFFF)


def outcome(words: Words, strict: bool = True) -> Inventory | errors.IdromError:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HostMot2Warning)
        try:
            return inventory(words, board=None, strict=strict)
        except errors.IdromError as error:
            return error


@settings(max_examples=300, deadline=None)
@given(
    st.dictionaries(st.sampled_from([*range(0x100, 0x110, 4), *range(0x400, 0x800, 4)]), word), st.booleans()
)
def test_random_words_give_an_inventory_or_a_typed_error(changes: Words, strict: bool) -> None:
    found = outcome(golden("idrom_5i25_7i77x2") | changes, strict)
    if isinstance(found, Inventory):
        assert len(found.pins) == found.idrom.io_width
    else:
        assert str(found).startswith("HM2-E0")


@settings(max_examples=200, deadline=None)
@given(
    st.integers(0, 255), st.integers(0, 31), st.sampled_from(["idrom_5i25_7i77x2", "idrom_5i25_7i77_7i76"])
)
def test_one_flipped_bit_in_a_descriptor_never_crashes(index: int, bit: int, name: str) -> None:
    words = golden(name)
    words[0x400 + 4 * index] ^= 1 << bit
    found = outcome(words)
    assert isinstance(found, Inventory) or found.address is not None


def test_every_row_of_the_board_table_can_be_reached() -> None:
    for row in boards.BOARDS:
        assert boards.find(row.name) is row
        assert boards.find(row.name.lower()) is row
        assert len(row.connectors) == row.io_ports


@pytest.mark.parametrize(
    ("word", "function"),
    [
        (0x0300C193, "tx_enable 2"), (0x0300C183, "tx 2"), (0x0300C101, "rx 0"), (0x0300C1A4, "ntx_enable 3"),
        (0x0300C60F, "rx 14"), (0x03000D81, "select 0"), (0x03000C01, "a"), (0x03000C03, "index"),
        (0x03800405, "probe"), (0x03000581, "step"), (0x03000582, "direction"), (0x03000501, "index"),
        (0x03000509, "index"), (0x03000683, "not_enable"), (0x03001A83, "timer 1"), (0x0300C386, "out 5"),
        (0x0300C3A0, "ac_reference"), (0x03002320, "in 31"), (0x0300C510, "positive 15"),
        (0x0300C511, "negative 0"), (0x03001E85, "address 4"), (0x03000E8C, "select 7"),
        (0x0300068F, "pin 0x8F"),
        (0x03007F01, "pin 0x01"), (0x03000000, ""),
    ],
)  # fmt: skip
def test_pin_functions_have_the_names_of_the_register_description(word: int, function: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HostMot2Warning)
        assert inventory(good(pins={4: word})).pins[4].function == function


def test_a_longer_name_is_not_taken_for_a_shorter() -> None:
    assert boards.find("7I92T") is not boards.find("7I92")
    assert boards.find("7I92TX") is None


def test_boards_that_share_an_idrom_name_are_told_apart_by_their_ports() -> None:
    hd = boards.find("MESA7I80", port_width=24, io_ports=3)
    db = boards.find("MESA7I80", port_width=17, io_ports=4)
    assert hd is not None
    assert db is not None
    assert (hd.connectors, db.connectors) == (("P1", "P2", "P3"), ("J2", "J3", "J4", "J5"))
    assert boards.find("MESA7I80", port_width=19, io_ports=4) is None


def test_connector_pins() -> None:
    card = boards.find("5I25")
    header = boards.find("7I80HD-16")
    assert card is not None
    assert header is not None
    assert [card.connector_pin(i)[1] for i in range(17)] == [
        1,
        14,
        2,
        15,
        3,
        16,
        4,
        17,
        5,
        6,
        7,
        8,
        9,
        10,
        11,
        12,
        13,
    ]
    assert card.connector_pin(17) == ("P2", 1)
    assert [header.connector_pin(i) for i in (0, 23, 24)] == [("P1", 1), ("P1", 47), ("P2", 1)]
    embedded = boards.find("7I76E-16")
    assert embedded is not None
    assert embedded.connector_pin(0) == ("on-card", None)
