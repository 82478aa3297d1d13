"""Which line a port's name means. `/dev/ttyUSB0`, `COM1`, `ftdi://...`."""

from __future__ import annotations

import re

from hostmot2.lbp.client import LbpRemote
from hostmot2.lbp.link import WireLink
from hostmot2.lbp.stream import Stream

SETUP_BAUD = 115200
"""Rate of every remote whose set-up jumper is in place."""


def open_stream(port: str, baud: int = SETUP_BAUD) -> Stream:
    """The line called `port`: a device file, COM1..COM256 (/dev/ttyS0..), or a pyftdi URL.

    Raises AdapterMissing, AdapterBusy, PermissionDenied, ImportError without pyserial or pyftdi.
    """
    try:
        return _open(port, baud)
    except ModuleNotFoundError as missing:
        missing.add_note("serial lines need more packages: pip install 'hostmot2[serial]'")
        raise


def _open(port: str, baud: int) -> Stream:
    if port.startswith("ftdi://"):
        from hostmot2.lbp.ftdi import FtdiStream

        return FtdiStream(port, baud)
    from hostmot2.lbp.serial_port import SerialStream

    dos = re.fullmatch(r"com(\d+):?", port, re.IGNORECASE)
    return SerialStream(f"/dev/ttyS{int(dos[1]) - 1}" if dos else port, baud)


def open_remote(port: str, baud: int = SETUP_BAUD) -> LbpRemote:
    """The remote at the end of that line. Raises as `open_stream`, and LineSilent, NotLbp."""
    stream = open_stream(port, baud)
    try:
        return LbpRemote(WireLink(stream))
    except BaseException:
        stream.close()
        raise
