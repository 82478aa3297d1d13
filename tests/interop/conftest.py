"""Clients that nobody here wrote, against the emulated card. Run by `make interop`."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from machine import Hal, Network, ServedCard, missing_programs

NEEDED = ("mesaflash", "halrun", "rtapi_app", "ip", "nsenter", "unshare", "setpriv", "chrt")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    here = Path(__file__).parent
    reason = None
    if os.environ.get("HM2_INTEROP") != "1":
        reason = "foreign clients: run by make interop"
    for item in items:
        if here in item.path.parents and reason:
            item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session")
def network():
    # asked for by name: what is missing is a failure, not a skip
    assert os.geteuid() == 0, "network namespaces and rtapi_app need root"
    missing = missing_programs(NEEDED)
    assert not missing, f"not installed: {', '.join(missing)}; tools/interop installs them"
    with Network() as network:
        yield network


@pytest.fixture
def card(network: Network, tmp_path: Path):
    with ServedCard(network, tmp_path) as card:
        yield card
    assert card.status == 0


@pytest.fixture
def hal(network: Network, tmp_path: Path):
    with Hal(network, tmp_path) as hal:
        yield hal
