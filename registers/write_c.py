"""Writes csrc/registers.h."""

import re
from collections.abc import Iterator

from description import (
    NOTICE,
    Description,
    Enumeration,
    access,
    integer,
    number,
    numbers,
    per_instance,
    plain,
    stride,
    text,
    width,
)
from systemrdl.node import AddrmapNode

HEAD = f"""\
/* {NOTICE}
 *
 * HM2_<MODULE>_<REGISTER> is a register number (address = base + number * register stride); in tables and
 * byte spaces it is the byte offset. Internal: not part of the public header. */
#ifndef HM2_REGISTERS_H
#define HM2_REGISTERS_H
"""
ROWS = """\
/* Module descriptors a driver accepts (fact sheet registers.md 1.8). */
/* ROW(gtag, version, num_registers, instance_stride, multiple_registers) */
#define HM2_ACCEPTED_MODULES(ROW) \\"""


def c_header(description: Description) -> str:
    """The whole file."""
    lines = [HEAD]
    for _, enum in description.enums:
        lines += enum_defines(enum)
    for _, module in description.maps:
        lines += map_defines(module)
    rows = [row for _, module in description.maps for row in accepted_rows(module)]
    lines += [ROWS, " \\\n".join(rows), "", "#endif", ""]
    return "\n".join(lines)


def define(name: str, value: str, comment: str) -> str:
    """One aligned #define."""
    line = f"#define {name:<52} {value}"
    return f"{line:<72} /* {comment} */" if comment else line


def enum_defines(enum: Enumeration) -> Iterator[str]:
    """The codes of one enumeration."""
    digits = max(2, (max(value for _, value, _ in enum.members).bit_length() + 3) // 4)
    for name, value, comment in enum.members:
        yield define(f"HM2_{enum.name.upper()}_{name}", f"0x{value:0{digits}X}u", comment)
    yield ""


def map_defines(module: AddrmapNode) -> Iterator[str]:
    """The registers and fields of one module."""
    prefix = f"HM2_{module.inst_name.upper()}"
    yield f"/* {module.inst_name}: {text(module, 'desc')} ({text(module, 'source')}) */"
    if integer(module, "size"):
        yield define(f"{prefix}_SIZE", f"0x{integer(module, 'size'):02X}", "bytes")
    for register in module.registers():
        name = f"{prefix}_{register.inst_name.upper()}"
        value = number(register, module)
        comment = access(register) + (", per instance" if per_instance(register) else "")
        yield define(name, f"0x{value:02X}" if stride(module) == 1 else str(value), comment)
        for field in () if plain(register) else register.fields():
            mask = ((1 << field.width) - 1) << field.lsb
            field_name = f"{name}_{field.inst_name.upper()}"
            yield define(f"{field_name}_MASK", f"0x{mask:0{width(register) // 4}X}u", access(field))
            yield define(f"{field_name}_LSB", str(field.lsb), "")
    yield ""


def accepted_rows(module: AddrmapNode) -> Iterator[str]:
    """One row per accepted version."""
    for version in numbers(module, "versions"):
        yield (
            f"\tROW(0x{integer(module, 'gtag'):02X}u, 0x{version:02X}u, {integer(module, 'num_registers')}u, "
            f"0x{integer(module, 'instance_stride'):02X}u, 0x{integer(module, 'multiple_registers'):X}u)"
        )


def check_names(header: str, public_header: str) -> None:
    """No symbol twice, none that the public header already has."""
    names = re.findall(r"^#define (\w+)", header, re.MULTILINE)
    twice = {name for name in names if names.count(name) > 1}
    twice |= set(re.findall(r"\bHM2_\w+", public_header)) & set(names)
    if twice:
        raise SystemExit(f"symbols declared twice: {sorted(twice)}")
