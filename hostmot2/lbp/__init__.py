"""LBP on a serial line: remotes behind RS-422 adapters, for set-up, service and firmware.

from hostmot2 import lbp
with lbp.open("/dev/ttyUSB0") as remote:
    parameters = lbp.parameters(remote)
    parameters["NVMAXCURRENT"] = 2500
"""

from hostmot2.lbp.client import Discovery, LbpRemote
from hostmot2.lbp.describe import describe, parameters
from hostmot2.lbp.errors import (
    AdapterBusy,
    AdapterMissing,
    FirmwareRefused,
    LbpError,
    LineSilent,
    NotLbp,
    RemoteRefused,
    UpdateFailed,
    WrongAnswer,
)
from hostmot2.lbp.link import Link, WireLink
from hostmot2.lbp.opening import open_remote as open
from hostmot2.lbp.opening import open_stream
from hostmot2.lbp.stream import ExchangeStream, Stream

__all__ = [
    "AdapterBusy",
    "AdapterMissing",
    "Discovery",
    "ExchangeStream",
    "FirmwareRefused",
    "LbpError",
    "LbpRemote",
    "LineSilent",
    "Link",
    "NotLbp",
    "RemoteRefused",
    "Stream",
    "UpdateFailed",
    "WireLink",
    "WrongAnswer",
    "describe",
    "open",
    "open_stream",
    "parameters",
]
