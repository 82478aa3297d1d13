"""Real-time priority and locked memory for a group, and a systemd unit for programs that run a machine."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from hostmot2.setup.files import MachineFile, checked_name

LIMITS = Path("/etc/security/limits.d/70-hostmot2.conf")
UNIT = Path("/etc/systemd/system/hostmot2@.service")
PRIORITY = 80
_LIMITS = """\
# For logins of the group {group}; a new login is needed.
# SCHED_FIFO up to {priority}: the cycle's thread must come before everything else on its processor
@{group} - rtprio {priority}
# the cycle's memory must not be swapped out
@{group} - memlock unlimited
"""
_UNIT = """\
# One program: systemctl start hostmot2@NAME runs {directory}/NAME.py
[Unit]
Description=hostmot2 program %i
# a card on the network can be reached from then on
Wants=network-online.target
After=network-online.target

[Service]
Type=exec
ExecStart={python} {directory}/%i.py
# not root: the udev rule and these limits are all it needs
User={user}
Group={group}
# as in limits.d, which services do not read
LimitRTPRIO={priority}
LimitMEMLOCK=infinity
# the same as capabilities, for kernels that ask for them, and nothing beyond
AmbientCapabilities=CAP_SYS_NICE CAP_IPC_LOCK
CapabilityBoundingSet=CAP_SYS_NICE CAP_IPC_LOCK
NoNewPrivileges=yes
{affinity}
# SIGTERM switches the outputs off; then it may take this long to end
TimeoutStopSec=5
# never again by itself: outputs stay off until somebody has looked
Restart=no

[Install]
WantedBy=multi-user.target
"""


def realtime_files(
    group: str,
    *,
    cpu: str = "",
    user: str = "hostmot2",
    directory: str = "/opt/hostmot2",
    python: str = sys.executable,
) -> tuple[list[MachineFile], list[str]]:
    """limits.d and the unit template, and what to do as root once they are installed.

    cpu: processors the program may use, as systemd writes them ("3" or "2-3"); "" for all. Raises ValueError
    for a name, list or directory that cannot be.
    """
    checked_name(group, "group")
    checked_name(user, "user")
    if cpu and not re.fullmatch(r"\d+(-\d+)?([, ]\d+(-\d+)?)*", cpu, re.ASCII):
        raise ValueError(f"{cpu!r} is no list of processors such as 3 or 2-3")
    if not re.fullmatch(r"/[^\s%\"'\\$]*", directory):
        raise ValueError(f"{directory!r} is no directory that a unit can name: from / on, without spaces")
    affinity = "# all processors; CPUAffinity=3 would keep it on an isolated one"
    if cpu:
        affinity = f"# the isolated processor; the NIC's interrupt belongs there, too\nCPUAffinity={cpu}"
    unit = _UNIT.format(
        directory=directory, python=python, user=user, group=group, priority=PRIORITY, affinity=affinity
    )
    limits = _LIMITS.format(group=group, priority=PRIORITY)
    then = [
        f"groupadd -f {group}",
        f"usermod -a -G {group} YOUR_NAME   # then log in anew",
        f"useradd --system --gid {group} {user}   # whom services run as",
        "systemctl daemon-reload",
        "isolcpus=N nohz_full=N rcu_nocbs=N on the kernel's command line keep processor N free (hm2 doctor)",
    ]
    return [MachineFile("rt", LIMITS, limits), MachineFile("rt", UNIT, unit)], then
