"""The generated registers against facts of the sheets, and the description's own rules."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from hostmot2 import registers
from hostmot2.register_map import BitField

ROOT = Path(__file__).parent.parent


def test_encoder_control_bits_are_those_of_the_table() -> None:
    """registers.md 2.4."""
    control = registers.Encoder.control
    assert control.quad_error.mask == 0x8000
    assert control.filter.mask == 0x0800
    assert control.latch_on_index.mask | control.just_once.mask == 0x0050
    assert control.latch.get(0xFFFE0800) == 0xFFFE
    assert registers.MuxedEncoder.filter_rate.deskew.mask == 0xF0000000


def test_descriptor_words_of_a_5i25_decode() -> None:
    """registers.md 3.2: row 4 of the module table and two rows of the pin table."""
    function, location = registers.ModuleDescriptor.function, registers.ModuleDescriptor.location
    assert function.gtag_code.get(0x010100C1) == registers.Gtag.SSERIAL
    assert function.clock_tag.get(0x010100C1) == registers.ClockTag.LOW
    assert function.instances.get(0x0C01030C) == 12
    assert location.base.get(0x10065A00) == 0x5A00
    assert location.num_registers.get(0x10065A00) == 6
    assert (location.register_stride.get(0x10065A00), location.instance_stride.get(0x10065A00)) == (0, 1)
    word = registers.PinDescriptor.word
    assert word.output.get(0x0300C193) == 1
    assert word.sec_pin.get(0x0300C193) | 0x80 == registers.SserialPin.TX_ENABLE_0 + 2
    assert word.sec_unit.get(0x03060D81) == 6


def test_cs_of_a_fault_decodes() -> None:
    """sserial.md 3.2: remote fault 4 active is 0x04422140."""
    cs = registers.Sserial.cs
    assert cs.com_state.get(0x04422140) == registers.ComState.RUN
    assert cs.remote_fault.get(0x04422140) == registers.RemoteFault.OVER_TEMPERATURE
    assert registers.CsStatus(cs.status.get(0x04422140)) == (
        registers.CsStatus.COMMUNICATION_ERROR | registers.CsStatus.REMOTE_FAULT
    )
    assert cs.local_fault.get(0x04422140) == registers.LocalFault.REMOTE_FAULT


def test_lbp16_command_words_are_those_of_the_sheet() -> None:
    """lbp16.md 1: read N x u32 of space 0: 0x4280 + N; write N x u16 of space 6, no increment: 0xD900 + N."""
    word = registers.Lbp16Command.word
    assert word.address.put(1) | word.size.put(2) | word.increment.put(1) | word.count.put(5) == 0x4285
    assert word.write.put(1) | word.address.put(1) | word.space.put(6) | word.size.put(1) | 1 == 0xD901


def test_module_descriptors_are_accepted_as_listed() -> None:
    """registers.md 1.8, three rows of the table."""
    stepgen = registers.Stepgen.descriptor
    assert stepgen is not None
    assert (stepgen.versions, stepgen.num_registers, stepgen.multiple_registers) == (
        (0, 1, 2, 0x42, 0xC2),
        10,
        0x1FF,
    )
    sserial = registers.Sserial.descriptor
    assert sserial is not None
    assert (sserial.instance_stride, sserial.multiple_registers) == (0x40, 0x3C)
    outm = registers.Outm.descriptor
    assert outm is not None
    assert outm.versions == ()


def test_every_gtag_with_registers_names_its_own_map() -> None:
    for gtag, module in registers.MODULES.items():
        assert module.descriptor is not None
        assert module.descriptor.gtag == gtag
        assert gtag in {member.value for member in registers.Gtag}


def test_readable_fields_of_a_register_never_overlap() -> None:
    for module in registers.MODULES.values():
        for register in module.registers:
            for readable in (True, False):
                chosen = [f for f in register.fields if (f.readable if readable else f.writable)]
                union = 0
                for field in chosen:
                    assert not union & field.mask, (module.name, register.name, field.name)
                    union |= field.mask


def test_a_value_that_does_not_fit_is_refused() -> None:
    field = BitField("divider", 4, 3)
    assert field.replace(0xFFFF, 2) == 0xFFAF
    with pytest.raises(ValueError, match=r"8 is outside 0\.\.7"):
        field.put(8)
    with pytest.raises(ValueError, match="-1 is outside"):
        field.put(-1)


def test_header_and_module_agree() -> None:
    header = dict(
        re.findall(r"^#define (HM2_\w+) +(0x[0-9A-F]+|\d+)u?", (ROOT / "csrc/registers.h").read_text(), re.M)
    )
    for module in registers.MODULES.values():
        for register in module.registers:
            symbol = f"HM2_{module.name}_{register.name}".upper()
            assert int(header[symbol], 0) == register.number
            for field in register.fields:
                assert int(header[f"{symbol}_{field.name}_MASK".upper()], 0) == field.mask


def test_committed_files_follow_from_the_description() -> None:
    pytest.importorskip("systemrdl", reason="systemrdl-compiler is not installed: drift not checked")
    command = [sys.executable, "registers/generate.py", "--check"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_a_register_says_what_may_be_done_with_it_and_what_its_fields_are() -> None:
    control, count = registers.Encoder.control, registers.Encoder.timestamp_count
    assert (control.writable, count.writable, count.readable) == (True, False, True)
    assert control.field("quad_error").mask == 1 << 15
    with pytest.raises(KeyError, match="control has no field 'turbo'"):
        control.field("turbo")
