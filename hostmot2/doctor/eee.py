"""Energy-Efficient Ethernet over ethtool netlink: the two messages pyroute2 does not have yet.

Numbers: linux/ethtool_netlink.h.
"""

from __future__ import annotations

from typing import Any

from pyroute2.netlink import NLM_F_ACK, NLM_F_REQUEST, genlmsg
from pyroute2.netlink.generic import GenericNetlinkSocket
from pyroute2.netlink.generic.ethtool import (
    ETHTOOL_GENL_NAME,
    ETHTOOL_GENL_VERSION,
    ethtoolbitset,
    ethtoolheader,
)

EEE_GET, EEE_SET = 23, 24


class EeeMessage(genlmsg):  # type: ignore[misc]
    """ETHTOOL_MSG_EEE_*."""

    nla_map = (
        ("ETHTOOL_A_EEE_UNSPEC", "none"),
        ("ETHTOOL_A_EEE_HEADER", "ethtoolheader"),
        ("ETHTOOL_A_EEE_MODES_OURS", "ethtoolbitset"),
        ("ETHTOOL_A_EEE_MODES_PEER", "ethtoolbitset"),
        ("ETHTOOL_A_EEE_ACTIVE", "uint8"),
        ("ETHTOOL_A_EEE_ENABLED", "uint8"),
        ("ETHTOOL_A_EEE_TX_LPI_ENABLED", "uint8"),
        ("ETHTOOL_A_EEE_TX_LPI_TIMER", "uint32"),
    )
    ethtoolheader = ethtoolheader
    ethtoolbitset = ethtoolbitset


def message(command: int, name: str, enabled: bool | None = None) -> EeeMessage:
    """A request for the interface `name`."""
    made = EeeMessage()
    made["cmd"], made["version"] = command, ETHTOOL_GENL_VERSION
    made["attrs"].append(("ETHTOOL_A_EEE_HEADER", {"attrs": [["ETHTOOL_A_HEADER_DEV_NAME", name]]}))
    if enabled is not None:
        made["attrs"].append(("ETHTOOL_A_EEE_ENABLED", int(enabled)))
    return made


def _ask(request: EeeMessage, flags: int) -> Any:
    with GenericNetlinkSocket() as socket:
        socket.bind(ETHTOOL_GENL_NAME, EeeMessage)
        return socket.nlm_request(request, msg_type=socket.prid, msg_flags=flags)


def get_eee(name: str) -> bool:
    """Whether EEE is enabled. NetlinkError if the driver has none."""
    (found,) = _ask(message(EEE_GET, name), NLM_F_REQUEST)
    return bool(found.get_attr("ETHTOOL_A_EEE_ENABLED"))


def set_eee(name: str, on: bool) -> None:
    """Switch EEE. NetlinkError if the driver refuses."""
    _ask(message(EEE_SET, name, on), NLM_F_REQUEST | NLM_F_ACK)
