"""Members that a rig needn't serve: whom none could, then those that cost devices.

With one device fewer the cover that lacks least of all quotas leaves some members
short. Where they are few enough, the rest takes fewer devices; and so on.
"""

import numpy as np

from planning.projectors.candidate_set import CandidateSet
from planning.proofs.selection import CandidateCover


def unreachable_members(
    candidates: CandidateSet, n_members: int, allowed: int
) -> frozenset[int]:
    """Return the members of which no candidates light as much as must be reachable.

    None, where they are more than may be left out.
    """
    member, least = candidates.samples.member, candidates.scene.requirements
    n = np.bincount(member, minlength=n_members)
    reached = np.bincount(member[candidates.reached], minlength=n_members)
    dark = np.flatnonzero(reached < least.min_reachable * n)
    return frozenset(dark.tolist() if len(dark) <= allowed else ())


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
