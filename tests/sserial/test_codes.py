"""Errors of smart serial have codes of their own."""

import re

from hostmot2 import errors as base
from hostmot2.sserial import errors


def kinds(module):
    found = vars(module).values()
    return {k for k in found if isinstance(k, type) and issubclass(k, base.HostMot2Error)}


def test_codes_are_in_the_range_of_smart_serial_and_given_once():
    own = kinds(errors) - kinds(base)
    codes = [kind.code for kind in own]
    assert len(own) == 11
    assert all(re.fullmatch(r"HM2-E0[23]\d", code) for code in codes)
    others = [kind.code for kind in kinds(base)]
    assert len({*codes, *others}) == len(codes) + len(others)
    assert all(issubclass(kind, base.SserialError) for kind in own)
