"""What `hm2 monitor` shows: snapshots of a running card, and the terminal view of them.

The snapshots (`Source`, `Snapshot`) need nothing but the package; the view (`hostmot2.monitor.app`) needs the
extra `monitor` (`pip install 'hostmot2[monitor]'`).
"""

from __future__ import annotations

from hostmot2.monitor.snapshot import Snapshot
from hostmot2.monitor.source import Source

__all__ = ["Snapshot", "Source"]
