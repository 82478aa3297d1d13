"""Remotes with tables written down for tests."""

from hostmot2._core import lib
from hostmot2.emulator import EmulatedRemote

from .tables import BITS, BOTH, FLOAT, IN, NV_UNSIGNED, OUT, SIGNED, UNSIGNED, Memory, element, mode

COMMAND = 0x5A00
IO_ELEMENTS = [element("input", BITS, 32, IN), element("output", BITS, 16, OUT)]
PARAMETERS = [
    element("fieldvoltage", UNSIGNED, 16, IN, 0, 36.3, "V", 0x310),
    element("NVWatchDogTimeout", NV_UNSIGNED, 16, BOTH, 0, 1000, "ms", 0x20),
    element("gain", FLOAT, 32, OUT, 0, 0, "", 0x320),
    element("trim", SIGNED, 8, OUT, -100, 100, "", 0x324),
]


def field_io(elements=IO_ELEMENTS, parameters=PARAMETERS, receive=5, transmit=2, **facts):
    memory = Memory()
    toc = memory.build(elements, parameters)
    facts = {"name": "7I77", "unit_number": 0x12000001, "eeprom": {0x20: 50}} | facts
    return EmulatedRemote(
        receive_size=receive,
        transmit_size=transmit,
        ptoc=toc & 0xFFFF,
        gtoc=toc >> 16,
        memory=memory.used(),
        **facts,
    )


def analog():
    elements = [element(f"analogout{i}", SIGNED, 13, OUT, -10, 10, "V", 0x400 + 2 * i) for i in range(6)]
    elements += [element("analogena", BITS, 1, OUT), element("spinena", BITS, 1, OUT)]
    return field_io(elements, [mode(0, True, "analog")], receive=1, transmit=10, unit_number=0x11000001)


def give_watchdog(field, ms=50):
    assert lib.hm2_remote_set(field.handle, lib.HM2_REMOTE_WATCHDOG_PS, ms * 10**9) == lib.HM2_OK
