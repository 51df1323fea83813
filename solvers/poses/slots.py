"""Sizes of compiled programs: few, so that few are built."""

from collections.abc import Sequence


def slots_for(n: int, sizes: Sequence[int]) -> int:
    """Return the smallest size that holds n; n itself beyond the largest, and for 0."""
    return n if n == 0 else next((m for m in sizes if m >= n), n)
