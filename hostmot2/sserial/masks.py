"""Masks of channels: bit n stands for channel n."""

from __future__ import annotations

from collections.abc import Iterable


def numbers(mask: int) -> list[int]:
    """The channels in a mask."""
    return [number for number in range(8) if mask >> number & 1]


def bits(channels: Iterable[int]) -> int:
    """The mask of channels."""
    return sum(1 << channel for channel in channels)
