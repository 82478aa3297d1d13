"""Writes docs/reference/registers.md."""

from collections.abc import Iterator

from description import (
    FILES,
    NOTICE,
    Description,
    Enumeration,
    access,
    has_gtag,
    integer,
    number,
    numbers,
    per_channel,
    per_instance,
    plain,
    stride,
    text,
)
from systemrdl.node import AddrmapNode, FieldNode, RegNode

HEAD = f"""\
# Registers

<!-- {NOTICE} -->

A register's address on a card is `base + number * register_stride + instance * instance_stride`, with base
and strides from the module descriptor. In tables and byte spaces the number is the byte offset. The sources
named are the project's fact sheets.
"""


def reference(description: Description) -> str:
    """The whole document."""
    lines = [HEAD]
    for file in FILES[1:]:
        lines += [f"## {file}.rdl", ""]
        for origin, module in description.maps:
            if origin == file:
                lines += map_tables(module)
        for origin, enum in description.enums:
            if origin == file:
                lines += enum_table(enum)
    return "\n".join(lines).rstrip() + "\n"


def row(*cells: str) -> str:
    """One line of a table."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def map_tables(module: AddrmapNode) -> Iterator[str]:
    """A module's registers and fields."""
    yield from (f"### {module.inst_name}", "", text(module, "desc"), "")
    if has_gtag(module):
        yield from (descriptor_text(module), "")
    yield from (f"Source: {text(module, 'source')}.", "")
    yield from (
        row("number", "register", "access", "repeats", "unit", "meaning"),
        "|---" * 6 + "|",
    )
    for register in module.registers():
        yield register_row(module, register)
    yield ""
    rows = [field_row(r, field) for r in module.registers() if not plain(r) for field in r.fields()]
    if rows:
        yield from (
            row("register", "bits", "field", "access", "unit", "meaning"),
            "|---" * 6 + "|",
        )
        yield from rows
        yield ""


def descriptor_text(module: AddrmapNode) -> str:
    """GTAG and accepted descriptors in words."""
    sentence = f"GTAG 0x{integer(module, 'gtag'):02X}"
    if numbers(module, "versions"):
        versions = ", ".join(f"{version:#x}" for version in numbers(module, "versions"))
        sentence += (
            f"; accepted: version {versions}, {integer(module, 'num_registers')} registers, "
            f"instance stride {integer(module, 'instance_stride'):#x}, "
            f"multiple registers {integer(module, 'multiple_registers'):#x}"
        )
    if text(module, "fault_note"):
        faulty = ", ".join(f"{version:#x}" for version in numbers(module, "faulty_versions"))
        sentence += f". Version {faulty}: {text(module, 'fault_note')}"
    if text(module, "descriptor_note"):
        sentence += f". Note: {text(module, 'descriptor_note')}"
    return sentence + "."


def register_row(module: AddrmapNode, register: RegNode) -> str:
    """One register."""
    value = number(register, module)
    repeats = "channel" if per_channel(register) else "instance" if per_instance(register) else ""
    meaning = [text(register, "desc")]
    for kind in ("read", "write"):
        if text(register, f"{kind}_effect"):
            meaning.append(f"**{kind} effect:** {text(register, f'{kind}_effect')}")
    return row(
        f"{value:#x}" if stride(module) == 1 else str(value),
        register.inst_name,
        access(register),
        repeats,
        text(register, "unit"),
        "; ".join(part for part in meaning if part),
    )


def field_row(register: RegNode, field: FieldNode) -> str:
    """One field."""
    bits = str(field.lsb) if field.width == 1 else f"{field.msb}..{field.lsb}"
    name = field.inst_name
    return row(register.inst_name, bits, name, access(field), text(field, "unit"), text(field, "desc"))


def enum_table(enum: Enumeration) -> Iterator[str]:
    """One set of codes."""
    yield from (f"### {enum.name}", "", row("value", "name", "meaning"), "|---|---|---|")
    for name, value, comment in enum.members:
        yield row(f"0x{value:02X}", name, comment)
    yield ""
