"""Branch and bound on full covers by the pairs of rows that one set may serve together.

For rows r and q let S be the sets over both. Either some set of S is taken, then the
row S itself, which is harder to cover than r or q, joins the rows; or none is, then all
of S goes. Where many sets are nearly alike, both sides raise the bound, whereas taking
or leaving a single set leaves its twins. What is left is a full cover again.

Sets whose reduced cost exceeds what a smaller cover may still spend go below a node.

References:
    Ryan and Foster, "An integer programming approach to scheduling", in: Computer
    Scheduling of Public Transport, North-Holland, 1981.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .branching import INTEGRAL, Tree
from .node_program import Node

# Pairs whose two sides are bounded before one is branched on.
_TRIED = 3
_PAIRS = 400


class RowTree(Tree):
    """The tree whose nodes are split by a pair of rows."""

    def branch(self, node: Node) -> list[Node] | None:
        """Return the two sides of the pair that raise the bounds most."""
        part = node.part
        allowed = part.allowed & (node.bound + node.reduced <= self.cut)
        best: list[Node] = []
        best_gain = -1.0
        room = self.cut - node.bound + 0.01
        for pair in self._pairs(node, allowed):
            with_one = dataclasses.replace(
                part, allowed=allowed, added=(*part.added, pair)
            )
            without = dataclasses.replace(part, allowed=allowed & ~pair)
            taken = self.linear.solve(with_one, node.basis)
            excluded = self.linear.solve(without, node.basis)
            if taken is None or excluded is None:
                return None
            gains = [
                min(max(c.bound - node.bound, 0.0), room) for c in (taken, excluded)
            ]
            gain = (gains[0] + 1e-3) * (gains[1] + 1e-3)
            if gain > best_gain:
                best, best_gain = [excluded, taken], gain
            if min(gains) >= room:
                break
        return best

    def _pairs(self, node: Node, allowed: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
        """Return sets over pairs of rows, of about half a set in the relaxation."""
        rows = np.concatenate(
            [self.linear.rows, *(row[None] for row in node.part.added)]
        )
        if node.dual.size != len(rows):
            node = dataclasses.replace(node, dual=np.ones(len(rows)))
        heavy = np.flatnonzero(node.dual > INTEGRAL)
        support = np.flatnonzero(
            (node.primal > INTEGRAL) & (node.primal < 1.0 - INTEGRAL) & allowed
        )
        over = rows[np.ix_(heavy, support)].astype(np.float64)
        both = (over * node.primal[support]) @ over.T
        alone = over @ node.primal[support]
        apart = np.minimum(alone[:, None], alone[None]) - both
        score = np.minimum(both, apart) * (node.dual[heavy, None] + node.dual[heavy])
        score = np.round(np.triu(score, 1), 9)
        order = np.argsort(-score, axis=None, kind="stable")[:_PAIRS]
        pairs: list[NDArray[np.bool_]] = []
        seen: set[bytes] = set()
        used = np.zeros(heavy.size, dtype=np.int64)
        for i, j in zip(*np.unravel_index(order, score.shape), strict=True):
            if not score[i, j] > 0 or len(pairs) == _TRIED:
                break
            if used[i] + used[j] > 1:
                continue
            pair = rows[heavy[i]] & rows[heavy[j]] & allowed
            key = pair[support].tobytes()
            if key not in seen:
                seen.add(key)
                used[[i, j]] += 1
                pairs.append(pair)
        if support.size and len(pairs) < 2:
            middle = np.argmin(np.abs(node.primal[support] - 0.5))
            pairs.append(np.arange(allowed.size) == support[middle])
        if not pairs:
            pairs.append(np.arange(allowed.size) == np.flatnonzero(allowed)[0])
        return pairs
