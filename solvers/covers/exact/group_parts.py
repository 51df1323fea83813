"""How parts of the selections of K sets are split, and which hold but one."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solvers.covers.answers import NONE

from .group_bounds import GroupPart

# Sets about which a group is tried, and the least likeness of its members.
_CENTRES = 6
_LIKENESS = (0.6, 0.3)


def only_selection(part: GroupPart, n_sets: int) -> NDArray[np.int64] | None:
    """Return the selection that covers all that a part's can, if it is one."""
    if any(group.size > 1 for group in part.groups):
        return None
    taken = np.concatenate([NONE, *part.groups])
    if taken.size == n_sets:
        return taken
    others = np.setdiff1d(np.flatnonzero(~part.closed), taken)
    spare = n_sets - taken.size
    return np.concatenate([taken, others]) if others.size <= spare else None


def children(
    part: GroupPart, n_sets: int, alike: NDArray[np.float32]
) -> list[GroupPart]:
    """Return the part without a group, and with at least one of it.

    `alike` says how much any two sets cover the same, shape (n_s, n_s).
    """
    home, group = _group(part, n_sets, alike)
    closed = part.closed.copy()
    closed[group] = True
    others = tuple(other for i, other in enumerate(part.groups) if i != home)
    without = others
    if home >= 0:
        without += (np.setdiff1d(part.groups[home], group),)
    part = replace(part, pace=(1.0, 0), costliest=NONE)
    fewer = replace(part, closed=closed, groups=without)
    return [replace(part, groups=(*others, group)), fewer]


def _group(
    part: GroupPart, n_sets: int, alike: NDArray[np.float32]
) -> tuple[int, NDArray[np.int64]]:
    """Return the group that holds the sets to branch on, or -1, and the sets."""
    home = np.full(part.closed.size, -1)
    for i, group in enumerate(part.groups):
        home[group] = i if group.size > 1 else -2
    if len(part.groups) == n_sets:
        home[home == -1] = -2
    free = ~part.closed & (home != -2)
    mean = np.where(free, part.primal, -1.0)
    best, chosen = -np.inf, (-1, NONE)
    for centre in np.argsort(-mean, kind="stable")[:_CENTRES]:
        if not free[centre]:
            break
        near = free & (home == home[centre])
        for least in _LIKENESS:
            group = np.flatnonzero(near & (alike[centre] >= least))
            if home[centre] >= 0 and group.size == part.groups[home[centre]].size:
                break
            share = float(part.primal[group].sum())
            worth = min(share, 1.0 - share)
            if worth > best:
                best, chosen = worth, (int(home[centre]), group)
    if chosen[1].size:
        return chosen
    largest = int(np.argmax([group.size for group in part.groups]))
    return largest, part.groups[largest][: part.groups[largest].size // 2]
