"""Members that a rig needn't serve: as many as may be, of those that cost devices.

With one device fewer the cover that lacks least of all quotas leaves some members
short. Where they are few enough, the rest takes fewer devices; and so on.
"""

import numpy as np

from planning.proofs.selection import CandidateCover


def costly_members(cover: CandidateCover, needed: int, allowed: int) -> frozenset[int]:
    """Return up to so many members without which fewer candidates are enough.

    Args:
        cover: Candidates, with a quota of each member (`RegionFloors`).
        needed: Candidates that are enough for all members.
        allowed: Members that may be left out.
    """
    left, quotas = frozenset[int](), cover.quotas
    for count in range(needed - 1, 0, -1):
        chosen, _ = cover.most_covering(count, None)
        counts = quotas.regions.counts(cover.covered(chosen))
        short = frozenset((np.flatnonzero(counts < quotas.floors) - 1).tolist())
        if len(short) > allowed:
            break
        left = short
    return left
