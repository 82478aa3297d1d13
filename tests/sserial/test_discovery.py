"""Tables of remotes: what they say, and every way in which they can be broken (sserial.md 5.3)."""

import math
import struct

import pytest

from hostmot2._core import lib
from hostmot2.fields import Direction, FieldKind
from hostmot2.remotes import builtin
from hostmot2.remotes.discovery import read_memory
from hostmot2.sserial import BrokenTable

from .tables import (
    BITS,
    BOOLEAN,
    BOTH,
    ENCODER,
    ENCODER_H,
    ENCODER_L,
    FLOAT,
    IN,
    NV_FLOAT,
    NV_SIGNED,
    NV_UNSIGNED,
    OUT,
    PAD,
    SIGNED,
    STREAM,
    UNSIGNED,
    Memory,
    element,
    mode,
)


def read(ptoc, gtoc=(), **facts):
    memory = Memory()
    toc = memory.build(ptoc, gtoc)
    return read_memory(bytes(memory.bytes), 0, toc, name="TEST", unit_number=1, channel=2, **facts)


def broken(ptoc, gtoc=(), **facts):
    with pytest.raises(BrokenTable) as caught:
        read(ptoc, gtoc, **facts).raise_for_parameters()
    assert caught.value.channel == 2
    return caught.value


GOOD = element("x", UNSIGNED, 8, IN, 0, 1, address=0x300)


def test_a_record_is_read_as_the_sheet_lays_it_out():
    # the strings begin at +14 and the address lies at +12, not where the manual's walk has them
    found = read([element("AnalogOut0", SIGNED, 12, OUT, -10, 10, "V", 0x1234)]).fields[0]
    assert (found.name, found.unit, found.address) == ("AnalogOut0", "V", 0x1234)
    assert (found.kind, found.bits, found.direction) == (FieldKind.SIGNED, 12, Direction.OUTPUT)
    assert (found.minimum, found.maximum) == (-10, 10)


@pytest.mark.parametrize(
    "kind", [PAD, BITS, UNSIGNED, SIGNED, STREAM, BOOLEAN, ENCODER, ENCODER_H, ENCODER_L]
)
@pytest.mark.parametrize("direction", [IN, BOTH, OUT])
def test_every_process_data_type_in_every_direction(kind, direction):
    found = read([element("x", kind, 16, direction, 0, 1)]).fields[0]
    assert (found.kind, found.direction) == (kind, direction)


@pytest.mark.parametrize(("bits", "low", "high"), [(32, -math.inf, math.inf), (64, 0, 0), (32, -1, 1)])
def test_floats_may_have_infinite_limits(bits, low, high):
    found = read([element("x", FLOAT, bits, IN, low, high)]).fields[0]
    assert (found.bits, found.minimum, found.maximum) == (bits, low, high)


def test_a_remote_without_tables_has_no_elements():
    assert read_memory(b"", 0, 0, name="TEST", unit_number=1).fields == ()


def test_the_reference_remote_has_a_gtoc_that_ends_at_once():
    found = read([mode(0, False, "standard"), mode(0, True, "standard")], [])
    assert found.parameters == ()
    assert found.hardware_mode.name == "standard"
    assert found.mode.name == "standard"


def test_modes_come_from_both_tables():
    modes = [mode(i, True, f"mode {i}") for i in range(3)]
    found = read([mode(7, False, "jumper"), modes[1], GOOD], [modes[0], modes[1], modes[2]])
    assert [m.name for m in found.modes] == ["mode 0", "mode 1", "mode 2"]
    assert found.hardware_mode.index == 7
    assert found.mode.index == 1


def test_parameters_are_all_numeric_types():
    gtoc = [
        element("nvu", NV_UNSIGNED, 16, BOTH, 0, 100, "ms", 0x10),
        element("nvs", NV_SIGNED, 32, BOTH, -5, 5, "", 0x12),
        element("nvf", NV_FLOAT, 32, BOTH, 0, 1, "", 0x16),
        element("scale", FLOAT, 32, OUT, 0, 0, "", 0x1A),
    ]
    found = read([GOOD], gtoc)
    assert [p.kind for p in found.parameters] == [0x04, 0x05, 0x11, 0x10]


def test_an_element_of_the_ptoc_may_have_any_width_in_the_gtoc_too():
    thirteen = element("analogout0", SIGNED, 13, OUT, -10, 10, "V", 0x400)
    memory = Memory()
    address = memory.record(thirteen)
    memory.table(0x700, [address])
    # named again by the same record, and by another one with the same parameter address
    memory.table(0x900, [address, memory.record(thirteen), memory.record(GOOD)])
    found = read_memory(bytes(memory.bytes), 0, 0x09000700, name="7I77", unit_number=1)
    assert found.parameters_error is None
    assert [p.name for p in found.parameters] == ["x"]


def test_a_parameter_beyond_the_end_of_memory_is_left_out_and_keeps_no_other_from_being_read():
    beyond = element("far", UNSIGNED, 16, IN, 0, 1, address=0xFFFF)
    last = element("near", UNSIGNED, 8, IN, 0, 1, address=0xFFFF)
    found = read([GOOD], [beyond, last])
    assert [p.name for p in found.parameters] == ["near"]
    assert "'far' at 0xFFFF lies beyond the end of memory" in found.warnings[0]


def test_an_unknown_type_becomes_padding_with_a_warning():
    found = read([element("odd", 0x33, 24, IN), GOOD])
    assert [f.kind for f in found.fields] == [FieldKind.PAD, FieldKind.UNSIGNED]
    assert found.layout.input_bits == 32
    assert "unknown data type 0x33" in found.warnings[0]


def test_names_are_made_printable_and_unique():
    elements = [
        element("a\x07b", BITS, 1, IN),
        element("a_b", BITS, 1, IN),
        element("", BITS, 1, IN),
        element("same", BITS, 1, IN),
        element("same", BITS, 1, OUT),
        element("same", BITS, 1, BOTH),
    ]
    found = read(elements)
    assert [f.name for f in found.fields] == ["a_b", "a_b_2", "unnamed", "same", "same", "same_2"]
    assert len(found.warnings) == 4


BROKEN = {
    lib.HM2_TOC_RECORD_TYPE: b"\x5a" + GOOD[1:],
    lib.HM2_TOC_DIRECTION: element("x", UNSIGNED, 8, 0x20, 0, 1),
    lib.HM2_TOC_NOT_IN_PTOC: element("x", NV_UNSIGNED, 8, IN, 0, 1),
    lib.HM2_TOC_NOT_A_NUMBER: element("x", UNSIGNED, 8, IN, math.nan, 1),
    lib.HM2_TOC_INFINITE: element("x", UNSIGNED, 8, IN, 0, math.inf),
    lib.HM2_TOC_LIMITS: element("x", UNSIGNED, 8, IN, 2, 1),
    lib.HM2_TOC_STRING_END: element("x" * 60, UNSIGNED, 8, IN, 0, 1),
}


@pytest.mark.parametrize("detail", BROKEN)
def test_a_broken_record_is_named_with_its_place(detail):
    error = broken([GOOD, BROKEN[detail]])
    assert (error.detail, error.table, error.entry) == (detail, "PTOC", 1)
    second = 0x1000 + len(GOOD)
    assert second <= error.address < second + len(BROKEN[detail])
    assert "channel 2: PTOC entry 1" in str(error)


@pytest.mark.parametrize(
    ("kind", "bits"),
    [
        (UNSIGNED, 0),
        (UNSIGNED, 65),
        (SIGNED, 65),
        (BITS, 65),
        (BOOLEAN, 65),
        (ENCODER, 0),
        (ENCODER, 65),
        (FLOAT, 16),
        (FLOAT, 33),
        (STREAM, 33),
    ],
)
def test_a_width_that_a_type_cannot_have(kind, bits):
    error = broken([element("x", kind, bits, IN)])
    assert (error.detail, error.received, error.address) == (lib.HM2_TOC_BITS, bits, 0x1001)


@pytest.mark.parametrize("kind", [NV_UNSIGNED, NV_SIGNED, NV_FLOAT])
def test_non_volatile_types_are_for_parameters(kind):
    assert broken([element("x", kind, 32, IN)]).detail == lib.HM2_TOC_NOT_IN_PTOC
    assert read([GOOD], [element("x", kind, 32, IN)]).parameters_error is None


@pytest.mark.parametrize("bits", [1, 12, 24, 40])
def test_a_parameter_has_a_size_that_can_be_accessed(bits):
    error = broken([GOOD], [GOOD, element("x", UNSIGNED, bits, IN, 0, 1, address=0x999)])
    assert (error.detail, error.table, error.entry) == (lib.HM2_TOC_PARAMETER_SIZE, "GTOC", 1)


def test_a_broken_gtoc_leaves_the_process_data_usable():
    found = read([GOOD], [BROKEN[lib.HM2_TOC_RECORD_TYPE]])
    assert [f.name for f in found.fields] == ["x"]
    assert found.parameters_error.table == "GTOC"


def test_a_table_that_loops():
    memory = Memory()
    address = memory.record(GOOD)
    memory.table(0x700, [address, address])
    with pytest.raises(BrokenTable) as caught:
        read_memory(bytes(memory.bytes), 0, 0x700, name="", unit_number=0)
    assert (caught.value.detail, caught.value.address) == (lib.HM2_TOC_LOOP, 0x702)


def test_a_table_without_an_end():
    memory = Memory()
    memory.bytes[0x700:0x1700] = struct.pack("<2048H", *range(0x2000, 0x2800))
    with pytest.raises(BrokenTable) as caught:
        read_memory(bytes(memory.bytes), 0, 0x700, name="", unit_number=0)
    assert caught.value.detail == lib.HM2_TOC_TOO_LONG


def test_the_longest_table_is_read():
    assert len(read([element(f"b{i}", BITS, 1, PAD) for i in range(256)][:96]).fields) == 96
    memory = Memory()
    memory.table(0x700, [memory.record(mode(i & 0xFF, True, "m")) for i in range(256)])
    assert len(read_memory(bytes(memory.bytes), 0, 0x700, name="", unit_number=0).modes) == 256


def test_pointers_that_cannot_be():
    memory = Memory()
    memory.table(0x700, [0xFFFF])
    with pytest.raises(BrokenTable) as caught:
        read_memory(bytes(memory.bytes), 0, 0x700, name="", unit_number=0)
    assert (caught.value.detail, caught.value.received) == (lib.HM2_TOC_POINTER, 0xFFFF)
    with pytest.raises(BrokenTable) as caught:
        read_memory(bytes(memory.bytes), 0, 0xFFFF, name="", unit_number=0)
    assert (caught.value.detail, caught.value.entry) == (lib.HM2_TOC_POINTER, -1)


@pytest.mark.parametrize("back", range(1, 16))
def test_a_record_never_runs_over_the_end(back):
    memory = Memory()
    start = 0x10000 - back
    memory.bytes[start:] = element("", UNSIGNED, 8, IN, 0, 1, "u")[:back]
    memory.table(0x700, [start])
    expected = lib.HM2_TOC_POINTER if start == 0xFFFF else lib.HM2_TOC_CROSSES_END
    with pytest.raises(BrokenTable) as caught:
        read_memory(bytes(memory.bytes), 0, 0x700, name="", unit_number=0)
    assert caught.value.detail == expected


def test_a_record_may_end_with_the_memory():
    memory = Memory()
    data = element("x", UNSIGNED, 8, IN, 0, 1, "u")
    start = 0x10000 - len(data)
    memory.bytes[start:] = data
    memory.table(0x700, [start])
    assert read_memory(bytes(memory.bytes), 0, 0x700, name="", unit_number=0).fields[0].name == "x"


def test_elements_fit_what_is_transferred():
    elements = [element("in", BITS, 32, IN), element("out", BITS, 16, OUT), element("both", BITS, 8, BOTH)]
    assert read(elements, sizes=(6, 3)).layout.input_bits == 40
    error = broken(elements, sizes=(5, 3))
    assert (error.detail, error.expected, error.received) == (lib.HM2_TOC_INPUT_BITS, 32, 40)
    error = broken(elements, sizes=(6, 2))
    assert (error.detail, error.expected, error.received) == (lib.HM2_TOC_OUTPUT_BITS, 16, 24)


def test_elements_fit_the_registers():
    wide = [element(f"w{i}", BITS, 48, IN) for i in range(3)]
    assert broken(wide).detail == lib.HM2_TOC_INPUT_BITS
    assert read(wide, registers=7).layout.input_bits == 144


def test_the_published_tables_of_the_stmbl_remote():
    # sserial.md 8.3: floats, bits of both directions, padding both ways, an element in both directions
    elements = [
        element("pos_cmd", FLOAT, 32, OUT, -math.inf, math.inf, "rad"),
        element("vel_cmd", FLOAT, 32, OUT, -math.inf, math.inf, "rad/s"),
        element("out", BITS, 4, OUT),
        element("enable", BOOLEAN, 1, OUT),
        element("pos_fb", FLOAT, 32, IN, -math.inf, math.inf, "rad"),
        element("vel_fb", FLOAT, 32, IN, -math.inf, math.inf, "rad/s"),
        element("current", SIGNED, 8, IN, -30, 30, "A"),
        element("in", BITS, 4, IN),
        element("fault", BOOLEAN, 1, IN),
        element("index_enable", BOOLEAN, 1, BOTH),
        element("pad", PAD, 2, OUT),
        element("pad", PAD, 2, IN),
        mode(0, False, "foo"),
        mode(0, True, "Position mode"),
    ]
    found = read(elements, sizes=(11, 9))
    assert (found.layout.input_bits, found.layout.output_bits) == (80, 72)
    assert found.mode.name == "Position mode"


def test_the_8i20_is_known_by_its_name():
    drive = builtin.describe_8i20(0x1F, 7.5)
    assert (drive.layout.input_bits, drive.layout.output_bits) == (64, 32)
    offsets = {e.name: e.offset for e in drive.layout.elements}
    # IR0: temperature, bus voltage; IR1: STATUS, FAULT; out: angle, current
    assert offsets == {
        "angle": 0,
        "current": 16,
        "card-temp": 0,
        "bus-voltage": 16,
        "status": 32,
        "fault": 48,
    }
    addresses = {p.name: p.address for p in drive.parameters}
    assert addresses["NVMAXCURRENT"] == 2
    assert addresses["NVBRAKEOFFV"] == 42
    assert addresses["SWREVISION"] == 2164


def test_the_7i64_is_known_by_its_name():
    offsets = {e.name: e.offset for e in builtin.describe_7i64(1).layout.elements}
    assert offsets == {"output": 0, "input": 0, "": 24, "analog0": 32, "analog1": 48}
