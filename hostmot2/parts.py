"""Which class answers for which attribute of a Board.

A row is `attribute: (module, class)`; the class is called with the board when the attribute is first used.
It raises ModuleMissing if the card has no such part, and registers what must be turned off with
Board.on_close.
"""

from __future__ import annotations

PARTS: dict[str, tuple[str, str]] = {}
