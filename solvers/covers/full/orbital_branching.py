"""Branch and bound on full covers whose sets are alike, by orbits of sets.

What is left of a node is a full cover again: the open rows over the sets that may still
be taken. Where a symmetry of it carries set j to set i, a smaller cover with j exists
just when one with i does. So either one set of an orbit is taken, whichever, or all of
the orbit goes::

    x_i = 1   or   x_j = 0 for all j in orbit(i)

The orbit branched on is the one that most rows of few sets wait for, by
sum_e 2^-|S_e| over the open rows e of its sets.

References:
    Ostrowski, Linderoth, Rossi and Smriglio, "Orbital branching", Mathematical
    Programming 126, 2011. Jeroslow and Wang, "Solving propositional satisfiability
    problems", Annals of Mathematics and Artificial Intelligence 1, 1990.
"""

import numpy as np
from numpy.typing import NDArray

from .branching import Tree
from .node_program import Node, NodePart
from .row_dominance import essential
from .symmetry import column_orbits

# Share of what is left that one node's dominance may spend.
_DOMINANCE = 0.05


class OrbitalTree(Tree):
    """The tree whose nodes are split by an orbit of sets."""

    def branch(self, node: Node) -> list[Node] | None:
        """Return what is left of the node, smaller, or else split."""
        part = node.part
        free = part.allowed & ~part.taken
        allowed = part.allowed & ~(free & (node.bound + node.reduced > self.cut))
        taken = part.taken | (free & (node.bound - node.reduced > self.cut))
        open_rows = np.flatnonzero(~self.covers[:, taken].any(axis=1))
        candidates = np.flatnonzero(allowed & ~taken)
        self.budget.spend(
            float(self.covers.size + 2 * open_rows.size * candidates.size)
        )
        remaining = self.covers[np.ix_(open_rows, candidates)]
        if not remaining.any(axis=1).all():
            return []
        rows, columns = essential(
            remaining, self.budget.part(_DOMINANCE * self.budget.remaining)
        )
        remaining = remaining[np.ix_(rows, columns)]
        allowed = taken.copy()
        allowed[candidates[columns]] = True
        only = remaining[remaining.sum(axis=1) == 1].any(axis=0)
        if only.any() or columns.size < candidates.size or np.any(taken & ~part.taken):
            taken[candidates[columns[only]]] = True
            return self._solved(
                node, NodePart(allowed, taken, symmetric=part.symmetric)
            )
        return self._split(node, remaining, candidates, allowed)

    def _split(
        self,
        node: Node,
        remaining: NDArray[np.bool_],
        candidates: NDArray[np.int64],
        allowed: NDArray[np.bool_],
    ) -> list[Node] | None:
        """Return both sides of the orbit that most rows of few sets wait for."""
        part = node.part
        orbits = np.arange(candidates.size)
        if part.symmetric:
            orbits = column_orbits(remaining, self.budget)
        symmetric = np.unique(orbits).size < candidates.size
        urgent = np.exp2(-remaining.sum(axis=1).astype(np.float64)) @ remaining
        score = np.round(np.bincount(orbits, urgent), 12)
        best = int(np.argmax(score))
        orbit = candidates[orbits == best]
        taken, fewer = part.taken.copy(), allowed.copy()
        taken[candidates[best]] = True
        fewer[orbit] = False
        return self._solved(
            node,
            NodePart(fewer, part.taken, symmetric=symmetric),
            NodePart(allowed, taken, symmetric=symmetric),
        )

    def _solved(self, node: Node, *parts: NodePart) -> list[Node] | None:
        nodes = [self.linear.solve(part, node.basis) for part in parts]
        return None if None in nodes else [n for n in nodes if n is not None]
