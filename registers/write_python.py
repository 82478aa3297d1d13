"""Writes hostmot2/registers.py."""

from collections.abc import Iterator

from description import (
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
    width,
)
from systemrdl.node import AddrmapNode, FieldNode, RegNode

# Names that Register has itself: a field of that name would hide them.
RESERVED = {
    "number",
    "name",
    "access",
    "width",
    "per_instance",
    "per_channel",
    "unit",
    "read_effect",
    "write_effect",
    "description",
    "fields",
    "readable",
    "writable",
    "field",
    "decode",
}
HEAD = f'''\
"""Registers, bit fields, commands and codes.

{NOTICE}
"""

from collections.abc import Mapping
from enum import IntEnum, IntFlag
from typing import ClassVar

from .register_map import AcceptedDescriptor, BitField, Register, RegisterMap

'''


def python_module(description: Description) -> str:
    """The whole module; ruff format lays it out."""
    lines = [HEAD]
    for _, enum in description.enums:
        lines += enum_class(enum)
    for _, module in description.maps:
        lines += map_class(module)
    lines += ["MODULES: Mapping[int, type[RegisterMap]] = {"]
    for _, module in description.maps:
        if has_gtag(module):
            lines += [f"    0x{integer(module, 'gtag'):02X}: {camel(module.inst_name)},"]
    lines += ["}", '"""The register map of every GTAG we know."""', ""]
    return "\n".join([*lines, *pin_enums(description)])


def pin_enums(description: Description) -> Iterator[str]:
    """Which enum names a module's pins: that of a GTAG called X is called x_pin."""
    declared = {enum.name for _, enum in description.enums}
    yield "PINS: Mapping[int, type[IntEnum]] = {"
    for gtag, *_ in next(enum.members for _, enum in description.enums if enum.name == "gtag"):
        if f"{gtag.lower()}_pin" in declared:
            yield f"    Gtag.{gtag}: {camel(gtag)}Pin,"
    yield "}"
    yield '"""The secondary pin numbers of every GTAG that has some of its own."""'
    yield ""


def camel(name: str) -> str:
    """watchdog_key -> WatchdogKey."""
    return "".join(part.capitalize() for part in name.split("_"))


def enum_class(enum: Enumeration) -> Iterator[str]:
    """One IntEnum or IntFlag."""
    yield f"class {camel(enum.name)}({'IntFlag' if enum.flags else 'IntEnum'}):"
    yield f'    """Codes of {enum.name.replace("_", " ")}."""'
    yield ""
    for name, value, comment in enum.members:
        yield f"    {name} = 0x{value:02X}" + (f"  # {comment}" if comment else "")
    yield "\n"


def map_class(module: AddrmapNode) -> Iterator[str]:
    """The classes of the registers that have fields, then the RegisterMap."""
    for register in module.registers():
        if not plain(register):
            yield from register_class(module, register)
    yield f"class {camel(module.inst_name)}(RegisterMap):"
    yield f'    """{text(module, "desc")}\n\n    Source: {text(module, "source")}.\n    """'
    yield ""
    yield f"    name: ClassVar[str] = {module.inst_name!r}"
    yield f"    stride: ClassVar[int] = {stride(module)}"
    if integer(module, "size"):
        yield f"    size: ClassVar[int] = 0x{integer(module, 'size'):02X}"
    if has_gtag(module):
        yield f"    descriptor: ClassVar[AcceptedDescriptor | None] = {accepted_descriptor(module)}"
    names = []
    for register in module.registers():
        kind = "Register" if plain(register) else class_name(module, register)
        yield f"    {register.inst_name}: ClassVar[{kind}] = {construct(module, register)}"
        names.append(register.inst_name)
    yield f"    registers: ClassVar[tuple[Register, ...]] = ({', '.join(names)},)"
    yield "\n"


def class_name(module: AddrmapNode, register: RegNode) -> str:
    """The class of a register with fields."""
    return f"{camel(module.inst_name)}{camel(register.inst_name)}Register"


def register_class(module: AddrmapNode, register: RegNode) -> Iterator[str]:
    """A Register with its fields as attributes."""
    clash = {field.inst_name for field in register.fields()} & RESERVED
    if clash:
        raise SystemExit(f"{module.inst_name}.{register.inst_name}: field names taken by Register: {clash}")
    yield f"class {class_name(module, register)}(Register):"
    yield f'    """Fields of {module.inst_name}.{register.inst_name}."""'
    yield ""
    for field in register.fields():
        yield f"    {field.inst_name}: ClassVar[BitField] = {bit_field(field)}"
    yield "\n"


def bit_field(field: FieldNode) -> str:
    """A BitField expression."""
    arguments = [repr(field.inst_name), str(field.lsb), str(field.width)]
    if not field.is_sw_readable:
        arguments.append("readable=False")
    if not field.is_sw_writable:
        arguments.append("writable=False")
    arguments += keywords(field, {"unit": "unit", "description": "desc"})
    return f"BitField({', '.join(arguments)})"


def keywords(node: RegNode | FieldNode, names: dict[str, str]) -> list[str]:
    """Keyword arguments for the string properties that are set."""
    return [f"{keyword}={text(node, name)!r}" for keyword, name in names.items() if text(node, name)]


def construct(module: AddrmapNode, register: RegNode) -> str:
    """The expression that makes a register."""
    name = "Register" if plain(register) else class_name(module, register)
    arguments = [str(number(register, module)), repr(register.inst_name), repr(access(register))]
    if width(register) != 32:
        arguments.append(f"width={width(register)}")
    if per_instance(register):
        arguments.append("per_instance=True")
    if per_channel(register):
        arguments.append("per_channel=True")
    effects = {"read_effect": "read_effect", "write_effect": "write_effect"}
    arguments += keywords(register, {"unit": "unit", **effects, "description": "desc"})
    if not plain(register):
        fields = ", ".join(f"{name}.{field.inst_name}" for field in register.fields())
        arguments.append(f"fields=({fields},)")
    return f"{name}({', '.join(arguments)})"


def accepted_descriptor(module: AddrmapNode) -> str:
    """An AcceptedDescriptor expression."""
    return (
        f"AcceptedDescriptor(gtag=0x{integer(module, 'gtag'):02X}, versions={numbers(module, 'versions')!r}, "
        f"faulty_versions={numbers(module, 'faulty_versions')!r}, fault_note={text(module, 'fault_note')!r}, "
        f"num_registers={integer(module, 'num_registers')}, "
        f"instance_stride={integer(module, 'instance_stride')}, "
        f"multiple_registers={integer(module, 'multiple_registers'):#x})"
    )
