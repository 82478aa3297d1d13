"""Live view: what an engine does, streamed to Foxglove over a WebSocket, with the topics of recordings.

Needs the extra `live` (`pip install 'hostmot2[live]'`). Nothing can be written through it.
"""

from __future__ import annotations

from hostmot2.errors import LiveError
from hostmot2.live.view import LiveView, serve

__all__ = ["LiveError", "LiveView", "serve"]
