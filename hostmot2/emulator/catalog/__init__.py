"""The built-in remotes.

`remote("7i77-io")` makes one. Where a card's real tables are published (7I90 reference remote, STMBL, the
8I20's parameters, process data of 8I20 and 7I64) they are copied; everywhere else addresses, unit strings,
mode names and some widths are ours, which each description says in its `invented`.
"""

from __future__ import annotations

from hostmot2.emulator.catalog import drives, field_io, mesa_7i77, others
from hostmot2.emulator.described import DescribedRemote
from hostmot2.emulator.description import RemoteDescription

CATALOG: dict[str, RemoteDescription] = {
    **mesa_7i77.CATALOG,
    **field_io.CATALOG,
    **drives.CATALOG,
    **others.CATALOG,
}


def remote(
    name: str,
    *,
    unit_number: int | None = None,
    setup_jumper: bool = False,
    turnaround_us: float = 3.0,
) -> DescribedRemote:
    """A built-in remote by catalogue name ("7i77-io", "8i20", ...), freshly powered.

    Raises KeyError for a name that is not in CATALOG.
    """
    try:
        description = CATALOG[name.lower()]
    except KeyError:
        raise KeyError(f"no remote {name!r} in the catalogue: {', '.join(CATALOG)}") from None
    return DescribedRemote(
        description, unit_number=unit_number, setup_jumper=setup_jumper, turnaround_us=turnaround_us
    )


__all__ = ["CATALOG", "remote"]
