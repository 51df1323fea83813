"""That no K candidates cover as many samples as are required, in whole numbers.

What is checked is a tree (`docs/method/covers.md`). A node holds the selections of at
most K sets of which none is closed, with one or more of each of some groups. A branch
on a group: one or more of it are taken, or all of it is closed. A leaf falls by
multipliers lambda_e in {0 .. D}, D for a whole sample: its sets cover at most::

    sum_e (D - lambda_e) + the K largest sums of lambda_e over what a set covers

D-th samples, the K being the largest of each group and the largest others. All of it
are sums of whole numbers below 2^53, which double precision adds exactly.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints, Mask
from planning.model.proofs import CoverProof

# Sums in single precision are exact up to here; more samples go in double precision.
_EXACT = 1 << 24
# Parts that wait, times sets: trees that we write have a few hundred of them.
_MOST_WAITING = 50_000_000


class RefutedProofError(Exception):
    """A certificate that doesn't prove what it is for; says why."""


@dataclass(eq=False)
class _Node:
    """Selections that take none of what is closed, and one or more of each group.

    Attributes:
        closed: Whether each set is, (m,).
        group: Number of the group that each set is of, -1: of none, (m,).
        n_groups: How many there are, of which some may be empty.
    """

    closed: Mask
    group: Ints
    n_groups: int


def refute(covers: Mask, proof: CoverProof, required: int) -> None:
    """Hold a certificate against what sets (columns) cover of samples, (n, m).

    Raises:
        RefutedProofError: If it leaves it open that `proof.n_sets` sets cover as many
            samples as are required.
    """
    sets, owner = np.unique(proof.stand_in, return_inverse=True)
    # What stands for others covers what they cover: so no selection is left out.
    united = np.zeros((len(covers), len(sets)), dtype=bool)
    for column, at in zip(covers.T, owner.tolist(), strict=True):
        united[:, at] |= column
    if proof.n_sets <= 2:
        most = _most_of_few(united, proof.n_sets)
        if most >= required:
            raise RefutedProofError(
                f"{proof.n_sets} candidates cover {most} samples, {required} are "
                f"required"
            )
        return
    _Tree(united, sets, proof, required).check()


def _most_of_few(covers: Mask, n_sets: int) -> int:
    """Return how many samples so many sets, two at most, cover, all looked at."""
    counts = covers.sum(axis=0)
    if n_sets < 2 or len(counts) < 2:
        return int(counts.max(initial=0)) if n_sets else 0
    ones = covers.astype(np.float32 if len(covers) < _EXACT else np.float64)
    both = ones.T @ ones
    return int((counts[:, None] + counts[None, :] - both).max())


class _Tree:
    """Follows the nodes of a certificate and holds every leaf below what is asked."""

    def __init__(
        self, covers: Mask, sets: Ints, proof: CoverProof, required: int
    ) -> None:
        self.sets, self.proof, self.required = sets, proof, required
        shares = proof.multipliers.astype(np.float64)
        if np.any(shares > proof.whole):
            raise RefutedProofError("a multiplier exceeds the weight of a sample")
        self.unpaid = proof.whole * len(covers) - shares.sum(axis=1)
        self.paid: Array = shares @ covers
        ends = proof.group_ends
        self.groups = np.split(proof.groups, ends[:-1]) if len(ends) else []

    def check(self) -> None:
        """Hold all nodes.

        Raises:
            RefutedProofError: If one is open, or the tree isn't whole.
        """
        n = len(self.sets)
        waiting = [_Node(np.zeros(n, dtype=bool), np.full(n, -1), 0)]
        branches = iter(self.groups)
        for code in self.proof.nodes.tolist():
            if not waiting:
                raise RefutedProofError("nodes are left over")
            node = waiting.pop()
            if len(waiting) * n > _MOST_WAITING:
                raise RefutedProofError(f"{len(waiting)} parts wait for one")
            if code == self.proof.BRANCH:
                group = next(branches, None)
                if group is None:
                    raise RefutedProofError("a branch has no group")
                waiting += reversed(self._split(node, group))
            elif self._most(node, code) >= self.required * self.proof.whole:
                raise RefutedProofError(
                    f"a part of the selections of {self.proof.n_sets} may cover "
                    f"{self._most(node, code) / self.proof.whole:.1f} samples, "
                    f"{self.required} are required"
                )
        if waiting:
            raise RefutedProofError(f"{len(waiting)} parts aren't looked at")

    def _split(self, node: _Node, named: Ints) -> tuple[_Node, _Node]:
        """Return the part that takes some of a group, and the part that takes none."""
        group = np.searchsorted(self.sets, named)
        if not len(group) or not np.isin(named, self.sets).all():
            raise RefutedProofError("a group is empty, or names none that stands")
        closed, some, none = node.closed.copy(), node.group.copy(), node.group.copy()
        closed[group], none[group] = True, -1
        whose, n = node.group[group], node.n_groups
        within = int(whose[0])
        if np.any(whose != within):
            raise RefutedProofError("two groups have sets in common")
        if within < 0:
            within, n = n, n + 1
        # One of a part of a group is one of the group.
        some[some == within] = -1
        some[group] = within
        return _Node(node.closed, some, n), _Node(closed, none, node.n_groups)

    def _most(self, node: _Node, code: int) -> float:
        """Return D times what the selections of a leaf cover at most."""
        spare = self.proof.n_sets - node.n_groups
        members = np.flatnonzero((node.group >= 0) & ~node.closed)
        if spare < 0 or len(np.unique(node.group[members])) < node.n_groups:
            return 0.0
        if not 0 <= code < len(self.paid):
            raise RefutedProofError(f"there are no multipliers {code}")
        paid = self.paid[code].copy()
        # Group by group, the largest last.
        members = members[np.lexsort((paid[members], node.group[members]))]
        best = members[np.diff(node.group[members], append=-1) != 0]
        most = float(self.unpaid[code]) + float(paid[best].sum())
        paid[best] = 0.0
        # There may be fewer sets than may be taken: then all of them count.
        dearest = np.sort(np.where(node.closed, 0.0, paid))[::-1]
        return most + float(dearest[:spare].sum())
